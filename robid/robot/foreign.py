"""Reading a rigid robot from an MJCF or URDF file, without what an elastic robot cannot keep."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError

_REMOVED = (
    ("keys", "keyframe"),
    ("sensors", "sensor"),
    ("actuators", "actuator"),
    ("equalities", "equality constraint"),
    ("tendons", "tendon"),
    ("pairs", "contact pair"),
    ("excludes", "contact exclusion"),
    ("skins", "skin"),
    ("flexes", "flexible body"),
)
_ASSETS = ("meshes", "hfields", "materials", "textures")
_PASSIVE = ("damping", "frictionloss", "armature", "stiffness")
_STAND_IN_KG = 1e-3
_DRIVEN = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)
_SPEED_OF_LIGHT = 3e8


@dataclass(frozen=True)
class ForeignModel:
    """A rigid robot file as MuJoCo compiles it, without what an elastic robot cannot keep.

    Attributes:
        name: Name of the file.
        compiled: The kinematic tree with its masses.
        hinges: Names of its hinge joints, base to tips.
        slides: Names of its slide joints.
        fixed: Names of its joints that do not move.
        others: Names of its joints that are none of these.
        massless: Joints whose link has no inertial, with the link's name.
        speed: Arm-side speed limits that it states, by joint [rad/s, or m/s].
        torque: Arm-side torque or force limits that it states, by joint [N m, or N].
        notes: What was left out.
    """

    name: str
    compiled: mujoco.MjModel
    hinges: tuple[str, ...]
    slides: tuple[str, ...]
    fixed: tuple[str, ...]
    others: tuple[str, ...]
    massless: Mapping[str, str]
    speed: Mapping[str, float]
    torque: Mapping[str, float]
    notes: tuple[str, ...]

    @property
    def driven(self) -> tuple[str, ...]:
        """Names of the joints that a motor can drive: hinges and slides."""
        return (*self.hinges, *self.slides)

    def frames(self) -> tuple[str, ...]:
        """Names of its bodies and sites."""
        model = self.compiled
        bodies = [model.body(index).name for index in range(1, model.nbody)]
        return (*bodies, *(model.site(index).name for index in range(model.nsite)))


def read_model(path: Path) -> ForeignModel:
    """Reads an MJCF or URDF file; meshes need not be there.

    Raises:
        DataError: If it cannot be read as either.
    """
    try:
        root = ET.fromstring(path.read_bytes())
        spec = mujoco.MjSpec.from_file(str(path))
        is_urdf = root.tag == "robot"
        speeds = _urdf_speeds(root) if is_urdf else {}
        torques = _torque_limits(spec)
        notes = tuple(_strip(spec, is_urdf=is_urdf))
        massless = _fill_massless(spec)
        spec.compiler.fusestatic = False
        compiled = spec.compile()
    except OSError as error:
        what = f"cannot be read: {error.strerror or error}"
        raise DataError(what, where=str(path), remedy="check the path") from error
    except (ET.ParseError, ValueError) as error:
        what = f"is not a robot that MuJoCo can read: {' '.join(str(error).split())}"
        raise DataError(what, where=str(path), remedy="correct the file") from error
    names: dict[int, list[str]] = {int(kind): [] for kind in mujoco.mjtJoint.__members__.values()}
    for index in range(compiled.njnt):
        names[int(compiled.jnt_type[index])].append(compiled.joint(index).name)
    hinges, slides = (tuple(names.pop(int(kind))) for kind in _DRIVEN)
    fixed = tuple(joint.get("name", "") for joint in root.findall("joint") if joint.get("type") == "fixed")
    return ForeignModel(
        path.name, compiled, hinges, slides, fixed if is_urdf else (), _joined(names),
        massless, speeds, torques, tuple(f"{path.name}: {note}" for note in notes),
    )  # fmt: skip


def _joined(names: Mapping[int, list[str]]) -> tuple[str, ...]:
    return tuple(name for each in names.values() for name in each)


def _urdf_speeds(root: ET.Element) -> dict[str, float]:
    speeds = {}
    for joint in root.findall("joint"):
        limit = joint.find("limit")
        speed = float(limit.get("velocity", "0")) if limit is not None else 0.0
        if 0 < speed < _SPEED_OF_LIGHT:
            speeds[joint.get("name", "")] = speed
    return speeds


def _torque_limits(spec: mujoco.MjSpec) -> dict[str, float]:
    """Torque limits of joints, else of the actuators that drive them."""
    limits: dict[str, float] = {}
    for actuator in spec.actuators:
        if actuator.trntype != mujoco.mjtTrn.mjTRN_JOINT:
            continue
        force = float(actuator.forcerange[1])
        if force <= 0 and actuator.biastype == mujoco.mjtBias.mjBIAS_NONE:
            force = float(actuator.ctrlrange[1] * actuator.gainprm[0])
        force *= abs(float(actuator.gear[0]))
        if force > 0:
            limits[actuator.target] = force
    return limits | {joint.name: float(joint.actfrcrange[1]) for joint in spec.joints if joint.actfrcrange[1] > 0}


def _strip(spec: mujoco.MjSpec, *, is_urdf: bool) -> Iterator[str]:
    """Removes what an elastic robot cannot keep, and says what it was."""
    for key, word in _REMOVED:
        elements = list(getattr(spec, key))
        if elements:
            yield _left_out(len(elements), word, [element.name for element in elements])
        for element in elements:
            spec.delete(element)
    for key in _PASSIVE:
        names = [joint.name for joint in spec.joints if np.any(np.asarray(getattr(joint, key)) != 0)]
        if names:
            yield f"{key} of joints left out ({_listed(names)})"
    for joint in spec.joints:
        joint.damping, joint.stiffness = np.zeros(3), np.zeros(3)
        joint.frictionloss, joint.armature = 0.0, 0.0
    yield from _strip_geometry(spec, is_urdf=is_urdf)


def _strip_geometry(spec: mujoco.MjSpec, *, is_urdf: bool) -> Iterator[str]:
    """Keeps only what gives an MJCF body without an inertial its mass; a URDF states no density."""
    always = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    weighing, dropped = [], 0
    for body in spec.bodies:
        if not is_urdf and body.name != "world" and body.geoms and (always or not body.explicitinertial):
            weighing.append(body.name)
            continue
        for geom in list(body.geoms):
            spec.delete(geom)
            dropped += 1
    if weighing:
        yield f"mass taken from geometry, as the file says no other ({_listed(weighing)})"
    if dropped:
        yield f"{dropped} shapes and their contacts left out"
    if not weighing:
        for key in _ASSETS:
            for asset in list(getattr(spec, key)):
                spec.delete(asset)


def _fill_massless(spec: mujoco.MjSpec) -> dict[str, str]:
    """Finds moving links without mass; a stand-in lets MuJoCo compile them, so that all faults are found at once."""
    massless: dict[str, str] = {}
    for body in spec.bodies[1:]:
        if body.joints and not _weighs(body):
            massless |= {joint.name: body.name for joint in body.joints}
            body.explicitinertial, body.mass, body.inertia = True, _STAND_IN_KG, np.full(3, _STAND_IN_KG)
            body.ipos, body.iquat = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    return massless


def _weighs(body: mujoco.MjsBody) -> bool:
    """Whether a body or one welded to it has mass."""
    own = (body.explicitinertial and body.mass > 0) or bool(body.geoms)
    return own or any(_weighs(child) for child in body.bodies if not child.joints)


def _left_out(count: int, word: str, names: list[str]) -> str:
    plural = {"equality constraint": "equality constraints", "flexible body": "flexible bodies"}.get(word, f"{word}s")
    return f"{count} {word if count == 1 else plural} left out ({_listed(names)})"


def _listed(names: list[str]) -> str:
    shown = [name or "unnamed" for name in names]
    return ", ".join(shown) if len(shown) <= 8 else f"{', '.join(shown[:7])} and {len(shown) - 7} more"


class Shapes:
    """Shapes of a robot's own file without meshes, to tell where it touches itself."""

    def __init__(self, path: Path, joints: Sequence[str], locked: Mapping[str, float]) -> None:
        """Reads them.

        Args:
            path: The MJCF or URDF file.
            joints: Names of the driven joints, base to flange.
            locked: Positions of other joints [rad, or m].
        """
        spec = mujoco.MjSpec.from_file(str(path))
        for geom in list(spec.geoms):
            if geom.type == mujoco.mjtGeom.mjGEOM_MESH:
                spec.delete(geom)
        for mesh in list(spec.meshes):
            spec.delete(mesh)
        self._model = spec.compile()
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
