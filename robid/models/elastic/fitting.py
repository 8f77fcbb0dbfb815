"""The elastic family's fit and validation: settings and artifacts in, artifacts out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from robid.artifacts.artifact import Artifact
from robid.artifacts.results import grade_from_artifact, outcome_from_artifact
from robid.errors import DataError
from robid.models.elastic.files import model_of, solution_from_artifact, validation_of
from robid.models.elastic.fit.bootstrap import bootstrap_tasks
from robid.models.elastic.fit.considered import DoubtfulRobot
from robid.models.elastic.fit.doubts.freed import options_of
from robid.models.elastic.fit.doubts.further import with_freed_springs
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.solution import ElasticSolution
from robid.models.elastic.judge.assessment import assess_fit
from robid.models.elastic.judge.resonances import tabulate_resonances
from robid.models.elastic.judge.validating import validate_elastic
from robid.models.elastic.settings import elastic_fit
from robid.models.elastic.truth import true_values
from robid.models.family import Data, Work
from robid.models.rigid_source import RigidSource, rigid_source
from robid.results.doubt import blamed
from robid.results.outcome import Outcome, recovery_sentence
from robid.results.plausible.doubts import data_doubts
from robid.robot.description import Robot
from robid.settings.experiment import Campaign, payload_kg
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import delay_s
from robid.simulate.truth import TrueRobot


def fit(data: Data, work: Work) -> Artifact:
    """Fits an elastic model and grades it by itself."""
    return _fitted(data, work, None)


def refit(data: Data, model: Artifact, work: Work) -> Artifact:
    """Goes on from the minimum of a model, with what the data's experiment now frees."""
    solution = solution_from_artifact(model)
    return _fitted(data, work, dict(zip(solution.estimate.names, solution.internal.values.tolist(), strict=True)))


def _fitted(data: Data, work: Work, near: Mapping[str, float] | None) -> Artifact:
    settings, campaign = elastic_fit(data.loaded.experiment, data.name), _campaign(data)
    repeated = bootstrap_tasks(settings.bootstrap)
    work.progress.expect(settings.starts + repeated, "tasks" if repeated else "starts")

    def told(function: Callable[[Any], Any], tasks: Sequence[Any]) -> list[Any]:
        return work.map(function, tasks, lambda _index, _result: work.progress.advance())

    robot, delay = _robot(data, campaign), delay_s(data.loaded, campaign)
    doubtful = _doubtful(data, campaign)
    try:
        solution = fit_elastic(robot, data.response, settings.options(), delay, told, doubtful, near)
    except DataError as error:
        raise blamed(error, data_doubts(robot, data.response, delay)) from error
    fitted = robot, solution, data.response, settings.options(), delay
    return model_of(solution, assess_fit(*fitted), tabulate_resonances(*fitted))


def validate(data: Data, model: Artifact, true: TrueRobot | None) -> Artifact:
    """Holds an elastic model against a response that it never saw, and against the true robot where it is known."""
    settings = elastic_fit(data.loaded.experiment, data.name)
    robot = _robot(data, data.loaded.experiment.campaigns[settings.validate_on or settings.campaign])
    options, delay = options_of(robot, settings.options()), delay_s(data.loaded, _campaign(data))
    fitted = robot, solution_from_artifact(model), data.response, options, delay
    validation = validate_elastic(
        *fitted,
        None if true is None else dict(values_in(data.loaded, data.name, true)),
        grade_from_artifact(model).doubts,
        str(settings.validate_on),
    )
    return validation_of(validation, tabulate_resonances(*fitted))


def values_in(loaded: LoadedExperiment, name: str, true: TrueRobot) -> dict[str, float]:
    """Returns the true value of every parameter of a fit."""
    campaign = loaded.experiment.campaigns[loaded.experiment.fits[name].campaign]
    return true_values(loaded.robot.to_robot(campaign.payload_kg), true)


def fit_phrase(solution: ElasticSolution) -> str:
    """Says how the fit ended, in a phrase."""
    best = int(np.sum(solution.starts.minimum == 0))
    estimate = solution.estimate
    count = _counted(len(estimate.names), "parameter")
    identifiable = f"{int(np.sum(estimate.identifiable))} of {count} identifiable"
    known = int(np.sum(estimate.known_beforehand))
    identifiable += f" ({known} more known beforehand)" if known else ""
    expected = float(solution.costs.expected.sum())
    ratio = (
        f", {solution.costs.configuration.sum() / expected:.3g} times what noise alone gives" if expected > 0 else ""
    )
    used = solution.starts.evaluations
    effort = f", {np.median(used):.0f} evaluations each, at most {used.max()}" if used.size else ""
    if solution.starts.cap_share:
        effort += f", {solution.starts.cap_share:.0%} at the iteration limit"
    return (
        f"{estimate.status}, {identifiable},"
        f" cost {solution.costs.total:.4g}{ratio},"
        f" {best} of {_counted(len(solution.starts.cost), 'start')} at the best minimum{effort}"
    )


def verdict(outcome: Outcome) -> str:
    """Says whether the model holds, in a sentence or two."""
    known = recovery_sentence(outcome.recovery)
    return f"{outcome.verdict}. {known}" if known else outcome.verdict


def phrase_of_model(model: Artifact) -> str:
    """Says how the fit ended, from its artifact."""
    return fit_phrase(solution_from_artifact(model))


def verdict_of_validation(validation: Artifact) -> str:
    """Says whether the model holds, from its artifact."""
    return verdict(outcome_from_artifact(validation))


def _campaign(data: Data) -> Campaign:
    return data.loaded.experiment.campaigns[data.settings.campaign]


def _robot(data: Data, campaign: Campaign) -> Robot:
    """The robot that a fit starts from: the robot file's, its masses those of a rigid fit where it names one."""
    source = _source(data)
    file = data.loaded.robot
    robot = file.to_robot(campaign.payload_kg) if source is None else source.robot(payload_kg(campaign, file))
    return with_freed_springs(robot, elastic_fit(data.loaded.experiment, data.name).options())


def nominal_robot(data: Data) -> Robot:
    """Returns the robot that a fit starts from, with the payload of its campaign."""
    return _robot(data, _campaign(data))


def _source(data: Data) -> RigidSource | None:
    name = elastic_fit(data.loaded.experiment, data.name).rigid
    return None if name is None else rigid_source(data.loaded, name, data.taken["standard"])


def _doubtful(data: Data, campaign: Campaign) -> tuple[DoubtfulRobot, ...]:
    """Robots that show how far the rigid fit's masses and inertias may be off."""
    source = _source(data)
    if source is None:
        return ()
    found = source.doubtful(payload_kg(campaign, data.loaded.robot))
    options = elastic_fit(data.loaded.experiment, data.name).options()
    return tuple(DoubtfulRobot(with_freed_springs(robot, options), deviations) for robot, deviations in found)


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
