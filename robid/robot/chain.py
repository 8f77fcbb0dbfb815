"""The serial chain of hinges and slides of a rigid robot file as plain description data."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from robid.arrays import FloatArray
from robid.robot.description import Inertial
from robid.robot.foreign import ForeignModel
from robid.robot.inertia import combine


@dataclass(frozen=True)
class ForeignJoint:
    """A hinge or slide of a foreign robot, turned so that its axis is z, and the link that it moves."""

    name: str
    position_m: FloatArray  # (3,) Origin of the joint frame in the previous joint's frame [m]
    rotation: FloatArray  # (3, 3) Orientation of the joint frame in the previous joint's frame at zero angle
    link: Inertial  # Mass properties of all that it moves up to the next joint, in the joint frame
    range: tuple[float, float] | None  # Lower and upper limit [rad, or m]; None where the file has none
    slides: bool
    body_position_m: FloatArray  # (3,) Origin of the file's own body frame in the joint frame [m]
    body_rotation: FloatArray  # (3, 3) Orientation of the file's own body frame in the joint frame


def order_of(model: ForeignModel, joints: Sequence[str]) -> list[str]:
    """Says why joints are not one serial chain in the order given, a sentence each; empty if they are."""
    compiled = model.compiled
    bodies = [int(compiled.joint(name).bodyid[0]) for name in joints]
    below = {body: set(_ancestors(compiled, body)) for body in bodies}
    for name, body in zip(joints, bodies, strict=True):
        apart = [n for n, b in zip(joints, bodies, strict=True) if b not in below[body] and body not in below[b]]
        if apart:
            rest = ", ".join(f"`{other}`" for other in apart)
            told = f"`{name}` and {rest} of `{model.name}` lie on different branches, and a robot here is one chain:"
            return [f"{told} leave those of one branch out; `locked: rest` locks them where they rest"]
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
    if found and len(set(bodies)) == len(bodies):
        ordered = sorted(joints, key=lambda name: len(below[int(compiled.joint(name).bodyid[0])]))
        found[0] += f"; base to flange they are {', '.join(ordered)}"
    return found


def carried_by(
    model: ForeignModel, joints: Sequence[str], apart: Collection[str] = ()
) -> dict[str | None, tuple[str, ...]]:
    """Returns the names of the bodies that each joint moves up to the next one; those of None do not move.

    Args:
        model: The model.
        joints: Names of joints that move.
        apart: Names of joints whose bodies move otherwise: they and what they carry are left out.
    """
    compiled = model.compiled
    movers = {int(compiled.joint(name).bodyid[0]): name for name in joints}
    others = [int(compiled.joint(name).bodyid[0]) for name in apart]
    found: dict[str | None, tuple[str, ...]] = {}
    for body in range(1, compiled.nbody):
        carrier = _carrier(compiled, body, [*movers, *others])
        if carrier not in others:
            mover = movers.get(carrier)
            found[mover] = (*found.get(mover, ()), compiled.body(body).name)
    return found


def frame_of_link(
    model: ForeignModel, joint: str, carrier: str | None, held: Mapping[str, float], apart: Collection[str]
) -> tuple[FloatArray, FloatArray, Inertial]:
    """Returns the frame of a joint that is no part of the chain, its axis along z, and what it moves.

    Args:
        model: The model.
        joint: Name of the joint, at its zero position.
        carrier: Name of the joint that carries it; None for the base.
        held: Positions of joints that do not move [rad, or m].
        apart: Names of all such joints.

    Returns:
        Position (3,) [m] and orientation (3, 3) of the frame, and the mass properties in it. They are given in the
        carrier's own body frame, in such a frame where the carrier is another such joint, in the world for the base.
    """
    compiled, data = model.compiled, _at_zero(model.compiled, held)
    origin, oriented = _axis_frame(compiled, data, joint)
    names = carried_by(model, [joint], [each for each in apart if each != joint]).get(joint, ())
    link = _merged(model, data, [compiled.body(name).id for name in names], origin, oriented)
    if carrier is None:
        return origin, oriented, link
    body = int(compiled.joint(carrier).bodyid[0])
    position, rotation = data.xpos[body], data.xmat[body].reshape(3, 3)
    if carrier in apart:
        position, rotation = _axis_frame(compiled, data, carrier)
    return rotation.T @ (origin - position), rotation.T @ oriented, link


def carrier_of(model: ForeignModel, joint: str, movers: Collection[str]) -> str | None:
    """Returns which of these joints carries a joint; None for the base."""
    compiled = model.compiled
    bodies = {int(compiled.joint(name).bodyid[0]): name for name in movers if name != joint}
    above = int(compiled.body_parentid[int(compiled.joint(joint).bodyid[0])])
    return bodies.get(_carrier(compiled, above, list(bodies)))


def _axis_frame(compiled: mujoco.MjModel, data: mujoco.MjData, joint: str) -> tuple[FloatArray, FloatArray]:
    """Returns origin (3,) [m] and orientation (3, 3) in the world of a joint's frame, its axis along z."""
    own = compiled.joint(joint)
    body = int(own.bodyid[0])
    return data.xanchor[own.id].copy(), data.xmat[body].reshape(3, 3) @ _turned(data, own.id, body)


def _turned(data: mujoco.MjData, joint: int, body: int) -> FloatArray:
    """Returns the orientation (3, 3) of a joint's frame in the frame of its body."""
    return _turn_z_to(data.xmat[body].reshape(3, 3).T @ data.xaxis[joint])


def extract_chain(
    model: ForeignModel, joints: Sequence[str], locked: Mapping[str, float], apart: Collection[str] = ()
) -> list[ForeignJoint]:
    """Extracts a serial chain of hinges and slides at zero positions; all else moves with the link that carries it.

    Args:
        model: The model; `order_of` finds nothing wrong with `joints`.
        joints: Names of the joints, base to flange.
        locked: Positions of other joints, which do not move [rad, or m].
        apart: Names of joints whose bodies are left out, with what they carry.
    """
    compiled, data = model.compiled, _at_zero(model.compiled, locked)
    bodies = [int(compiled.joint(name).bodyid[0]) for name in joints]
    moved = carried_by(model, joints, apart)
    chain: list[ForeignJoint] = []
    position: FloatArray = np.zeros(3)
    rotation: FloatArray = np.eye(3)
    for name, body in zip(joints, bodies, strict=True):
        joint = compiled.joint(name)
        origin, turned = data.xanchor[joint.id].copy(), _turned(data, joint.id, body)
        oriented = data.xmat[body].reshape(3, 3) @ turned
        carried = [compiled.body(each).id for each in moved[name]]
        limits = (float(joint.range[0]), float(joint.range[1])) if compiled.jnt_limited[joint.id] else None
        chain.append(
            ForeignJoint(
                name=name,
                position_m=rotation.T @ (origin - position),
                rotation=rotation.T @ oriented,
                link=_merged(model, data, carried, origin, oriented),
                range=limits,
                slides=compiled.jnt_type[joint.id] == mujoco.mjtJoint.mjJNT_SLIDE,
                body_position_m=oriented.T @ (data.xpos[body] - origin),
                body_rotation=turned.T,
            )
        )
        position, rotation = origin, oriented
    return chain


def frame_on_last(
    model: ForeignModel, joints: Sequence[str], locked: Mapping[str, float], frame: str, apart: Collection[str] = ()
) -> tuple[FloatArray, FloatArray] | None:
    """Returns position (3,) [m] and orientation (3, 3) of a body or site in the last joint's own body frame, or None.

    Args:
        model: The model.
        joints: Names of the chain's joints.
        locked: Positions of other joints [rad, or m].
        frame: Name of the body or site.
        apart: Names of joints whose bodies are no part of the last link.
    """
    compiled, data = model.compiled, _at_zero(model.compiled, locked)
    bodies = [int(compiled.joint(name).bodyid[0]) for name in joints]
    site = mujoco.mj_name2id(compiled, mujoco.mjtObj.mjOBJ_SITE, frame)
    body = mujoco.mj_name2id(compiled, mujoco.mjtObj.mjOBJ_BODY, frame)
    if site < 0 and body < 0:
        return None
    owner = int(compiled.site_bodyid[site]) if site >= 0 else body
    others = [int(compiled.joint(name).bodyid[0]) for name in apart]
    if _carrier(compiled, owner, [*bodies, *others]) != bodies[-1]:
        return None
    position, matrix = (data.site_xpos[site], data.site_xmat[site]) if site >= 0 else (data.xpos[body], data.xmat[body])
    last = data.xmat[bodies[-1]].reshape(3, 3)
    return last.T @ (position - data.xpos[bodies[-1]]), last.T @ matrix.reshape(3, 3)


def _at_zero(compiled: mujoco.MjModel, locked: Mapping[str, float]) -> mujoco.MjData:
    data = mujoco.MjData(compiled)  # free and ball joints stay where the file has them
    driven = np.isin(compiled.jnt_type, (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE))
    data.qpos[compiled.jnt_qposadr[driven]] = 0.0
    for name, angle in locked.items():
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
    model: ForeignModel, data: mujoco.MjData, bodies: Sequence[int], origin: FloatArray, oriented: FloatArray
) -> Inertial:
    """Joins bodies rigidly, in a frame of this origin (3,) [m] and orientation (3, 3) in the world."""
    merged = Inertial(0.0, np.zeros(3), np.zeros((3, 3)))
    for body in bodies:
        mass, tensor = float(model.weights.mass_kg[body]), model.weights.inertia_kgm2[body]
        if mass == 0 and not tensor.any():
            continue
        axes = oriented.T @ data.ximat[body].reshape(3, 3)
        part = Inertial(mass, oriented.T @ (data.xipos[body] - origin), axes @ tensor @ axes.T)
        merged = part if merged.mass_kg == 0 and not merged.inertia_kgm2.any() else combine(merged, part)
    return merged


def _turn_z_to(axis: FloatArray) -> FloatArray:
    """Returns the smallest rotation (3, 3) that turns z to a unit axis; about x where they are opposite."""
    x, y, z = (float(value) for value in axis)
    if z < -1 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    share = 1 / (1 + z)
    return np.array([[1 - share * x * x, -share * x * y, x], [-share * x * y, 1 - share * y * y, y], [-x, -y, z]])
