"""Counterbalances in mean torques: what one that the robot file lacks would carry, and what a fit leaves open."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray
from robid.results.doubt import two_digits
from robid.robot.description import Robot

BALANCE = "counterbalance"
"""The cause, of `robid.results.doubt.CAUSES`."""
_TELLING_ANGLES = 4  # of a joint: a sine and a cosine pass through the torques at any two of them
_SAME_RAD = 1e-2


def wave_columns(robot: Robot, joint: int, configurations: FloatArray) -> FloatArray:
    """Change (2, n_conf, n_joint) of the motors' torques at rest by one N m of a joint's sine and cosine.

    Args:
        robot: The robot.
        joint: Index of a joint that turns.
        configurations (n_conf, n_joint): Where it rests [rad].
    """
    angle = configurations[:, joint]
    return np.asarray(-np.stack([np.sin(angle), np.cos(angle)])[..., None] * robot.arm_per_motor[joint])


def likely_joints(robot: Robot, configurations: FloatArray) -> list[int]:
    """Joints that may have a counterbalance that nobody stated, and whose angles would show it."""
    return [
        index
        for index, joint in enumerate(robot.joints)
        if joint.type == "revolute"
        and joint.counterbalance is None
        and np.unique(np.round(configurations[:, index] / _SAME_RAD)).size >= _TELLING_ANGLES
    ]


def balance_message(robot: Robot, name: str, waves: FloatArray, where: str) -> str:
    """Says what a counterbalance of a joint carries, by sine and cosine of its angle (2,), and how a fit takes it.

    Beside counterbalances that the file states, no fit takes any.
    """
    free = f"try `free: [{name}.counterbalance]` in an elastic fit"
    remedy = "correct the robot file" if any(joint.counterbalance is not None for joint in robot.joints) else free
    sine, cosine = (two_digits(wave, "+") for wave in waves.tolist())
    return (
        f"mean torques {where} are those with a counterbalance of {two_digits(float(np.hypot(*waves)))} N m at {name} "
        f"({sine} by the sine and {cosine} by the cosine of its angle; {remedy})"
    )
