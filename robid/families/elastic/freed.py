"""What an experiment file frees of what its robot file may have wrong."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from typing import Any

from robid.errors import SettingsError
from robid.families.elastic.settings import ElasticFit, elastic_fit
from robid.fit.elastic.doubts.freed import DOUBT, free_with, freed_doubts, unknown_names
from robid.fit.elastic.doubts.further import with_freed_springs
from robid.fit.elastic.names import free_problem
from robid.robot.description import Robot, Spring
from robid.robot.parameters import names_of
from robid.settings.experiment import Experiment
from robid.settings.load import LoadedExperiment
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath


def freed_problems(experiment: Experiment, fit: ElasticFit, robot: RobotFile) -> Iterator[tuple[FieldPath, str]]:
    """Yields what is wrong with the doubts that a fit frees: names that the robot does not have."""
    for name, meant in unknown_names(_robot(experiment, fit, robot), fit.options()):
        yield ("free", fit.free.index(name)), free_problem(name, meant)


def freed_names(experiment: Experiment, fit: ElasticFit, robot: RobotFile) -> dict[str, str]:
    """Returns every parameter that freed doubts and springs add, with its kind."""
    start, options = _robot(experiment, fit, robot), fit.options()
    more = with_freed_springs(start, options).springs[len(start.springs) :]
    of_springs = {name: kind for kind in fit.kinds for name in _of_springs(kind, more)}
    return of_springs | {doubt.name: DOUBT for doubt in freed_doubts(start, options)}


def free_too(loaded: LoadedExperiment, name: str, more: Sequence[str]) -> LoadedExperiment:
    """Returns an experiment one of whose fits frees more, as if its `free` named it.

    Raises:
        SettingsError: If the robot has nothing of that name, or the fit estimates it already.
    """
    fit = elastic_fit(loaded.experiment, name)
    twice = [each for each in more if each in (*fit.free, *fit.kinds)]
    if twice:
        message = f"fit `{name}` estimates `{twice[0]}` already"
        raise SettingsError(message, where="--try", remedy="name something else, or leave it out")
    values: dict[str, Any] = {each.name: getattr(fit, each.name) for each in fields(fit)}
    tried = ElasticFit(**{"from": values.pop("reads"), **values, "free": free_with(fit.free, more)})
    start = loaded.robot.to_robot(loaded.experiment.campaigns[fit.campaign].payload_kg)
    unknown = [free_problem(*each) for each in unknown_names(start, tried.options())]
    if unknown:
        raise SettingsError("; ".join(unknown), where="--try", remedy="name what can be freed, as in `free`")
    fits = {**loaded.experiment.fits, name: tried}
    return replace(loaded, experiment=loaded.experiment.model_copy(update={"fits": fits}))


def _of_springs(kind: str, springs: tuple[Spring, ...]) -> list[str]:
    return [name for name in names_of(kind, springs, []) if name is not None and kind != "delay"]


def _robot(experiment: Experiment, fit: ElasticFit, robot: RobotFile) -> Robot:
    return robot.to_robot(experiment.campaigns[fit.campaign].payload_kg)
