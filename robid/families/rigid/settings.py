"""The rigid fit in an experiment file: its settings, what must hold of them for a robot, and what decides a fit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal, TypeAlias

import pydantic.dataclasses
from pydantic import Field

from robid.fit.rigid.options import RigidFitOptions
from robid.settings.base import STRICT
from robid.settings.experiment import Experiment
from robid.settings.fits import FitSettings, part
from robid.settings.load import LoadedExperiment
from robid.settings.robot import RobotFile
from robid.settings.robot_parts import robot_settings
from robid.settings.yaml import FieldPath

_Found: TypeAlias = Iterator[tuple[FieldPath, str]]


@pydantic.dataclasses.dataclass(frozen=True, kw_only=True, config=STRICT)
class RigidFit(FitSettings, RigidFitOptions):
    """A fit of rigid dynamics and friction to records."""

    family: Literal["rigid"] = Field(description="Family of the model.")

    def options(self) -> RigidFitOptions:
        """Returns the options of the algorithm."""
        return part(self, RigidFitOptions)


def rigid_fit(experiment: Experiment, name: str) -> RigidFit:
    """Returns a rigid fit of an experiment.

    Raises:
        TypeError: If it is of another family.
    """
    fit = experiment.fits[name]
    if not isinstance(fit, RigidFit):
        message = f"fit {name} is of family {fit.family}"
        raise TypeError(message)
    return fit


def problems(experiment: Experiment, name: str, robot: RobotFile) -> _Found:
    """Yields what is wrong with a rigid fit for a robot."""
    fit = rigid_fit(experiment, name)
    if fit.model.friction == "load" and fit.estimator == "instruments":
        message = "friction that grows with the measured torque has no instrument: take another `estimator`"
        yield ("estimator",), message
    if fit.model.payload == "body" and robot.payload is None:
        message = "a payload with parameters of its own needs a `payload` in the robot file"
        yield ("model", "payload"), message


def model_settings(loaded: LoadedExperiment, campaign: str) -> dict[str, Any]:
    """Returns what the rigid model of a campaign is made of."""
    used = loaded.experiment.campaigns[campaign]
    parts = robot_settings(loaded, "mechanics", "rigid", "friction", "range", "controller", "timing")
    return {f"campaigns.{campaign}.payload_kg": used.payload_kg, **parts}
