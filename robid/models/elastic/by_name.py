"""What an experiment file frees of what its robot file may have wrong."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from typing import Any

from robid.errors import SettingsError
from robid.models.elastic.fit.nuisance.listing import estimable_nuisances, estimated_nuisances
from robid.models.elastic.fit.nuisance.moves import with_estimated_springs
from robid.models.elastic.fit.nuisance.wording import free_with, unknown_names
from robid.models.elastic.fit.options import BY_SPRING, estimable_names, free_problem, spring_of
from robid.models.elastic.settings import ElasticFit, elastic_fit
from robid.robot.description import Robot
from robid.robot.parameters import NUISANCE_KIND
from robid.settings.experiment import Experiment
from robid.settings.load import LoadedExperiment
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath


def free_problems(experiment: Experiment, fit: ElasticFit, robot: RobotFile) -> Iterator[tuple[FieldPath, str]]:
    """Yields what is wrong with what a fit frees by name: what the robot does not have, and what is free anyway."""
    start = _robot(experiment, fit, robot)
    for name, meant in unknown_names(start, fit.options()):
        yield ("free", fit.free.index(name)), free_problem(name, meant)
    for name in fit.estimated:
        if _is_free_anyway(start, fit, name):
            message = f"S058 stiffness and damping of `{spring_of(name)}` are free anyway; {_more(start, name)}"
            yield ("free", fit.free.index(name)), message


def names_from_free(experiment: Experiment, fit: ElasticFit, robot: RobotFile) -> dict[str, str]:
    """Returns every parameter that estimated nuisances and springs add, with its kind."""
    start, options = _robot(experiment, fit, robot), fit.options()
    every = estimable_names(with_estimated_springs(start, options), options)
    of_springs = {name: kind for kind, names in every.items() for name in names if name is not None}
    return of_springs | {nuisance.name: NUISANCE_KIND for nuisance in estimated_nuisances(start, options)}


def free_too(loaded: LoadedExperiment, name: str, more: Sequence[str]) -> LoadedExperiment:
    """Returns an experiment one of whose fits frees more, as if its `free` named it.

    Raises:
        SettingsError: If the robot has nothing of that name, or the fit estimates it already.
    """
    fit = elastic_fit(loaded.experiment, name)
    start = _robot(loaded.experiment, fit, loaded.robot)
    twice = [each for each in more if _is_estimated(start, fit, each)]
    if twice:
        message = f"S059 fit `{name}` estimates `{twice[0]}` already"
        raise SettingsError(message, where="--try", remedy="name something else, or leave it out")
    values: dict[str, Any] = {each.name: getattr(fit, each.name) for each in fields(fit)}
    tried = ElasticFit(**{"from": values.pop("reads"), **values, "free": free_with(fit.free, more)})
    unknown = [free_problem(*each) for each in unknown_names(start, tried.options())]
    if unknown:
        raise SettingsError("; ".join(unknown), where="--try", remedy="name what can be estimated, as in `free`")
    fits = {**loaded.experiment.fits, name: tried}
    return replace(loaded, experiment=loaded.experiment.model_copy(update={"fits": fits}))


def _is_estimated(robot: Robot, fit: ElasticFit, name: str) -> bool:
    options = fit.options()
    nuisances = {nuisance.name for nuisance in estimated_nuisances(robot, replace(options, free=(name,)))}
    known = nuisances and nuisances <= {nuisance.name for nuisance in estimated_nuisances(robot, options)}
    return name in (*fit.free, *fit.kinds) or bool(known) or _is_free_anyway(robot, fit, name)


def _is_free_anyway(robot: Robot, fit: ElasticFit, name: str) -> bool:
    """Whether a name is that of a spring of the robot file, where the kinds of all springs are free."""
    return spring_of(name) in {spring.name for spring in robot.springs} and set(BY_SPRING) <= set(fit.kinds)


def _more(robot: Robot, name: str) -> str:
    """What else of a spring can be estimated, as the end of a sentence."""
    nuisances = [
        nuisance.name for nuisance in estimable_nuisances(robot) if nuisance.name.startswith(f"{spring_of(name)}.")
    ]
    other = f", or name what else is meant: {', '.join(f'`{each}`' for each in nuisances)}" if nuisances else ""
    return f"leave it out{other}"


def _robot(experiment: Experiment, fit: ElasticFit, robot: RobotFile) -> Robot:
    return robot.to_robot(experiment.campaigns[fit.campaign].payload_kg)
