"""The rigid fit in an experiment file: its settings, what must hold of them for a robot, and what decides a fit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal, TypeAlias

import pydantic.dataclasses
from pydantic import Field

from robid.models.rigid.fit.options import RigidFitOptions
from robid.settings.base import STRICT
from robid.settings.checks.experiment import sampling_period_s
from robid.settings.experiment import Campaign, Experiment, heaviest, payload_kg
from robid.settings.fits import FitSettings, HandedOn, fit_of, part
from robid.settings.load import LoadedExperiment
from robid.settings.robot import RobotFile
from robid.settings.robot_parts import Part, robot_settings
from robid.settings.yaml import FieldPath

_Found: TypeAlias = Iterator[tuple[FieldPath, str]]


@pydantic.dataclasses.dataclass(frozen=True, kw_only=True, config=STRICT)
class RigidFit(FitSettings, RigidFitOptions):
    """A fit of rigid dynamics and friction to records."""

    family: Literal["rigid"] = Field(description="Family of the model.")

    @property
    def hands_on(self) -> tuple[HandedOn, ...]:
        """What other nodes may take of it."""
        # Friction with estimated gains is not in the unit of torques that others read.
        is_dry = self.model.friction in ("coulomb", "asymmetric") and self.gain_std is None
        dry: tuple[HandedOn, ...] = ("friction",) if is_dry else ()
        return (*dry, "standard") if self.physical else dry

    @property
    def takes_payloads(self) -> bool:
        """Whether its campaigns may have different payloads: where the payload is a body of its own."""
        return self.model.payload == "body"

    def options(self) -> RigidFitOptions:
        """Returns the options of the algorithm."""
        return part(self, RigidFitOptions)


def rigid_fit(experiment: Experiment, name: str) -> RigidFit:
    """Returns a rigid fit of an experiment.

    Raises:
        TypeError: If it is of another family.
    """
    return fit_of(experiment, name, RigidFit)


def seed_of(settings: FitSettings) -> int | None:
    """Returns the seed of a rigid fit."""
    return settings.base.seed if isinstance(settings, RigidFit) else None


def problems(experiment: Experiment, name: str, robot: RobotFile) -> _Found:
    """Yields what is wrong with a rigid fit for a robot."""
    fit = rigid_fit(experiment, name)
    if fit.estimator == "instruments" and fit.instruments == "none":
        yield ("estimator",), "S084 is `instruments`, but `instruments` is `none`: let it be `auto`"
    if fit.estimator == "instruments" and robot.without_motor:
        listed = ", ".join(f"`{one}`" for one in robot.without_motor)
        message = (
            f"S085 instrumental variables simulate a loop of motors, which {listed} lack: take another `estimator`"
        )
        yield ("estimator",), message
    elif fit.estimator == "instruments" and robot.controller is None:
        yield ("estimator",), "S086 instrumental variables need the robot file's `controller`, which is missing"
    if fit.model.friction == "load" and fit.estimator == "instruments":
        message = "S087 friction that grows with the measured torque has no instrument: take another `estimator`"
        yield ("estimator",), message
    for index, joint in enumerate(fit.judge):
        if joint not in (known := [each.name for each in robot.joints]):
            yield ("judge", index), f"S440 is no joint of the robot: there are {', '.join(known)}"
    yield from _payloads(experiment, fit, robot)
    yield from _gains(fit, robot)
    yield from _cut_off(experiment, fit, robot)


def _cut_off(experiment: Experiment, fit: RigidFit, robot: RobotFile) -> _Found:
    """Yields a cut-off that the sampling of a campaign is too slow for."""
    cut_hz = fit.filters.position_cut_hz
    for place, name in (*(("from", one) for one in fit.campaigns), ("validate_on", fit.validate_on)):
        read = experiment.campaigns.get(name or "")
        period_s = None if read is None else sampling_period_s(read, robot)
        if period_s is not None and cut_hz is not None and cut_hz >= 0.5 / period_s:
            message = (
                f"S088 {cut_hz:g} Hz is not below half the sampling rate of `{name}` ({place}), {0.5 / period_s:g} Hz: "
                "state a lower one, or leave it out to have it chosen"
            )
            yield ("filters", "position_cut_hz"), message


def _payloads(experiment: Experiment, fit: RigidFit, robot: RobotFile) -> _Found:
    apart = fit.model.payload == "body"
    if apart and robot.payload is None:
        message = "S089 a payload with parameters of its own needs a `payload` in the robot file"
        yield ("model", "payload"), message
        return
    known = [name for name in fit.campaigns if name in experiment.campaigns]
    masses = {name: payload_kg(experiment.campaigns[name], robot) for name in known}
    carried = {mass for mass in masses.values() if mass > 0}
    if apart and len(carried) > 1:
        listed = ", ".join(f"{mass:g}" for mass in sorted(carried))
        yield (
            ("from",),
            f"S090 names campaigns with payloads of {listed} kg: one body is one of them, or none (`payload_kg: 0`)",
        )
    elif apart and not (carried and 0 in masses.values()):
        lack = "without" if carried else "with"
        message = (
            f"S091 names no campaign {lack} payload: a payload with parameters of its own is what records with it have"
            " beside those without (`payload_kg: 0`)"
        )
        yield ("from",), message
    new = experiment.campaigns.get(fit.validate_on or "")
    if new is not None and masses and payload_kg(new, robot) not in ({0.0, *carried} if apart else masses.values()):
        message = (
            f"S092 campaign `{fit.validate_on}` has a payload of {payload_kg(new, robot):g} kg, which the fit never saw"
        )
        yield ("validate_on",), message


def _gains(fit: RigidFit, robot: RobotFile) -> _Found:
    if fit.gain_std is None:
        return
    if fit.model.payload != "body" or fit.model.friction == "load":
        message = (
            "S480 gains come of records with and without a known payload, beside friction that does not grow with the"
            " torque: take `model: {payload: body}`, and another `friction` than `load`"
        )
        yield ("gain_std",), message
    elif robot.payload is not None and "mass_kg" in robot.payload.assumed:
        yield (
            ("gain_std",),
            "S481 gains are as right as the payload's mass, which the robot file has `assumed`: weigh it",
        )


_PARTS: tuple[Part, ...] = (
    *("mechanics", "rigid", "range", "friction", "torque_constant", "rated_torque", "motor_limits"),
    *("doubts", "controller", "timing"),
)
"""Parts of the robot file that decide a rigid model, and what is said of it."""


def model_settings(loaded: LoadedExperiment, campaign: str) -> dict[str, Any]:
    """Returns what the rigid model of a campaign is made of."""
    used = loaded.experiment.campaigns[campaign]
    return {f"campaigns.{campaign}.payload_kg": used.payload_kg, **robot_settings(loaded, *_PARTS)}


def loaded_campaign(loaded: LoadedExperiment, name: str) -> Campaign:
    """Returns the campaign of a fit in which the robot has all that the fit knows of: its payload too."""
    experiment = loaded.experiment
    return experiment.campaigns[heaviest(experiment, experiment.fits[name], loaded.robot)]
