"""The serial chain of hinges and slides of a rigid robot file as plain description data."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from robid.arrays import FloatArray
from robid.robot.description import Inertial
from robid.robot.foreign import ForeignModel
from robid.robot.inertia import combine


@dataclass(frozen=True)
class ForeignJoint:
    """A hinge or slide of a foreign robot, turned so that its axis is z, and the link that it moves.

    Attributes:
        name: Name of the joint.
        position_m (3,): Origin of the joint frame in the previous joint's frame [m].
        rotation (3, 3): Orientation of the joint frame in the previous joint's frame at zero angle.
        link: Mass properties of all that it moves up to the next joint, in the joint frame.
        range: Lower and upper limit [rad, or m]; None where the file has none.
        slides: Whether it is a slide.
        body_position_m (3,): Origin of the file's own body frame in the joint frame [m].
        body_rotation (3, 3): Orientation of the file's own body frame in the joint frame.
    """

    name: str
    position_m: FloatArray
    rotation: FloatArray
    link: Inertial
    range: tuple[float, float] | None
    slides: bool
    body_position_m: FloatArray
    body_rotation: FloatArray


def order_of(model: ForeignModel, joints: Sequence[str]) -> list[str]:
    """Says why joints are not one serial chain in the order given, a sentence each; empty if they are."""
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


def extract_chain(model: ForeignModel, joints: Sequence[str], locked: Mapping[str, float]) -> list[ForeignJoint]:
    """Extracts a serial chain of hinges and slides; everything else moves with the link that carries it.

    Args:
        model: The model; `order_of` finds nothing wrong with `joints`.
        joints: Names of the joints, base to flange.
        locked: Positions of other joints, which do not move [rad, or m].

    Returns:
        The joints at zero positions of the file's own.
    """
    compiled, data = model.compiled, _at_zero(model.compiled, locked)
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
                range=limits,
                slides=compiled.jnt_type[joint.id] == mujoco.mjtJoint.mjJNT_SLIDE,
                body_position_m=oriented.T @ (data.xpos[body] - origin),
                body_rotation=turned.T,
            )
        )
        position, rotation = origin, oriented
    return chain


def frame_on_last(
    model: ForeignModel, joints: Sequence[str], locked: Mapping[str, float], frame: str
) -> tuple[FloatArray, FloatArray] | None:
    """Returns where a body or site sits on the last link.

    Args:
        model: The model.
        joints: Names of the chain's joints.
        locked: Positions of other joints [rad, or m].
        frame: Name of the body or site.

    Returns:
        Position (3,) [m] and orientation (3, 3) in the last joint's own body frame; None if it is not there.
    """
    compiled, data = model.compiled, _at_zero(model.compiled, locked)
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


def _at_zero(compiled: mujoco.MjModel, locked: Mapping[str, float]) -> mujoco.MjData:
    data = mujoco.MjData(compiled)
    data.qpos[:] = 0.0
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
