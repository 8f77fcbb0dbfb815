"""Estimates of several individuals of the robot against the truth, estimator by estimator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.artifacts.artifact import Artifact, Dataset
from robid.artifacts.kinds import FRF
from robid.artifacts.store import read_header
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.settings import model_settings
from robid.pipeline.graph import Run
from robid.robot.description import Robot
from robid.settings.robot_parts import delay_s, plain_settings
from robid.settings.sources import true_robot_of
from robid.studies.over_individuals import stated_std
from robid.studies.settings.elastic import WernholtStudy
from robid.studies.simulated import simulate_options
from robid.studies.study import Earlier, study_of
from robid.studies.tasks import Content, Task
from robid.studies.wernholt2008.study import read_frf, with_estimator

_RESULT = 3
"""Version of what a result holds."""


@dataclass(frozen=True)
class Fitting:
    """One estimator on one individual."""

    robot: Robot  # The robot file's
    truth: Robot  # The true robot
    frf: Path  # Where its responses lie
    options: ElasticOptions  # Options of the fit
    delay_s: float  # Nominal delay [s]


@dataclass(frozen=True)
class Individuals:
    """What all estimators make of the individuals."""

    names: tuple[str, ...]  # Names of the parameters
    error: dict[str, FloatArray]  # Logarithm of estimate over truth (n_individual, n_param) by estimator
    # The same of the middles of the intervals, where what the robot file may have wrong is estimated along
    physical: dict[str, FloatArray]
    # Deviation of each logarithm that the fit's interval states (n_individual, n_param) by estimator
    std: dict[str, FloatArray]
    inside: dict[str, BoolArray]  # Whether that interval holds the truth (n_individual, n_param) by estimator
    # Cost over what noise and the assumed model error give (n_individual,) by estimator
    misfit: dict[str, FloatArray]


def sizes_of(error: FloatArray) -> FloatArray:
    """Size of errors (n_individual, n_param) of each individual, the median: a few parameters are hardly determined."""
    return np.asarray(np.median(np.abs(error), axis=1))


def estimators_of(study: WernholtStudy) -> list[str]:
    """Returns the estimators that are held against the individuals."""
    every = [name for name, one in study.estimators.items() if one.configurations == "all"]
    return list(study.individual_estimators) or every


def individual_tasks(run: Run, _earlier: Earlier) -> list[Task]:
    """Returns one task for each individual and estimator."""
    study = study_of(run.loaded, WernholtStudy)
    found = []
    for campaign_name in study.individuals:
        campaign = run.loaded.experiment.campaigns[campaign_name]
        robot = run.loaded.robot.to_robot(campaign.payload_kg)
        simulated = simulate_options(campaign)
        truth = true_robot_of(run.loaded.robot, campaign.payload_kg, simulated.truth)
        path, delay = run.path(f"{campaign_name}/frf.h5"), delay_s(run.loaded, campaign)
        decides = {
            "frf": read_header(path, FRF).content_sha256,
            "source": plain_settings(campaign.source),
            "result": _RESULT,
            **model_settings(run.loaded, campaign_name),
        }
        for name in estimators_of(study):
            choice = study.estimators[name]
            options = replace(
                with_estimator(study.fit, choice.estimator, choice.weights), starts=study.individual_starts
            )
            fitting = Fitting(robot, truth, path, options, delay)
            found.append(Task(f"{name}_{campaign_name}", {**decides, "options": plain_settings(options)}, fitting))
    return found


def fit_individual(one: Fitting) -> Content:
    """Fits one individual and holds its springs and dampers against the truth."""
    solution = fit_elastic(one.robot, read_frf(one.frf), one.options, one.delay_s)
    estimate = solution.estimate
    true = {f"{spring.name}.stiffness": spring.stiffness for spring in one.truth.springs}
    true |= {f"{spring.name}.damping": spring.damping for spring in one.truth.springs}
    known = [index for index, name in enumerate(estimate.names) if name in true]
    names = [estimate.names[index] for index in known]
    truth = np.array([true[name] for name in names])
    lower, upper = estimate.lower[known], estimate.upper[known]
    parameter = ("parameter",)
    datasets = {
        "names": Dataset(np.array(names), "1", parameter),
        "error": Dataset(
            np.log(estimate.value[known] / truth), "1", parameter, "Logarithm of the estimate over the truth"
        ),
        "physical": Dataset(
            np.log(estimate.middle[known] / truth), "1", parameter, "Logarithm of the interval's middle over the truth"
        ),
        "std": Dataset(
            stated_std(lower, upper, estimate.confidence), "1", parameter, "Deviation that the fit's interval states"
        ),
        "inside": Dataset((lower <= truth) & (truth <= upper), "1", parameter, "Whether that interval holds the truth"),
        "misfit": Dataset(np.array(solution.misfit), "1", (), "Cost over what noise and the assumed model error give"),
    }
    return Content(datasets, {"status": estimate.status})


def gather_individuals(study: WernholtStudy, results: Sequence[Artifact]) -> Individuals | None:
    """Puts the individuals' results together; None where the study has none."""
    if not results:
        return None
    estimators = estimators_of(study)

    def every(key: str) -> dict[str, Any]:
        values = [result.datasets[key].values for result in results]
        return {name: np.array(values[at :: len(estimators)]) for at, name in enumerate(estimators)}

    return Individuals(
        names=tuple(results[0].datasets["names"].values.tolist()),
        error=every("error"),
        physical=every("physical"),
        std=every("std"),
        inside=every("inside"),
        misfit=every("misfit"),
    )
