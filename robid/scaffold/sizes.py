"""Values of motors and gears that are typical of a joint's size: to begin with, until data sheets say better."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from robid.scaffold.chains import CarriedJoint

# The shares are those of published robots from 17 to 1200 kg, within a factor of two or three.
_MOTOR_SPEED_RAD_S = 420.0
_RATIOS = (30.0, 250.0)
_RATIO = 100.0
_RATIO_RAD_M = round(2 * math.pi / 0.02, 1)  # a lead of 20 mm
_OVER_GRAVITY = 2.0
_OVER_WEIGHT = 4.0
_SMALLEST_SHARE = 0.12
_USABLE = (0.65, 5.0)
_RUN_UP_S = 0.035
_STIFFNESS_PER_TORQUE = 130.0
_LINEAR_HZ = 40.0
_DAMPING_S = 7e-4
_COULOMB = 0.02
_VISCOUS_RAD_S = 150.0
_RIPPLE = 3e-3


@dataclass(frozen=True)
class Drive:
    """Motor and gear of a joint; None where the model says it."""

    inertia_kgm2: float
    ratio: float  # Motor turns per arm turn, or motor radians per metre
    max_speed_rad_s: float | None
    max_torque_nm: float | None
    coulomb_nm: float
    viscous_nms_rad: float
    ripple_nm: float
    stiffness: float  # [N m/rad, or N/m]
    damping: float  # [N m s/rad, or N s/m]
    torque_left_out: float | None  # A limit of the model that cannot be meant [N m, or N]


def drives(joints: Sequence[CarriedJoint]) -> list[Drive]:
    """Returns a motor and a gear of the size of each joint."""
    largest = max((_OVER_GRAVITY * one.moment for one in joints if not one.slides), default=0.0)
    return [_drive(one, _SMALLEST_SHARE * largest) for one in joints]


def _drive(joint: CarriedJoint, least: float) -> Drive:
    ratio = _ratio(joint)
    effort = _OVER_WEIGHT * joint.moment if joint.slides else max(_OVER_GRAVITY * joint.moment, least)
    torque = effort / ratio
    is_usable = joint.torque is not None and _USABLE[0] <= joint.torque / effort <= _USABLE[1]
    is_fast = joint.speed is not None and 0.05 <= joint.speed * ratio / _MOTOR_SPEED_RAD_S <= 3
    stiffness = _STIFFNESS_PER_TORQUE * effort
    if joint.slides:
        stiffness = (2 * math.pi * _LINEAR_HZ) ** 2 * joint.carried_kg
    return Drive(
        inertia_kgm2=_rounded(_RUN_UP_S * torque / _MOTOR_SPEED_RAD_S),
        ratio=ratio,
        max_speed_rad_s=None if is_fast else _MOTOR_SPEED_RAD_S,
        max_torque_nm=None if is_usable else _rounded(torque),
        coulomb_nm=_rounded(_COULOMB * torque),
        viscous_nms_rad=_rounded(_COULOMB * torque / _VISCOUS_RAD_S),
        ripple_nm=_rounded(_RIPPLE * torque),
        stiffness=_rounded(stiffness),
        damping=_rounded(_DAMPING_S * stiffness),
        torque_left_out=None if is_usable else joint.torque,
    )


def _ratio(joint: CarriedJoint) -> float:
    """A ratio with which the motor turns as fast as motors do where the joint goes as fast as it may."""
    if joint.slides:
        return _RATIO_RAD_M
    if joint.speed is None:
        return _RATIO
    return float(round(min(max(_MOTOR_SPEED_RAD_S / joint.speed, _RATIOS[0]), _RATIOS[1])))


def _rounded(value: float) -> float:
    return float(f"{value:.2g}")
