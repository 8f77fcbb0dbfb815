"""Further sets of configurations of the models whose configurations are drawn."""

from __future__ import annotations

import numpy as np

from robid.models.elastic.fit.fitting import fit_elastic
from robid.pipeline.graph import Run
from robid.studies.settings.study import ModelChoice, ZimmermannStudy
from robid.studies.study import Earlier
from robid.studies.tasks import Content, Task
from robid.studies.zimmermann2023.models import Fitting, fitted_parameters, model_set, model_task, read_responses
from robid.studies.zimmermann2023.study import pairs, study_of

_FURTHER = 1  # keeps the draw of further sets apart from that of the first


def further_sets(choice: ModelChoice, n_conf: int) -> tuple[tuple[int, ...], ...]:
    """Returns as many further sets of configurations as a drawn model's pool has that share none.

    Args:
        choice: The model's data.
        n_conf: Number of configurations.
    """
    if choice.count is None or choice.low_torque is not None:
        return ()
    pool = np.arange(n_conf) if choice.configurations is None else np.array(choice.configurations)
    left = np.setdiff1d(pool, model_set(choice, {}, n_conf))
    left = np.random.default_rng([choice.seed, _FURTHER]).permutation(left)
    count = choice.count
    return tuple(tuple(sorted(left[at : at + count].tolist())) for at in range(0, left.size - count + 1, count))


def set_tasks(run: Run, earlier: Earlier) -> list[Task]:
    """Returns one task for each individual and further set of each drawn model, in the order of `owners_of_sets`."""
    study = study_of(run.loaded)
    return [
        model_task(run, study, pair, name, used, f"{name}_{number}_{further}", judged=False)
        for number, pair in enumerate(pairs(run, earlier), 1)
        for name, choice in study.models.items()
        for further, used in enumerate(further_sets(choice, len(pair.configurations)), 2)
    ]


def owners_of_sets(study: ZimmermannStudy, n_conf: int) -> list[str]:
    """Returns the model of each further set of one individual, in the order of its tasks."""
    return [name for name, choice in study.models.items() for _ in further_sets(choice, n_conf)]


def fit_set(one: Fitting) -> Content:
    """Fits a model that is not judged."""
    frf = read_responses([one.estimation[index] for index in one.used])
    solution = fit_elastic(one.robots[0], frf, one.options, one.delay_s)
    return Content(fitted_parameters(one, solution), {"status": solution.estimate.status, "misfit": solution.misfit})
