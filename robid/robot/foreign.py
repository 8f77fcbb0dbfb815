"""A rigid robot from an MJCF or URDF file: its serial chain of hinges as plain description data."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.robot.description import Inertial
from robid.robot.inertia import combine

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
_SPEED_OF_LIGHT = 3e8


@dataclass(frozen=True)
class ForeignModel:
    """A rigid robot file as MuJoCo compiles it, without what an elastic robot cannot keep.

    Attributes:
        name: Name of the file.
        compiled: The kinematic tree with its masses.
        hinges: Names of its hinge joints, base to tips.
        fixed: Names of its joints that do not move.
        others: Names of its joints that neither turn nor are fixed.
        massless: Joints whose link has no inertial, with the link's name.
        speed_rad_s: Arm-side speed limits that it states, by joint [rad/s].
        torque_nm: Arm-side torque limits that it states, by joint [N m].
        notes: What was left out.
    """

    name: str
    compiled: mujoco.MjModel
    hinges: tuple[str, ...]
    fixed: tuple[str, ...]
    others: tuple[str, ...]
    massless: Mapping[str, str]
    speed_rad_s: Mapping[str, float]
    torque_nm: Mapping[str, float]
    notes: tuple[str, ...]

    def frames(self) -> tuple[str, ...]:
        """Names of its bodies and sites."""
        model = self.compiled
        bodies = [model.body(index).name for index in range(1, model.nbody)]
        return (*bodies, *(model.site(index).name for index in range(model.nsite)))


@dataclass(frozen=True)
class ForeignJoint:
    """A hinge of a foreign robot, turned so that its axis is z, and the link that it moves.

    Attributes:
        name: Name of the joint.
        position_m (3,): Origin of the joint frame in the previous joint's frame [m].
        rotation (3, 3): Orientation of the joint frame in the previous joint's frame at zero angle.
        link: Mass properties of all that it moves up to the next joint, in the joint frame.
        range_rad: Lower and upper limit [rad]; None where the file has none.
        body_position_m (3,): Origin of the file's own body frame in the joint frame [m].
        body_rotation (3, 3): Orientation of the file's own body frame in the joint frame.
    """

    name: str
    position_m: FloatArray
    rotation: FloatArray
    link: Inertial
    range_rad: tuple[float, float] | None
    body_position_m: FloatArray
    body_rotation: FloatArray


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
    names: dict[bool, list[str]] = {True: [], False: []}
    for index in range(compiled.njnt):
        names[compiled.jnt_type[index] == mujoco.mjtJoint.mjJNT_HINGE].append(compiled.joint(index).name)
    fixed = tuple(joint.get("name", "") for joint in root.findall("joint") if joint.get("type") == "fixed")
    return ForeignModel(
        path.name, compiled, tuple(names[True]), fixed if is_urdf else (), tuple(names[False]), massless, speeds,
        torques, tuple(f"{path.name}: {note}" for note in notes),
    )  # fmt: skip


def order_of(model: ForeignModel, joints: Sequence[str]) -> list[str]:
    """Says why hinges are not one serial chain in the order given, a sentence each; empty if they are."""
    compiled = model.compiled
    bodies = [int(compiled.joint(name).bodyid[0]) for name in joints]
    found = []
    for index, (name, body) in enumerate(zip(joints, bodies, strict=True)):
        before = joints[index - 1] if index else "the base"
        if body in bodies[:index]:
            found.append(f"`{name}` and `{joints[bodies.index(body)]}` move the same body: put a body between them")
            continue
        parent = next((b for b in _ancestors(compiled, int(compiled.body_parentid[body])) if b in bodies), None)
        if parent != (bodies[index - 1] if index else None):
            actual = "the base" if parent is None else f"`{joints[bodies.index(parent)]}`"
            found.append(f"`{name}` is listed after {before}, but in the file it follows {actual}")
    return found


def extract_chain(model: ForeignModel, joints: Sequence[str], locked_rad: Mapping[str, float]) -> list[ForeignJoint]:
    """Extracts a serial chain of hinges; everything else moves with the link that carries it.

    Args:
        model: The model; `order_of` finds nothing wrong with `joints`.
        joints: Names of the hinges, base to flange.
        locked_rad: Angles of other hinges, which do not move [rad].

    Returns:
        The joints at zero angles of the file's own.
    """
    compiled, data = model.compiled, _at_zero(model.compiled, locked_rad)
    bodies = [int(compiled.joint(name).bodyid[0]) for name in joints]
    chain: list[ForeignJoint] = []
    position, rotation = np.zeros(3), np.eye(3)
    for name, body in zip(joints, bodies, strict=True):
        joint = compiled.joint(name)
        origin = data.xanchor[joint.id].copy()
        frame = data.xmat[body].reshape(3, 3)
        turned = _turn_z_to(frame.T @ data.xaxis[joint.id])
        oriented = frame @ turned
        carried = [b for b in range(1, compiled.nbody) if _carrier(compiled, b, bodies) == body]
        limits = (float(joint.range[0]), float(joint.range[1])) if compiled.jnt_limited[joint.id] else None
        chain.append(
            ForeignJoint(
                name=name,
                position_m=rotation.T @ (origin - position),
                rotation=rotation.T @ oriented,
                link=_merged(compiled, data, carried, origin, oriented),
                range_rad=limits,
                body_position_m=oriented.T @ (data.xpos[body] - origin),
                body_rotation=turned.T,
            )
        )
        position, rotation = origin, oriented
    return chain


def frame_on_last(
    model: ForeignModel, joints: Sequence[str], locked_rad: Mapping[str, float], frame: str
) -> tuple[FloatArray, FloatArray] | None:
    """Returns where a body or site sits on the last link.

    Args:
        model: The model.
        joints: Names of the chain's hinges.
        locked_rad: Angles of other hinges [rad].
        frame: Name of the body or site.

    Returns:
        Position (3,) [m] and orientation (3, 3) in the last joint's own body frame; None if it is not there.
    """
    compiled, data = model.compiled, _at_zero(model.compiled, locked_rad)
    bodies = [int(compiled.joint(name).bodyid[0]) for name in joints]
    site = mujoco.mj_name2id(compiled, mujoco.mjtObj.mjOBJ_SITE, frame)
    body = mujoco.mj_name2id(compiled, mujoco.mjtObj.mjOBJ_BODY, frame)
    if site < 0 and body < 0:
        return None
    owner = int(compiled.site_bodyid[site]) if site >= 0 else body
    if _carrier(compiled, owner, bodies) != bodies[-1]:
        return None
    position, matrix = (data.site_xpos[site], data.site_xmat[site]) if site >= 0 else (data.xpos[body], data.xmat[body])
    last = data.xmat[bodies[-1]].reshape(3, 3)
    return last.T @ (position - data.xpos[bodies[-1]]), last.T @ matrix.reshape(3, 3)


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


def _at_zero(compiled: mujoco.MjModel, locked_rad: Mapping[str, float]) -> mujoco.MjData:
    data = mujoco.MjData(compiled)
    data.qpos[:] = 0.0
    for name, angle in locked_rad.items():
        data.qpos[compiled.joint(name).qposadr[0]] = angle
    mujoco.mj_kinematics(compiled, data)
    return data


def _ancestors(compiled: mujoco.MjModel, body: int) -> Iterator[int]:
    """Yields a body and what carries it, down to the world."""
    while body > 0:
        yield body
        body = int(compiled.body_parentid[body])


def _carrier(compiled: mujoco.MjModel, body: int, bodies: Sequence[int]) -> int:
    return next((other for other in _ancestors(compiled, body) if other in bodies), 0)


def _merged(
    compiled: mujoco.MjModel, data: mujoco.MjData, bodies: Sequence[int], origin: FloatArray, oriented: FloatArray
) -> Inertial:
    parts = []
    for body in bodies:
        if compiled.body_mass[body] > 0:
            axes = oriented.T @ data.ximat[body].reshape(3, 3)
            com = oriented.T @ (data.xipos[body] - origin)
            parts.append(Inertial(float(compiled.body_mass[body]), com, axes * compiled.body_inertia[body] @ axes.T))
    merged = parts[0]
    for part in parts[1:]:
        merged = combine(merged, part)
    return merged


def _turn_z_to(axis: FloatArray) -> FloatArray:
    """Returns the smallest rotation (3, 3) that turns z to a unit axis; about x where they are opposite."""
    x, y, z = (float(value) for value in axis)
    if z < -1 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    share = 1 / (1 + z)
    return np.array([[1 - share * x * x, -share * x * y, x], [-share * x * y, 1 - share * y * y, y], [-x, -y, z]])


def _left_out(count: int, word: str, names: list[str]) -> str:
    plural = {"equality constraint": "equality constraints", "flexible body": "flexible bodies"}.get(word, f"{word}s")
    return f"{count} {word if count == 1 else plural} left out ({_listed(names)})"


def _listed(names: list[str]) -> str:
    shown = [name or "unnamed" for name in names]
    return ", ".join(shown) if len(shown) <= 8 else f"{', '.join(shown[:7])} and {len(shown) - 7} more"
