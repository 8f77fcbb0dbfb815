"""Where an arm can be: the shapes of its links, the heights of its parts, and the configurations within reach."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.files import read_regular
from robid.robot.description import Robot
from robid.robot.foreign import name_everything
from robid.robot.inertia import about_z
from robid.robot.model import ElasticModel, build_model, quiet_reading
from robid.robot.urdf import read_urdf


class Shapes:
    """Shapes of a robot's own file without meshes, to tell where it touches itself."""

    def __init__(self, path: Path, joints: Sequence[str], locked: Mapping[str, float]) -> None:
        """Reads them.

        Args:
            path: The MJCF or URDF file, of which `read_model` found nothing wrong.
            joints: Names of the driven joints, base to flange.
            locked: Positions of other joints [rad, or m].
        """
        with quiet_reading():
            self._model = _shapes_of(path)
        self._data = mujoco.MjData(self._model)
        for name, angle in locked.items():
            self._data.joint(name).qpos = angle
        self._hinges = [int(self._model.joint(name).qposadr[0]) for name in joints]

    def touching(self, angles: FloatArray) -> str:
        """Names two bodies that are in contact at joint positions (n_joint,) [rad, or m]; empty if there are none."""
        self._data.qpos[self._hinges] = angles
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_collision(self._model, self._data)
        for contact in self._data.contact:
            bodies = [self._model.body(int(self._model.geom_bodyid[geom])).name for geom in contact.geom]
            if contact.dist < 0:
                return f"`{bodies[0]}` and `{bodies[1]}` touch"
        return ""


def _shapes_of(path: Path) -> mujoco.MjModel:
    root = ET.fromstring(read_regular(path))
    is_urdf = root.tag == "robot"
    text = read_urdf(root, with_shapes=True).text if is_urdf else ""
    spec = mujoco.MjSpec.from_string(text) if is_urdf else mujoco.MjSpec.from_file(str(path))
    name_everything(spec)
    for geom in list(spec.geoms):
        if geom.type == mujoco.mjtGeom.mjGEOM_MESH:
            spec.delete(geom)
    for mesh in list(spec.meshes):
        spec.delete(mesh)
    for body in spec.bodies[1:]:
        # Contacts ask for no masses; what is wrong with them is told where they matter.
        body.explicitinertial, body.mass, body.inertia = True, 1.0, np.ones(3)
        body.fullinertia = np.full(6, np.nan)
    return spec.compile()


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
            rotation = rotation @ about_z(configurations[:, index])
        origins.append(position)
        own = [np.zeros(3), joint.link.com_m] + ([robot.payload.com_m] if index == last else [])
        found += [(index, position + rotation @ point) for point in own]
    slopes = np.zeros((len(configurations), len(found), len(robot.joints)))
    for row, (carrier, point) in enumerate(found):
        for index in range(carrier + 1):
            slides = robot.joints[index].type == "prismatic"
            # dz of a point: the axis of a slide, axis x lever of a turn, their vertical part.
            moved = axes[index] if slides else np.cross(axes[index], point - origins[index])
            slopes[:, row, index] = moved[:, 2]
    return np.stack([point[:, 2] for _, point in found], axis=1), slopes


TOUCH_M = 1e-3  # How far a point may be below the floor
_ASLANT = 1e-6


@dataclass(frozen=True)
class Reach:
    """What keeps a robot from a configuration."""

    robot: Robot
    floor_m: float | None = None  # Height of the floor in the world frame; None where there is none [m]
    shapes: Shapes | None = None  # Shapes that must not touch each other; None where the robot has none

    def problems(self, configurations: FloatArray) -> list[str]:
        """Says in a phrase why each configuration is out of reach; empty where it is in reach.

        Args:
            configurations (n_conf, n_joint): Arm-side joint angles [rad].
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
    """Points (n_conf, n_point, 3) in the world: joint origins, centres of mass with the payload's, springs at rest [m].

    Args:
        robot: The robot.
        configurations (n_conf, n_joint): Arm-side joint angles [rad].
    """
    model = build_model(robot, balanced=True)
    moved = [body for body in range(1, model.mujoco.nbody) if model.mujoco.body_jntnum[body]]
    rotors = np.setdiff1d(model.motor, model.arm)
    links = [body for body in moved if model.mujoco.body_jntadr[body] not in rotors]
    found = []
    for data in _poses(model, configurations):
        payload = data.xpos[links[-1]] + data.xmat[links[-1]].reshape(3, 3) @ robot.payload.com_m
        found.append(np.concatenate([data.xpos[links], data.xipos[links], payload[None]]))
    return np.array(found)


def mirror(robot: Robot, configurations: FloatArray) -> FloatArray:
    """Mirrors joint angles (n_conf, n_joint) at the vertical plane through the world's x axis [rad].

    Args:
        robot: The robot.
        configurations (n_conf, n_joint): Arm-side joint angles [rad].

    Raises:
        DataError: If the robot is not symmetric about that plane, its lateral offsets apart.

    Source:
        Zimmermann et al. (2023), sec. V-B.
    """
    model = build_model(robot, balanced=True)
    at_zero = next(_poses(model, np.zeros((1, len(robot.joints)))))
    axes, anchors = at_zero.xaxis[model.arm].copy(), at_zero.xanchor[model.arm].copy()
    # A mirror image keeps turns about axes across the plane and reverses those within it; of slides the other way
    # round.
    across = np.abs(axes[:, 1]) > 1 - _ASLANT
    aslant = ~across & (np.abs(axes[:, 1]) > _ASLANT)
    aside = ~across & ~robot.prismatic & (np.abs(anchors[:, 1]) > TOUCH_M)
    bad = [joint.name for joint, wrong in zip(robot.joints, aslant | aside, strict=True) if wrong]
    if bad:
        raise DataError(
            f"D209 the axes of {', '.join(f'`{name}`' for name in bad)} have no mirror image in the robot",
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
