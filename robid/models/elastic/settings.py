"""The elastic fit in an experiment file: its settings, what must hold of them for a robot, and what decides a fit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Literal, TypeAlias

import pydantic.dataclasses
from pydantic import Field

from robid.models.elastic.fit.names import name_problems
from robid.models.elastic.fit.options import ElasticOptions
from robid.robot.parameters import ElasticKind
from robid.settings.base import STRICT, Name
from robid.settings.checks.beyond_motors import without_motor_text
from robid.settings.checks.campaigns import TORQUE, missing_limits
from robid.settings.experiment import Experiment
from robid.settings.fits import FitSettings, HandedOn, fit_of, part
from robid.settings.load import LoadedExperiment
from robid.settings.problems import suggest
from robid.settings.robot import RobotFile
from robid.settings.robot_derived import kinds_by_name
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
        from robid.models.elastic.freed import freed_names, freed_problems

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
