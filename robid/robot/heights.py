"""Heights of a robot's points and how its joints change them, for many configurations at once."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray
from robid.robot.description import Robot


def heights(robot: Robot, configurations: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Computes heights of joint origins, of the links' centres of mass and of the payload's, springs at rest.

    Args:
        robot: The robot.
        configurations (n_conf, n_joint): Arm-side joint positions [rad, or m].

    Returns:
        Heights (n_conf, n_point) in the world frame [m], and their slopes (n_conf, n_point, n_joint) [m/rad, or 1].
    """
    position, rotation = np.zeros((len(configurations), 3)), np.broadcast_to(np.eye(3), (len(configurations), 3, 3))
    origins, axes, found = [], [], []
    last = len(robot.joints) - 1
    for index, joint in enumerate(robot.joints):
        position = position + rotation @ joint.position_m
        rotation = rotation @ joint.rotation
        axes.append(rotation[:, :, 2])
        if joint.type == "prismatic":
            position = position + configurations[:, index, None] * axes[-1]
        else:
            rotation = rotation @ _about_z(configurations[:, index])
        origins.append(position)
        own = [np.zeros(3), joint.link.com_m] + ([robot.payload.com_m] if index == last else [])
        found += [(index, position + rotation @ point) for point in own]
    slopes = np.zeros((len(configurations), len(found), len(robot.joints)))
    for row, (carrier, point) in enumerate(found):
        for index in range(carrier + 1):
            slides = robot.joints[index].type == "prismatic"
            moved = axes[index] if slides else np.cross(axes[index], point - origins[index])
            slopes[:, row, index] = moved[:, 2]
    return np.stack([point[:, 2] for _, point in found], axis=1), slopes


def _about_z(angle: FloatArray) -> FloatArray:
    """Rotations (n_conf, 3, 3) about the z axis."""
    cosine, sine = np.cos(angle), np.sin(angle)
    turned = np.zeros((len(angle), 3, 3))
    turned[:, 0, 0], turned[:, 0, 1] = cosine, -sine
    turned[:, 1, 0], turned[:, 1, 1] = sine, cosine
    turned[:, 2, 2] = 1.0
    return turned
