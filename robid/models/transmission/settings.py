"""A fit of gears in an experiment file: its settings, what must be right of them, and what decides a fit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any, Literal, TypeAlias

import pydantic.dataclasses
from pydantic import Field

from robid.models.transmission.fit.options import TransmissionFitOptions
from robid.settings.base import STRICT, Name
from robid.settings.checks.experiment import sampling_period_s
from robid.settings.experiment import Experiment
from robid.settings.fits import FitSettings, HandedOn, fit_of, part
from robid.settings.load import LoadedExperiment
from robid.settings.robot import RobotFile
from robid.settings.robot_parts import Part, delay_s, robot_settings
from robid.settings.yaml import FieldPath

_Found: TypeAlias = Iterator[tuple[FieldPath, str]]
_FASTEST = 0.25  # of the sampling rate


@pydantic.dataclasses.dataclass(frozen=True, kw_only=True, config=STRICT)
class TransmissionFit(FitSettings, TransmissionFitOptions):
    """A fit of gears to records with encoders on both sides."""

    family: Literal["transmission"] = Field(description="Family of the model.")
    rigid: Name | None = Field(
        default=None,
        description="Name of a fit of family `rigid` whose masses, inertias and friction say what loads the gears. "
        "When not given, those of the robot file, corrected by the motors' torques within what it may have wrong.",
    )

    @property
    def hands_on(self) -> tuple[HandedOn, ...]:
        """What other nodes may take of it."""
        return ("gears",)

    @property
    def takes(self) -> Mapping[HandedOn, str]:
        """Names of the fits that it takes something of, by what it takes."""
        return {} if self.rigid is None else {"standard": self.rigid}

    def options(self) -> TransmissionFitOptions:
        """Returns the options of the algorithm."""
        return part(self, TransmissionFitOptions)


def transmission_fit(experiment: Experiment, name: str) -> TransmissionFit:
    """Returns a fit of gears of an experiment.

    Raises:
        TypeError: If it is of another family.
    """
    return fit_of(experiment, name, TransmissionFit)


def problems(experiment: Experiment, name: str, robot: RobotFile) -> _Found:
    """Yields what is wrong with a fit of gears for a robot."""
    fit, joints = transmission_fit(experiment, name), [joint.name for joint in robot.joints]
    for key in ("rated_torque_nm", "stiffness_torques_nm"):
        for joint in getattr(fit, key):
            if joint not in joints:
                yield (key, joint), f"S650 is no joint of the robot: there are {', '.join(joints)}"
    for joint, torque in fit.rated_torque_nm.items():
        if torque <= 0:
            yield ("rated_torque_nm", joint), "S651 must be above 0"
    for joint, torques in fit.stiffness_torques_nm.items():
        if any(after <= before for before, after in pairwise((0.0, *torques))):
            yield ("stiffness_torques_nm", joint), "S658 must rise from above 0"
    for key in ("motor_orders", "arm_orders"):
        if any(order <= 0 for order in getattr(fit.gear, key)):
            yield ("gear", key), "S652 periods per turn are above 0"
    for place, campaign_name in (*(("from", one) for one in fit.campaigns), ("validate_on", fit.validate_on)):
        campaign = experiment.campaigns.get(campaign_name or "")
        if campaign is None:
            continue
        simulated = campaign.source is not None and campaign.source.simulate is not None
        if simulated and not any(one.endswith(".arm") for one in campaign.outputs):
            message = (
                f"S653 `{campaign_name}` simulates no link encoder: name some in its `outputs`, as "
                f"[motors, {joints[0]}.arm]"
            )
            yield (place,), message
        period_s = sampling_period_s(campaign, robot)
        if period_s is not None and fit.cut_hz * period_s >= _FASTEST:
            message = (
                f"S654 {fit.cut_hz:g} Hz is too fast for `{campaign_name}` ({place}), which is sampled every "
                f"{period_s:g} s: state less than {_FASTEST / period_s:g}"
            )
            yield ("cut_hz",), message


_PARTS: tuple[Part, ...] = (
    *("mechanics", "rigid", "friction", "inertia_std", "rated_torque", "motor_limits", "doubts", "timing"),
)
"""Parts of the robot file that decide a fit of gears."""


def model_settings(loaded: LoadedExperiment, campaign: str) -> dict[str, Any]:
    """Returns what the gears of a campaign are made of."""
    used = loaded.experiment.campaigns[campaign]
    settings = {f"campaigns.{campaign}.payload_kg": used.payload_kg, **robot_settings(loaded, *_PARTS)}
    settings["delay_s"] = delay_s(loaded, used)
    return settings
