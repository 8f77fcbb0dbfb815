"""The fits of the study of trust: each robot in its random places, and in fresh and designed ones for the reference."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from robid.artifacts.artifact import Artifact, Dataset
from robid.errors import DataError
from robid.models.elastic.files import solution_content, solution_from_artifact
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.solution import ElasticSolution
from robid.models.elastic.settings import elastic_fit, model_settings
from robid.models.elastic.truth import true_values
from robid.pipeline import Run
from robid.robot.description import Robot
from robid.robot.doubts import Doubts
from robid.settings.robot_parts import delay_s, plain_settings
from robid.simulate.truth import TrueRobot
from robid.stages.simulate_or_acquire import simulated_experiment, simulated_truth
from robid.studies.changed import changed_simulation
from robid.studies.study import Earlier
from robid.studies.tasks import Content, Results, Task
from robid.studies.trust.individuals import Individual
from robid.studies.trust.responses import REFUSAL, files_of, read_responses, simulated
from robid.studies.trust.study import DESIGNED, FRESH, RANDOM, Machine, machines, study_of


@dataclass(frozen=True)
class Fitting:
    """A fit.

    Attributes:
        responses: Where the responses of its places lie.
        robot: The robot file's, with the campaign's payload.
        options: Options of the fit.
        delay_s: Nominal delay [s].
        truth: The robot that was simulated.
    """

    responses: tuple[Path, ...]
    robot: Robot
    options: ElasticOptions
    delay_s: float
    truth: TrueRobot


def model_tasks(run: Run, earlier: Earlier) -> list[Task]:
    """Returns the fits: those of the reference ask for all of a robot's fresh places."""
    known, found = machines(run), []
    for one in simulated(run):
        for use in fits_of(one, known[one.robot]):
            decides, fitting = make_fitting(run, known[one.robot], one, use, earlier[0])
            found.append(Task(model_name(one, use), decides, fitting))
    return found


def fits_of(one: Individual, machine: Machine) -> Iterator[str]:
    """Yields the places that a robot is fitted in, each on their own."""
    yield RANDOM
    if one.referenced:
        yield from (use for use in (FRESH, DESIGNED) if use in machine.places)


def model_name(one: Individual, use: str) -> str:
    """Returns the name of a fit's task."""
    return f"{one.key}_{use}"


def make_fitting(
    run: Run, machine: Machine, one: Individual, use: str, responses: Results
) -> tuple[dict[str, Any], Fitting]:
    """Returns a fit with what decides its result."""
    loaded, places = machine.loaded, machine.places[use]
    options = elastic_fit(loaded.experiment, study_of(run.loaded).fit).options()
    simulate = changed_simulation(places.campaign, one.physics, one.seed)
    experiment = simulated_experiment(loaded, places.campaign, simulate, places.content)
    delay = delay_s(loaded, places.campaign)
    files = files_of(responses, one, use)
    decides = {
        "responses": [path.name for path in files],
        "options": plain_settings(options),
        "settings": model_settings(loaded, places.owner),
        "doubts": use == RANDOM,
    }
    nominal = loaded.robot.to_robot(places.campaign.payload_kg)
    if use != RANDOM:  # its springs are held against nothing: what predicts does not look at doubts
        nominal = certain(nominal)
    return decides, Fitting(files, nominal, options, delay, simulated_truth(experiment, delay))


def certain(robot: Robot) -> Robot:
    """Returns a robot whose file is taken for granted."""
    nothing = Doubts(**{each.name: 0.0 for each in fields(Doubts)})
    joints = tuple(replace(joint, doubts=nothing) for joint in robot.joints)
    return replace(robot, joints=joints, doubts=nothing)


def fit_individual(one: Fitting) -> Content:
    """Fits a robot, or says why it was refused; its true values lie beside."""
    try:
        solution = fit_elastic(one.robot, read_responses(one.responses), one.options, one.delay_s)
    except DataError as error:
        return Content({}, {REFUSAL: str(error)})
    content = solution_content(solution)
    return with_truth(Content(*content), true_values(one.robot, one.truth))


def with_truth(content: Content, truth: dict[str, float]) -> Content:
    """Returns a fit's content with the true values by name."""
    names = Dataset(np.array(list(truth)), "1", ("truth",))
    values = Dataset(np.array(list(truth.values())), "SI", ("truth",), "True values by name")
    return Content({**content.datasets, "truth_names": names, "truth": values}, content.attributes)


def read_model(held: Artifact) -> tuple[ElasticSolution, dict[str, float]] | None:
    """Returns a fit and the true values; None where it was refused."""
    if REFUSAL in held.attributes:
        return None
    names, values = (held.datasets[key].values.tolist() for key in ("truth_names", "truth"))
    return solution_from_artifact(held), dict(zip(names, values, strict=True))
