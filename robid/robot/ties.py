"""Joints and bodies of a rigid robot file that its constraints tie together."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import mujoco
import numpy as np

_TO_BODIES = {mujoco.mjtEq.mjEQ_CONNECT: "connect", mujoco.mjtEq.mjEQ_WELD: "weld"}


@dataclass(frozen=True)
class Tie:
    """A joint that follows another, as `mimic` of a URDF and `equality/joint` of an MJCF say.

    Attributes:
        follower: The joint that follows.
        leader: The joint that it follows; None where it is held.
        factor: Its motion per motion of the leader [rad or m per rad or m].
        offset: Its position where the leader is at 0 [rad, or m].
        is_linear: Whether that is all.
    """

    follower: str
    leader: str | None
    factor: float
    offset: float
    is_linear: bool


@dataclass(frozen=True)
class Bond:
    """A constraint between two bodies, or among several joints.

    Attributes:
        what: What the file calls it, with its name.
        bodies: Names of the two bodies, `world` among them.
        joints: Names of the joints.
    """

    what: str
    bodies: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()


@dataclass(frozen=True)
class Constraint:
    """An equality constraint as it stands in the file; MuJoCo's own data of joints.

    Attributes:
        kind: Its kind.
        name: Its name.
        first: Name of the first thing that it ties.
        second: Name of the second one; empty where it is held.
        data: Coefficients.
        joints: Of tendons, the joints.
    """

    kind: mujoco.mjtEq
    name: str
    first: str
    second: str
    data: tuple[float, ...]
    joints: tuple[str, ...] = ()


def constraints_of(spec: mujoco.MjSpec) -> list[Constraint]:
    """Lists the constraints of a file that are switched on; weldings to a target that a user drags hold nothing.

    Raises:
        ValueError: If one names what is not there.
    """
    found = []
    known = {kind: {body.name for body in spec.bodies} for kind in _TO_BODIES}
    known[mujoco.mjtEq.mjEQ_JOINT] = {joint.name for joint in spec.joints}
    dragged = {body.name for body in spec.bodies if body.mocap}
    owners = {site.name: site.parent.name for site in spec.sites}
    moved = {tendon.name: tuple(wrap.target.name for wrap in tendon.path if wrap.target) for tendon in spec.tendons}
    for each in spec.equalities:
        first, second = each.name1, each.name2
        if each.type in _TO_BODIES:
            if each.objtype == mujoco.mjtObj.mjOBJ_SITE:
                first, second = owners.get(first, ""), owners.get(second, "")
            if dragged & {first, second}:
                continue
        joints = (*moved.get(first, ()), *moved.get(second, ())) if each.type == mujoco.mjtEq.mjEQ_TENDON else ()
        for name in filter(None, (first, second) if each.type in known else ()):
            if name not in known[each.type]:
                message = f"a constraint names `{name}`, which is not there"
                raise ValueError(message)
        if each.active:
            data = tuple(float(value) for value in each.data[:5])
            found.append(Constraint(each.type, each.name, first, second or "", data, joints))
    return found


def split(constraints: list[Constraint], compiled: mujoco.MjModel) -> tuple[list[Tie], list[Bond]]:
    """Returns the joints that follow others, and everything else that is tied.

    MuJoCo's law is `q - q_0 = a_0 + a_1 (p - p_0) + ...` for a joint's position q and its leader's p, with the
    references q_0 and p_0 of the file.
    """
    ties, bonds = [], []
    for each in constraints:
        if each.kind == mujoco.mjtEq.mjEQ_JOINT:
            own = _reference(compiled, each.first)
            other = _reference(compiled, each.second) if each.second else 0.0
            factor = each.data[1] if each.second else 0.0
            offset = own + each.data[0] - factor * other
            is_linear = not each.second or not np.any(each.data[2:])
            ties.append(Tie(each.first, each.second or None, factor, offset, is_linear))
        elif each.kind in _TO_BODIES:
            what = f"`{_TO_BODIES[each.kind]}` {each.name}".rstrip()
            bonds.append(Bond(what, bodies=(each.first, each.second or "world")))
        elif each.joints:
            bonds.append(Bond(f"equality of tendons {each.name}".rstrip(), joints=each.joints))
    return ties, bonds


def _reference(compiled: mujoco.MjModel, joint: str) -> float:
    return float(compiled.qpos0[compiled.joint(joint).qposadr[0]])


def led_by(ties: Collection[Tie], driven: Collection[str]) -> tuple[Tie, ...]:
    """Turns ties round whose follower is driven and whose leader is not: a file may name the two in either order."""
    followers = {tie.follower for tie in ties}
    turned = []
    for tie in ties:
        leads = tie.leader is not None and tie.leader not in driven and tie.leader not in followers
        if tie.leader is not None and leads and tie.follower in driven and tie.is_linear and tie.factor:
            tie = Tie(tie.leader, tie.follower, 1 / tie.factor, -tie.offset / tie.factor, is_linear=True)
        turned.append(tie)
    return tuple(turned)


def follow(ties: Collection[Tie], held: Mapping[str, float]) -> dict[str, float]:
    """Returns the positions of the joints that do not move, with those that follow them [rad, or m]."""
    positions = dict(held)
    for _ in ties:
        for tie in ties:
            if tie.follower in positions or not tie.is_linear:
                continue
            if tie.leader is None:
                positions[tie.follower] = tie.offset
            elif tie.leader in positions:
                positions[tie.follower] = tie.offset + tie.factor * positions[tie.leader]
    return positions
