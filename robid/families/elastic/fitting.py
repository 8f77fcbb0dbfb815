"""The elastic family's fit and validation: settings and artifacts in, artifacts out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from robid.artifacts.artifact import Artifact, Provenance
from robid.artifacts.model import grade_from_artifact, model_from_artifact, model_to_artifact
from robid.artifacts.validation import validation_from_artifact, validation_to_artifact
from robid.families.elastic.settings import elastic_fit
from robid.families.elastic.truth import true_values
from robid.families.family import Data, Work
from robid.fit.bootstrap import bootstrap_tasks
from robid.fit.elastic import fit_elastic
from robid.fit.solution import Solution
from robid.robot.description import Robot
from robid.settings.experiment import Campaign
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import delay_s
from robid.simulate.truth import TrueRobot
from robid.validation.assessment import assess_fit
from robid.validation.elastic import Validation, validate_elastic
from robid.validation.recovery import recovery_sentence
from robid.validation.resonances import tabulate_resonances


def fit(data: Data, work: Work) -> Artifact:
    """Fits an elastic model and grades it by itself."""
    settings, campaign = elastic_fit(data.loaded.experiment, data.name), _campaign(data)
    repeated = bootstrap_tasks(settings.bootstrap)
    work.progress.expect(settings.starts + repeated, "tasks" if repeated else "starts")

    def told(function: Callable[[Any], Any], tasks: Sequence[Any]) -> list[Any]:
        return work.map(function, tasks, lambda _index, _result: work.progress.advance())

    robot, delay = _robot(data, campaign), delay_s(data.loaded, campaign)
    solution = fit_elastic(robot, data.response, settings.options(), delay, told)
    fitted = robot, solution, data.response, settings.options(), delay
    return model_to_artifact(solution, Provenance(stage="fit"), assess_fit(*fitted), tabulate_resonances(*fitted))


def validate(data: Data, model: Artifact, true: TrueRobot | None) -> Artifact:
    """Holds an elastic model against a response that it never saw, and against the true robot where it is known."""
    settings, alone = elastic_fit(data.loaded.experiment, data.name), grade_from_artifact(model)
    validation = validate_elastic(
        _robot(data, data.loaded.experiment.campaigns[settings.validate_on or settings.campaign]),
        model_from_artifact(model),
        data.response,
        settings.options(),
        delay_s(data.loaded, _campaign(data)),
        None if true is None else dict(values_in(data.loaded, data.name, true)),
        () if alone is None else alone.doubts,
        str(settings.validate_on),
    )
    return validation_to_artifact(validation, Provenance(stage="validate"))


def values_in(loaded: LoadedExperiment, name: str, true: TrueRobot) -> dict[str, float]:
    """Returns the true value of every parameter of a fit."""
    campaign = loaded.experiment.campaigns[loaded.experiment.fits[name].campaign]
    return true_values(loaded.robot.to_robot(campaign.payload_kg), true)


def fit_phrase(solution: Solution) -> str:
    """Says how the fit ended, in a phrase."""
    best = int(np.sum(solution.start_minimum == 0))
    count = len(solution.names)
    identifiable = f"{int(np.sum(solution.identifiable))} of {_counted(count, 'parameter')} identifiable"
    known = int(np.sum(solution.known_beforehand))
    identifiable += f" ({known} more known beforehand)" if known else ""
    expected = float(solution.expected_cost.sum())
    ratio = f", {solution.configuration_cost.sum() / expected:.3g} times what noise alone gives" if expected > 0 else ""
    used = solution.start_evaluations
    effort = f", {np.median(used):.0f} evaluations each, at most {used.max()}" if used.size else ""
    if solution.cap_share:
        effort += f", {solution.cap_share:.0%} at the iteration limit"
    return (
        f"{solution.status}, {identifiable},"
        f" cost {solution.cost:.4g}{ratio},"
        f" {best} of {_counted(len(solution.start_cost), 'start')} at the best minimum{effort}"
    )


def verdict(validation: Validation) -> str:
    """Says whether the model holds, in a sentence or two."""
    known = recovery_sentence(validation.springs_within, validation.springs_known, validation.coverage)
    return f"{validation.verdict}. {known}" if known else validation.verdict


def phrase_of_model(model: Artifact) -> str:
    """Says how the fit ended, from its artifact."""
    return fit_phrase(model_from_artifact(model))


def verdict_of_validation(validation: Artifact) -> str:
    """Says whether the model holds, from its artifact."""
    return verdict(validation_from_artifact(validation))


def _campaign(data: Data) -> Campaign:
    return data.loaded.experiment.campaigns[data.settings.campaign]


def _robot(data: Data, campaign: Campaign) -> Robot:
    return data.loaded.robot.to_robot(campaign.payload_kg)


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
