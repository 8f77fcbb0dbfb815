"""What it costs to visit a configuration."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray, check_shape
from robid.robot.description import Robot


def visit_cost_s(robot: Robot, configurations: FloatArray, measuring_s: float, speed_share: float) -> FloatArray:
    """Time that a visit to each configuration takes: the experiments there and the way from the first one.

    All joints travel together; the one that needs longest at its share of the motor's largest speed decides. The first
    configuration stands for wherever the robot comes from: the order of the visits is not known yet.

    Args:
        robot: The robot.
        configurations (n_conf, n_joint): Arm-side angles, the first one where the robot is at home [rad].
        measuring_s: Time of the experiments of one visit [s].
        speed_share: Share of the largest speed at which the robot travels.

    Returns:
        Times (n_conf,) [s].
    """
    check_shape("configurations", configurations, "n_conf n_joint", n_joint=len(robot.joints))
    speed = np.array([joint.motor.max_speed_rad_s / abs(joint.motor.gear_ratio) for joint in robot.joints])
    way = np.abs(configurations - configurations[0]) / (speed_share * speed)
    return np.asarray(measuring_s + way.max(axis=1))
