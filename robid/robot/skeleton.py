"""Where the joints and the tool of a rigid robot are."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray, check_shape
from robid.robot.description import Robot


def skeleton(robot: Robot, configurations: FloatArray, tool_m: FloatArray | None = None) -> FloatArray:
    """Places base, joints and tool point; springs do not deflect.

    Args:
        robot: The robot.
        configurations (n_conf, n_joint): Arm-side positions [rad, or m].
        tool_m (3,): Tool point in the last joint's frame; the payload's centre of mass by default [m].

    Returns:
        Points (n_conf, n_joint + 2, 3) in the base frame: its origin, the joints' origins, the tool point [m].
    """
    check_shape("configurations", configurations, "n_conf n_joint", n_joint=len(robot.joints))
    n_conf = len(configurations)
    position, rotation = np.zeros((n_conf, 3)), np.broadcast_to(np.eye(3), (n_conf, 3, 3))
    points = [position]
    for joint, moved in zip(robot.joints, configurations.T, strict=True):
        position = position + rotation @ joint.position_m
        rotation = rotation @ joint.rotation
        if joint.type == "prismatic":
            position = position + moved[:, None] * rotation[:, :, 2]
        else:
            rotation = rotation @ _about_z(moved)
        points.append(position)
    points.append(position + rotation @ (robot.payload.com_m if tool_m is None else tool_m))
    return np.stack(points, axis=1)


def _about_z(angle: FloatArray) -> FloatArray:
    """Rotations (n, 3, 3) about the z axis."""
    turn = np.zeros((angle.size, 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = np.cos(angle)
    turn[:, 1, 0] = np.sin(angle)
    turn[:, 0, 1] = -turn[:, 1, 0]
    turn[:, 2, 2] = 1.0
    return turn
