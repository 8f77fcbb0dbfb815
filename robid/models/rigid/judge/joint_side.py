"""Friction of motors as it acts at their joints: what a data sheet of the axis states."""

from __future__ import annotations

from dataclasses import dataclass

from robid.robot.description import Joint
from robid.robot.regressor.drives import acts_along


@dataclass(frozen=True)
class _Law:
    """How a friction of the motor grows with the gear ratio, and its units at the joint."""

    power: int  # of the ratio
    turns: str  # unit at a joint that turns
    slides: str  # unit at a joint that slides


_LAWS = {
    "coulomb": _Law(1, "N m", "N"),
    "viscous": _Law(2, "N m s/rad", "N s/m"),
    "quadratic_viscous": _Law(3, "N m s^2/rad^2", "N s^2/m^2"),
    "load_friction": _Law(0, "1", "1"),
    "coupling_coulomb": _Law(0, "N m", "N"),
    "coupling_viscous": _Law(0, "N m s/rad", "N s/m"),
}
"""Friction of coupled gears is stated at the joint already."""

FRICTION_KINDS = tuple(_LAWS)
"""Kinds of parameters that are friction."""


def to_joint_side(kind: str, joint: Joint) -> tuple[float, str]:
    """Returns what turns a friction of a joint's motor into that at the joint, and its unit there.

    The joint moves at `v = w / r` with the motor's speed `w` and the ratio `r` (of a slide in rad/m), and feels the
    motor's torque times `r`. So `F_c` of the motor is `|r| F_c` at the joint, `F_v w` is `r^2 F_v v`, and
    `F_2 w |w|` is `|r|^3 F_2 v |v|`. Friction per torque is the same on both sides. Of coupled joints it is
    what the joint's own motor does through its own gear.

    Args:
        kind: Of `FRICTION_KINDS`.
        joint: The joint; without a motor its friction is at the joint already.
    """
    law = _LAWS[kind]
    unit = law.slides if joint.type == "prismatic" else law.turns
    return abs(joint.motor.gear_ratio) ** law.power, unit


def is_at_joint(joint: Joint) -> bool:
    """Whether all of a joint is on the joint's side already: it has no motor, or its motor stands for the slide."""
    return not joint.has_motor or acts_along(joint)
