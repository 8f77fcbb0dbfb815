"""The fits of the study of trust, in random, fresh and designed places, and what each is said to be worth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from robid.artifacts.artifact import Attribute, Dataset
from robid.artifacts.kinds import TASK
from robid.artifacts.store import read_artifact
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fitting import true_values
from robid.models.elastic.judge.assessment import assess_fit
from robid.models.elastic.judge.validating import validate_elastic
from robid.models.elastic.settings import elastic_fit, model_settings
from robid.pipeline.graph import Run
from robid.pipeline.simulate_or_acquire import simulated_experiment, simulated_truth
from robid.results.doubt import Doubt
from robid.robot.description import Robot
from robid.robot.doubts import Doubts
from robid.settings.robot_parts import delay_s, plain_settings
from robid.simulate.truth import TrueRobot
from robid.studies.experiments import changed_simulation
from robid.studies.mistakes.cases import GRADING, refused_causes
from robid.studies.settings.trust import TrustStudy
from robid.studies.simulated import REFUSAL, kept_solution, kept_truth, read_responses, solution_or_refusal, with_truth
from robid.studies.study import Earlier, study_of
from robid.studies.tasks import Content, Results, Task
from robid.studies.trust.individuals import Individual
from robid.studies.trust.responses import DESIGNED, FRESH, RANDOM, Machine, files_of, machines, simulated


@dataclass(frozen=True)
class Fitting:
    """A fit."""

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
            found.append(Task(f"{one.key}_{use}", decides, fitting))
    return found


def fits_of(one: Individual, machine: Machine) -> Iterator[str]:
    """Yields the places that a robot is fitted in, each on their own."""
    yield RANDOM
    if one.referenced:
        yield from (use for use in (FRESH, DESIGNED) if use in machine.places)


def make_fitting(
    run: Run, machine: Machine, one: Individual, use: str, responses: Results
) -> tuple[dict[str, Any], Fitting]:
    """Returns a fit with what decides its result."""
    loaded, places = machine.loaded, machine.places[use]
    options = elastic_fit(loaded.experiment, study_of(run.loaded, TrustStudy).fit).options()
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
    content = solution_or_refusal(
        lambda: fit_elastic(one.robot, read_responses(one.responses), one.options, one.delay_s)
    )
    return with_truth(content, true_values(one.robot, one.truth))


@dataclass(frozen=True)
class Graded:
    """A fit to be graded."""

    fitting: Fitting
    model: Path
    fresh: tuple[Path, ...]


def grade_tasks(run: Run, earlier: Earlier) -> list[Task]:
    """Returns one task for each robot that is simulated."""
    known, study = machines(run), study_of(run.loaded, TrustStudy)
    models = earlier[1].by_name
    found = []
    for one in simulated(run):
        fitting = make_fitting(run, known[one.robot], one, RANDOM, earlier[0])[1]
        model = models[f"{one.key}_{RANDOM}"]
        fresh = files_of(earlier[0], one, FRESH)[: study.validated_in]
        decides = {"model": model.name, "fresh": [path.name for path in fresh], "grading": GRADING}
        found.append(Task(one.key, decides, Graded(fitting, model, fresh)))
    return found


def grade_individual(one: Graded) -> Content:
    """Says what speaks against a fit and, with places to validate in, which grade it gets."""
    held, fitting, frf = read_artifact(one.model, TASK), one.fitting, None
    try:
        solution = kept_solution(held)
        frf = read_responses(fitting.responses)
        doubts = assess_fit(fitting.robot, solution, frf, fitting.options, fitting.delay_s).doubts
        if not one.fresh:
            return _content(doubts, {})
        new, truth = read_responses(one.fresh), kept_truth(held)
        validation = validate_elastic(fitting.robot, solution, new, fitting.options, fitting.delay_s, truth, doubts)
    except DataError as error:
        return _refused(fitting, frf, str(error))
    return _content(validation.outcome.grade.doubts, {"grade": validation.outcome.grade.value})


def _refused(fitting: Fitting, frf: Frf | None, text: str) -> Content:
    """What a refusal amounts to: nothing may be used."""
    causes = refused_causes(fitting.robot, frf, text, fitting.delay_s)
    return Content({"causes": _texts(causes)}, {REFUSAL: text, "grade": 0})


def _content(doubts: tuple[Doubt, ...], attributes: dict[str, Attribute]) -> Content:
    datasets = {
        "causes": _texts(tuple(doubt.cause for doubt in doubts)),
        "messages": _texts(tuple(doubt.message for doubt in doubts)),
    }
    return Content(datasets, attributes)


def _texts(texts: tuple[str, ...]) -> Dataset:
    return Dataset(np.array(texts, dtype=str), "1", ("doubt",))
