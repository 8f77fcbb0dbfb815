"""Where a robot can go: floor, self-collision, and the mirror image of a configuration."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.robot.description import Robot
from robid.robot.model import ElasticModel, build_model
from robid.robot.shapes import Shapes

TOUCH_M = 1e-3
"""How far a point may be below the floor."""
_ASLANT = 1e-6


@dataclass(frozen=True)
class Reach:
    """What keeps a robot from a configuration.

    Attributes:
        robot: The robot; its joint limits are one bound.
        floor_m: Height of the floor in the world frame; None where there is none [m].
        shapes: Shapes that must not touch each other; None where the robot has none.
    """

    robot: Robot
    floor_m: float | None = None
    shapes: Shapes | None = None

    def problems(self, configurations: FloatArray) -> list[str]:
        """Says of each configuration why it is out of reach.

        Args:
            configurations (n_conf, n_joint): Arm-side joint angles [rad].

        Returns:
            One phrase per configuration, empty where it is in reach.
        """
        beyond = [self._beyond(row) for row in configurations]
        low = self._under_floor(configurations)
        hits = [""] * len(beyond) if self.shapes is None else [self.shapes.touching(row) for row in configurations]
        return [limit or floor or hit for limit, floor, hit in zip(beyond, low, hits, strict=True)]

    def _beyond(self, angles: FloatArray) -> str:
        for joint, angle in zip(self.robot.joints, angles, strict=True):
            if not joint.lower - _ASLANT <= angle <= joint.upper + _ASLANT:
                ends, unit = np.array([joint.lower, angle, joint.upper]), "m"
                if joint.type == "revolute":
                    ends, unit = np.rad2deg(ends), "deg"
                low, here, high = ends
                return f"joint `{joint.name}` at {here:.4g} {unit} moves from {low:.4g} to {high:.4g} {unit}"
        return ""

    def _under_floor(self, configurations: FloatArray) -> list[str]:
        if self.floor_m is None:
            return [""] * len(configurations)
        height = points(self.robot, configurations)[..., 2].min(axis=1) - self.floor_m
        return [f"it reaches {-1e3 * low:.0f} mm below the floor" if low < -TOUCH_M else "" for low in height]


def points(robot: Robot, configurations: FloatArray) -> FloatArray:
    """Returns joint origins and centres of mass of the links, payload included, springs at rest.

    Args:
        robot: The robot.
        configurations (n_conf, n_joint): Arm-side joint angles [rad].

    Returns:
        Points (n_conf, n_point, 3) in the world frame [m].
    """
    model = build_model(robot)
    moved = [body for body in range(1, model.mujoco.nbody) if model.mujoco.body_jntnum[body]]
    rotors = np.setdiff1d(model.motor, model.arm)
    links = [body for body in moved if model.mujoco.body_jntadr[body] not in rotors]
    found = []
    for data in _poses(model, configurations):
        payload = data.xpos[links[-1]] + data.xmat[links[-1]].reshape(3, 3) @ robot.payload.com_m
        found.append(np.concatenate([data.xpos[links], data.xipos[links], payload[None]]))
    return np.array(found)


def mirror(robot: Robot, configurations: FloatArray) -> FloatArray:
    """Mirrors configurations at the vertical plane through the world's x axis.

    Args:
        robot: The robot.
        configurations (n_conf, n_joint): Arm-side joint angles [rad].

    Returns:
        Mirrored joint angles (n_conf, n_joint) [rad].

    Raises:
        DataError: If the robot is not symmetric about that plane, its lateral offsets apart.

    Source:
        Zimmermann et al. (2023), sec. V-B.
    """
    model = build_model(robot)
    at_zero = next(_poses(model, np.zeros((1, len(robot.joints)))))
    axes, anchors = at_zero.xaxis[model.arm].copy(), at_zero.xanchor[model.arm].copy()
    across = np.abs(axes[:, 1]) > 1 - _ASLANT
    aslant = ~across & (np.abs(axes[:, 1]) > _ASLANT)
    aside = ~across & ~robot.prismatic & (np.abs(anchors[:, 1]) > TOUCH_M)
    bad = [joint.name for joint, wrong in zip(robot.joints, aslant | aside, strict=True) if wrong]
    if bad:
        raise DataError(
            f"the axes of {', '.join(f'`{name}`' for name in bad)} have no mirror image in the robot",
            where=robot.name,
            remedy="list the configurations with `list_deg`",
        )
    return np.asarray(configurations * np.where(across != robot.prismatic, 1.0, -1.0))


def _poses(model: ElasticModel, configurations: FloatArray) -> Iterator[mujoco.MjData]:
    data = mujoco.MjData(model.mujoco)
    for angles in configurations:
        data.qpos[:] = 0.0
        data.qpos[model.arm] = angles
        mujoco.mj_kinematics(model.mujoco, data)
        mujoco.mj_comPos(model.mujoco, data)
        yield data
