"""What a fit found of counterbalances, for what mean torques are held against."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from robid.arrays import FloatArray
from robid.fit.elastic.doubts.balances import balance_doubts
from robid.fit.elastic.doubts.column import RobotMove
from robid.fit.estimate import Estimate
from robid.robot.description import Robot

_WAVES = 2


def balanced(robot: Robot, estimate: Estimate) -> tuple[Robot, FloatArray | None]:
    """Returns a robot with the counterbalances that a fit freed, and how far they may be off.

    Args:
        robot: The robot file that the fit started from.
        estimate: What the fit found.

    Returns:
        The robot, and standard deviations (n_joint, 2) of each joint's sine and cosine [N m], zero where none is freed;
        the robot as it is and None where the fit freed none at all.
    """
    deviations = np.zeros(len(robot.joints) * _WAVES)
    joints, freed = {joint.name: row for row, joint in enumerate(robot.joints)}, False
    for doubt in balance_doubts(robot):
        if doubt.name not in estimate.names or not isinstance(doubt.direction, RobotMove):
            continue
        index, freed = estimate.names.index(doubt.name), True
        value = float(estimate.value[index])
        ends = np.abs([estimate.lower[index] - value, estimate.upper[index] - value])
        joint, _, wave = doubt.name.rpartition(".")
        row = _WAVES * joints[joint] + wave.endswith("cosine")
        deviations[row] = ends.max() / norm.ppf(0.5 + 0.5 * estimate.confidence)
        robot = doubt.direction.moved(robot, value)
    return robot, deviations.reshape(-1, _WAVES) if freed else None
