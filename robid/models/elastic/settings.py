"""The elastic fit in an experiment file: its settings, what must hold of them for a robot, and what decides a fit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, Literal, TypeAlias

import pydantic.dataclasses
from pydantic import Field

from robid.errors import SettingsError
from robid.models.elastic.fit.nuisance.kinds import freeable_nuisances, freed_nuisances
from robid.models.elastic.fit.nuisance.springs import with_freed_springs
from robid.models.elastic.fit.nuisance.wording import free_with, unknown_names
from robid.models.elastic.fit.options import (
    BY_SPRING,
    ElasticOptions,
    estimable_names,
    free_problem,
    name_problems,
    spring_of,
)
from robid.robot.description import Robot
from robid.robot.parameters import DOUBT, ElasticKind
from robid.settings.base import STRICT, Name
from robid.settings.checks.limits import TORQUE, missing_limits
from robid.settings.checks.sensed import without_motor_text
from robid.settings.experiment import Experiment
from robid.settings.fits import FitSettings, HandedOn, fit_of, part
from robid.settings.load import LoadedExperiment
from robid.settings.parameter_names import kinds_by_name
from robid.settings.problems import suggest
from robid.settings.robot import RobotFile
from robid.settings.robot_parts import delay_s, robot_settings
from robid.settings.yaml import FieldPath

_Found: TypeAlias = Iterator[tuple[FieldPath, str]]


@pydantic.dataclasses.dataclass(frozen=True, kw_only=True, config=STRICT)
class ElasticFit(FitSettings, ElasticOptions):
    """A fit of springs and dampers to frequency responses."""

    family: Literal["elastic"] = Field(description="Family of the model.")
    rigid: Name | None = Field(
        default=None,
        description="Name of a fit of family `rigid` whose masses, inertias and viscous friction take the place of the"
        " robot file's; what it leaves open widens the intervals.",
    )

    @property
    def takes(self) -> Mapping[HandedOn, str]:
        """Names of the fits that it takes something of, by what it takes."""
        return {} if self.rigid is None else {"standard": self.rigid}

    @property
    def designed_for(self) -> tuple[ElasticKind, ...]:
        """Kinds of parameters that configurations can be chosen for."""
        return self.kinds

    @property
    def not_estimated(self) -> frozenset[str]:
        """Names of parameters of these kinds that stay fixed or follow others."""
        return frozenset((*self.fixed, *self.tied))

    def options(self) -> ElasticOptions:
        """Returns the options of the algorithm."""
        return part(self, ElasticOptions)


def elastic_fit(experiment: Experiment, name: str) -> ElasticFit:
    """Returns an elastic fit of an experiment.

    Raises:
        TypeError: If it is of another family.
    """
    return fit_of(experiment, name, ElasticFit)


def problems(experiment: Experiment, name: str, robot: RobotFile) -> _Found:
    """Yields what is wrong with an elastic fit for a robot: names, starts at zero, missing limits."""
    fit = elastic_fit(experiment, name)
    if robot.without_motor:
        told = without_motor_text(robot.without_motor)
        yield ("family",), f"an elastic model has a motor and a transmission at every joint: {told}"
        return
    yield from _arm_torques(experiment, fit)
    known = kinds_by_name(robot, fit.kinds)
    if fit.freed and robot.is_complete:
        yield from freed_problems(experiment, fit, robot)
        known |= freed_names(experiment, fit, robot)
    for index, parameter in enumerate(fit.fixed):
        if parameter not in known:
            message = f"there is no free parameter `{parameter}`; {suggest(parameter, known)}"
            yield ("fixed", index), message
    free = {name: kind for name, kind in known.items() if name not in fit.fixed}
    for section, problem in name_problems(fit.options(), free):
        yield (section,), problem
    for spring in robot.all_springs:
        parameter = f"{spring.name}.damping"
        damping = spring.value("damping", linear=spring.is_linear(robot.joints))
        if damping == 0 and parameter in known and parameter not in fit.fixed:
            message = f"`{parameter}` is 0 in the robot file, but must start above 0 to be estimated: put it in `fixed`"
            yield ("free",), message
    if "cubic" in fit.kinds and robot.is_complete:
        yield from missing_limits(("free",), "the scale of `cubic` needs", robot, (TORQUE,))


def _arm_torques(experiment: Experiment, fit: ElasticFit) -> _Found:
    """Yields logs whose torques are of the arm side: springs lie between motor and arm."""
    for name in fit.campaigns:
        source = experiment.campaigns[name].source if name in experiment.campaigns else None
        inputs = () if source is None or source.acquire is None else source.acquire.inputs
        felt = [one.name for one in inputs if one.side == "arm"]
        if felt:
            told = f"the inputs of `{name}` are of the arm side ({', '.join(f'`{one}.arm`' for one in felt)})"
            yield ("from",), f"{told}: an elastic model reads torques or currents of motors, which go without `.arm`"


def model_settings(loaded: LoadedExperiment, campaign: str) -> dict[str, Any]:
    """Returns what the elastic model of a campaign is made of; the delay of a log is none."""
    used = loaded.experiment.campaigns[campaign]
    parts = robot_settings(loaded, "mechanics", "inertia_std", "torque_constant", "doubts", "sensors")
    settings = {f"campaigns.{campaign}.payload_kg": used.payload_kg, **parts}
    settings["delay_s"] = delay_s(loaded, used)
    return settings


def freed_problems(experiment: Experiment, fit: ElasticFit, robot: RobotFile) -> Iterator[tuple[FieldPath, str]]:
    """Yields what is wrong with what a fit frees by name: what the robot does not have, and what is free anyway."""
    start = _robot(experiment, fit, robot)
    for name, meant in unknown_names(start, fit.options()):
        yield ("free", fit.free.index(name)), free_problem(name, meant)
    for name in fit.freed:
        if _is_free_anyway(start, fit, name):
            message = f"stiffness and damping of `{spring_of(name)}` are free anyway; {_more(start, name)}"
            yield ("free", fit.free.index(name)), message


def freed_names(experiment: Experiment, fit: ElasticFit, robot: RobotFile) -> dict[str, str]:
    """Returns every parameter that freed doubts and springs add, with its kind."""
    start, options = _robot(experiment, fit, robot), fit.options()
    every = estimable_names(with_freed_springs(start, options), options)
    of_springs = {name: kind for kind, names in every.items() for name in names if name is not None}
    return of_springs | {doubt.name: DOUBT for doubt in freed_nuisances(start, options)}


def free_too(loaded: LoadedExperiment, name: str, more: Sequence[str]) -> LoadedExperiment:
    """Returns an experiment one of whose fits frees more, as if its `free` named it.

    Raises:
        SettingsError: If the robot has nothing of that name, or the fit estimates it already.
    """
    fit = elastic_fit(loaded.experiment, name)
    start = _robot(loaded.experiment, fit, loaded.robot)
    twice = [each for each in more if _is_estimated(start, fit, each)]
    if twice:
        message = f"fit `{name}` estimates `{twice[0]}` already"
        raise SettingsError(message, where="--try", remedy="name something else, or leave it out")
    values: dict[str, Any] = {each.name: getattr(fit, each.name) for each in fields(fit)}
    tried = ElasticFit(**{"from": values.pop("reads"), **values, "free": free_with(fit.free, more)})
    unknown = [free_problem(*each) for each in unknown_names(start, tried.options())]
    if unknown:
        raise SettingsError("; ".join(unknown), where="--try", remedy="name what can be freed, as in `free`")
    fits = {**loaded.experiment.fits, name: tried}
    return replace(loaded, experiment=loaded.experiment.model_copy(update={"fits": fits}))


def _is_estimated(robot: Robot, fit: ElasticFit, name: str) -> bool:
    options = fit.options()
    doubts = {doubt.name for doubt in freed_nuisances(robot, replace(options, free=(name,)))}
    known = doubts and doubts <= {doubt.name for doubt in freed_nuisances(robot, options)}
    return name in (*fit.free, *fit.kinds) or bool(known) or _is_free_anyway(robot, fit, name)


def _is_free_anyway(robot: Robot, fit: ElasticFit, name: str) -> bool:
    """Whether a name is that of a spring of the robot file, where the kinds of all springs are free."""
    return spring_of(name) in {spring.name for spring in robot.springs} and set(BY_SPRING) <= set(fit.kinds)


def _more(robot: Robot, name: str) -> str:
    """What else of a spring can be freed, as the end of a sentence."""
    doubts = [doubt.name for doubt in freeable_nuisances(robot) if doubt.name.startswith(f"{spring_of(name)}.")]
    other = f", or name what else is meant: {', '.join(f'`{each}`' for each in doubts)}" if doubts else ""
    return f"leave it out{other}"


def _robot(experiment: Experiment, fit: ElasticFit, robot: RobotFile) -> Robot:
    return robot.to_robot(experiment.campaigns[fit.campaign].payload_kg)
