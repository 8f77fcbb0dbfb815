"""Shapes of a robot's own file, to tell where it touches itself."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from pathlib import Path

import mujoco
import numpy as np

from robid.arrays import FloatArray
from robid.robot.foreign import name_everything
from robid.robot.quiet import quiet_reading
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
    root = ET.fromstring(path.read_bytes())
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
