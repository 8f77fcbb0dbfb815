"""Bodies of a rigid robot.

The tree that they form, their motion, and the regressor columns of their standard parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from robid.arrays import FloatArray
from robid.robot.description import Inertial, LoopLink, Robot
from robid.robot.inertia import about_origin, turned_about_z

Side = Literal["motor", "arm"]
PAYLOAD = "payload"  # Name of the payload as a body of its own


@dataclass(frozen=True)
class Body:
    """A body about or along the z axis of whose frame it moves."""

    name: str  # Name of its joint, loop link or motor, or `payload`
    parent: int  # Index of the body that carries it, -1 for the base
    position_m: FloatArray  # (3,) Origin of its frame in the parent's frame [m]
    rotation: FloatArray  # (3, 3) Orientation of its frame in the parent's frame at zero position
    slides: bool = False
    is_rotor: bool = False
    is_payload: bool = False  # Whether it is the payload as a body of its own


@dataclass(frozen=True)
class Tree:
    """Bodies, each after its parent, and how independent coordinates move them."""

    # The links of the joints, loop links, rotors that ride on links, and the payload where it is a body of its own
    bodies: tuple[Body, ...]
    # (n_body, n_coordinate) Position of each body per unit of each independent coordinate; constant, as parallelograms
    # keep sums of angles
    turns: FloatArray
    offset: FloatArray  # (n_body,) Position of each body where the coordinates are zero
    gravity_m_s2: FloatArray  # (3,) Gravity in the base frame [m/s^2]

    @property
    def reach(self) -> tuple[int, ...]:
        """How many of the coordinates, from the first on, can move each body or what carries it."""
        found: list[int] = []
        for body, row in zip(self.bodies, self.turns, strict=True):
            own = np.flatnonzero(row)
            last = int(own[-1]) + 1 if own.size else 0
            found.append(max(last, found[body.parent] if body.parent >= 0 else 0))
        return tuple(found)


def rigid_tree(robot: Robot, side: Side = "motor", *, rotors: bool = True, payload: bool = False) -> Tree:
    """Returns a robot's tree of rigid bodies.

    Args:
        robot: The robot; its springs are taken as rigid.
        side: Coordinates: motor angles, or arm positions of the joints.
        rotors: Whether rotors that ride on links are among the bodies, on the motor side; they turn with their motors.
        payload: Whether the payload is a body of its own.

    Source:
        Janot et al. (2009), the branch of the interface: independent coordinates and the loop's Jacobian.
    """
    n_joint = len(robot.joints)
    bodies = [
        Body(joint.name, index - 1, joint.position_m, joint.rotation, slides=joint.type == "prismatic")
        for index, joint in enumerate(robot.joints)
    ]
    names = [joint.name for joint in robot.joints]
    turns, offset = [*np.eye(n_joint)], [0.0] * n_joint
    for link in robot.loop_links:
        bodies.append(Body(link.name, _parent(link, bodies), link.position_m, link.rotation))
        turns.append(np.array([link.turns.get(name, 0.0) for name in names]))
        offset.append(link.offset_rad)
    moves = np.array(turns) if side == "arm" else np.array(turns) @ robot.arm_per_motor
    if rotors and side == "motor" and robot.rotor == "on_link":
        driven = [index for index, joint in enumerate(robot.joints) if joint.has_motor]
        for index in driven:
            joint = robot.joints[index]
            bodies.append(Body(joint.name, index - 1, joint.position_m, joint.rotation, is_rotor=True))
        moves = np.vstack([moves, np.eye(n_joint)[driven]])
    if payload:
        bodies.append(Body(PAYLOAD, n_joint - 1, np.zeros(3), np.eye(3), is_payload=True))
        moves = np.vstack([moves, np.zeros(n_joint)])
    still = np.zeros(len(bodies) - len(offset))
    return Tree(tuple(bodies), moves, np.concatenate([offset, still]), robot.gravity_m_s2)


def _parent(link: LoopLink, bodies: list[Body]) -> int:
    return -1 if link.parent is None else [body.name for body in bodies].index(link.parent)


def pin_gaps(robot: Robot, positions: FloatArray) -> FloatArray:
    """Distances (n_sample, n_pin) of pinned loop links from where they are held, in the links' order [m].

    Args:
        robot: The robot.
        positions (n_sample, n_joint): Arm positions of the joints [rad, or m].
    """
    tree = rigid_tree(robot, "arm")
    origins, turns = _poses(tree, positions)
    gaps = []
    for index, link in enumerate(robot.loop_links, start=len(robot.joints)):
        if link.pin is not None:
            here = origins[index] + turns[index] @ link.pin.point_m
            there = origins[link.pin.joint] + turns[link.pin.joint] @ link.pin.held_point_m
            gaps.append(np.linalg.norm(here - there, axis=-1))
    return np.array(gaps).reshape(-1, len(positions)).T


def _poses(tree: Tree, positions: FloatArray) -> tuple[list[FloatArray], list[FloatArray]]:
    """Origins (n_sample, 3) and orientations (n_sample, 3, 3) of all bodies in the base frame."""
    own = positions @ tree.turns.T + tree.offset
    origins: list[FloatArray] = []
    turns: list[FloatArray] = []
    for index, body in enumerate(tree.bodies):
        is_first = body.parent < 0
        origin = np.zeros((len(positions), 3)) if is_first else origins[body.parent]
        carried = np.eye(3) if is_first else turns[body.parent]
        frame = np.broadcast_to(carried @ body.rotation, (len(positions), 3, 3))
        origin = origin + carried @ body.position_m
        if body.slides:
            origins.append(origin + frame[:, :, 2] * own[:, index, None])
            turns.append(frame)
        else:
            origins.append(origin)
            turns.append(turned_about_z(frame, own[:, index]))
    return origins, turns


_VELOCITY, _ACCELERATION, _SCREWS = 0, 1, 2


@dataclass(frozen=True)
class BodyMotion:
    """Motion of a body in its own frame."""

    rate: FloatArray  # (3, n_sample) Angular velocity [rad/s]
    angular: FloatArray  # (3, n_sample) Angular acceleration [rad/s^2]
    linear: FloatArray  # (3, n_sample) Acceleration of the frame's origin less gravity [m/s^2]
    turn: FloatArray  # (n_reach, 3, n_sample) Angular velocity per unit speed of each coordinate that can move it
    shift: FloatArray  # (n_reach, 3, n_sample) Velocity of the frame's origin per unit speed of each of these [m]


def body_motions(
    tree: Tree, position: FloatArray, velocity: FloatArray, acceleration: FloatArray, states: list[FloatArray]
) -> Iterator[BodyMotion]:
    """Yields the motion of each body of a tree.

    Args:
        tree: The tree.
        position (n_coordinate, n_sample): Independent coordinates [rad, or m].
        velocity (n_coordinate, n_sample): Their speeds.
        acceleration (n_coordinate, n_sample): Their accelerations.
        states: What `empty_states` returns for as many samples; it is overwritten.
    """
    own = [tree.turns @ position + tree.offset[:, None], tree.turns @ velocity, tree.turns @ acceleration]
    base = np.zeros((_SCREWS, 2, 3, position.shape[1]))
    # Gravity as an acceleration of the base upwards: every body then feels its weight.
    base[_ACCELERATION, 1] = -tree.gravity_m_s2[:, None]
    for index, (body, state) in enumerate(zip(tree.bodies, states, strict=True)):
        _carry(states[body.parent] if body.parent >= 0 else base, body, state)
        move = _slide if body.slides else _turn
        move(state, *(values[index] for values in own))
        reach = len(state) - _SCREWS
        # The body's own joint adds to the screw of every coordinate that moves it.
        state[_SCREWS:, 1 if body.slides else 0, 2] += tree.turns[index, :reach, None]
        yield BodyMotion(
            rate=state[_VELOCITY, 0],
            angular=state[_ACCELERATION, 0],
            linear=state[_ACCELERATION, 1],
            turn=state[_SCREWS:, 0],
            shift=state[_SCREWS:, 1],
        )


def empty_states(tree: Tree, n_sample: int) -> list[FloatArray]:
    """Returns room for the motion of each body, (2 + n_reach, 2, 3, n_sample).

    The first axis is velocity, acceleration and the screw of each coordinate that can move the body, the second is
    angular and linear. What the velocity has there as linear part is not used.
    """
    return [np.empty((_SCREWS + reach, 2, 3, n_sample)) for reach in tree.reach]


def _carry(parent: FloatArray, body: Body, state: FloatArray) -> None:
    """Writes the motion of the parent at the origin of a body's frame, in that frame at zero position."""
    size, turned = len(parent), body.rotation.T
    np.matmul(turned, parent, out=state[:size])
    state[size:] = 0.0
    if body.position_m.any():
        # v_o = v_p + w x r, for velocities, accelerations and screws alike.
        state[:size, 1] -= (turned @ cross_matrix(body.position_m)) @ parent[:, 0]
        # Centripetal part of the origin's acceleration: w x (w x r) = w (w . r) - r w^2.
        offset, rate = turned @ body.position_m, state[_VELOCITY, 0]
        state[_ACCELERATION, 1] += rate * (offset @ rate) - offset[:, None] * (rate * rate).sum(axis=0)


def _turn(state: FloatArray, angle: FloatArray, speed: FloatArray, acceleration: FloatArray) -> None:
    """Turns a motion in place by a joint's motion about z."""
    cosine, sine = np.cos(angle), np.sin(angle)
    x, y = state[:, :, 0], state[:, :, 1]
    turned = cosine * x
    turned += sine * y
    y *= cosine
    x *= sine
    y -= x
    x[...] = turned
    rate, angular = state[_VELOCITY, 0], state[_ACCELERATION, 0]
    # w_parent x z q': the frame turns while its parent does.
    angular[0] += rate[1] * speed
    angular[1] -= rate[0] * speed
    angular[2] += acceleration
    rate[2] += speed


def _slide(state: FloatArray, travel: FloatArray, speed: FloatArray, acceleration: FloatArray) -> None:
    """Shifts a motion in place by a joint's motion along z."""
    state[:, 1, 0] += travel * state[:, 0, 1]
    state[:, 1, 1] -= travel * state[:, 0, 0]
    rate, linear = state[_VELOCITY, 0], state[_ACCELERATION, 1]
    # Along a slide that moves: Coriolis 2 w x v and centripetal w x (w x r) with r = (0, 0, travel).
    linear[0] += travel * rate[0] * rate[2] + 2 * speed * rate[1]
    linear[1] += travel * rate[1] * rate[2] - 2 * speed * rate[0]
    linear[2] += acceleration - travel * (rate[0] ** 2 + rate[1] ** 2)


def cross_matrix(vector: FloatArray) -> FloatArray:
    """Returns the matrix (3, 3) of the cross product from the left."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


COMPONENTS = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")
"""Standard parameters of a link: entries of its inertia about the frame's origin, first moments, mass."""
INERTIAS, MOMENTS = COMPONENTS[:6], COMPONENTS[6:9]
ROTOR = np.array([0.5, 0.0, 0.0, 0.5, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
"""Standard parameters of a rotor per its inertia about the axis: a thin disc, weightless."""
_BLOCK = 3000  # samples whose arrays stay in the cache; a power of two would map rows onto each other there
_N_INERTIA, _N_TURNED = 6, 9


def standard_parameters(body: Inertial) -> FloatArray:
    """Returns a body's standard parameters (10,) in the order of `COMPONENTS` [kg m^2, kg m, kg]."""
    inertia = about_origin(body)
    return np.concatenate([inertia[np.triu_indices(3)], body.mass_kg * body.com_m, [body.mass_kg]])


def add_inertial_columns(
    tree: Tree,
    position: FloatArray,
    velocity: FloatArray,
    acceleration: FloatArray,
    wanted: Sequence[Sequence[int]],
    out: FloatArray,
) -> None:
    """Writes the columns of a tree's bodies.

    Args:
        tree: The tree.
        position (n_coordinate, n_sample): Independent coordinates [rad, or m].
        velocity (n_coordinate, n_sample): Their speeds.
        acceleration (n_coordinate, n_sample): Their accelerations.
        wanted: For each body which of `COMPONENTS` are wanted, ascending; for a rotor that rides on a link its one
            column, 0, or none.
        out (n_coordinate, n_column, n_sample): Zeros, which the wanted columns replace one body after the other.

    Source:
        Janot et al. (2009), eq. 2; Newton and Euler about each frame's origin, projected on each coordinate's screw.
    """
    if not any(wanted):
        return
    states: list[FloatArray] = []
    for start in range(0, position.shape[1], _BLOCK):
        block = slice(start, start + _BLOCK)
        n_sample = position[:, block].shape[1]
        if not states or states[0].shape[-1] != n_sample:
            states = empty_states(tree, n_sample)
        motions = body_motions(tree, position[:, block], velocity[:, block], acceleration[:, block], states)
        column = 0
        for body, chosen, motion in zip(tree.bodies, wanted, motions, strict=True):
            columns = out[: len(motion.turn), column : column + len(chosen), block]
            if chosen and body.is_rotor:
                columns[:, 0] = _rotor_column(motion)
            elif chosen:
                _write_link(motion, chosen, columns)
            column += len(chosen)


def _write_link(motion: BodyMotion, chosen: Sequence[int], out: FloatArray) -> None:
    """Writes a link's chosen columns (n_reach, n_chosen, n_sample)."""
    turned = [component for component in chosen if component < _N_TURNED]
    shifted = [component - _N_INERTIA for component in chosen if component >= _N_INERTIA]
    if turned:
        # Torque on each coordinate: its screw times moment and force (virtual power).
        np.einsum("kcn,fcn->kfn", motion.turn, _moments(motion, turned), out=out[:, : len(turned)])
    if shifted:
        out[:, len(chosen) - len(shifted) :] += np.einsum("kcn,fcn->kfn", motion.shift, _forces(motion, shifted))


def _moments(motion: BodyMotion, chosen: Sequence[int]) -> FloatArray:
    """Torque (n_chosen, 3, n_sample) about the origin per unit of each inertia and first moment."""
    (x, y, z), (ax, ay, az), (lx, ly, lz) = motion.rate, motion.angular, motion.linear
    # Newton and Euler about the origin, linear in each inertia: I a + w x (I w); first moments add m c x a_o.
    yz, xz, xy = y * z, x * z, x * y
    xx, yy, zz = motion.rate**2
    zero = np.zeros_like(x)
    # Deferred, so that only what is chosen is computed.
    rows: tuple[Callable[[], tuple[FloatArray, ...]], ...] = (
        lambda: (ax, xz, -xy),
        lambda: (ay - xz, ax + yz, xx - yy),
        lambda: (az + xy, zz - xx, ax - yz),
        lambda: (-yz, ay, xy),
        lambda: (yy - zz, az - xy, ay + xz),
        lambda: (yz, -xz, az),
        lambda: (zero, -lz, ly),
        lambda: (lz, zero, -lx),
        lambda: (-ly, lx, zero),
    )
    return np.array([rows[component]() for component in chosen])


def _forces(motion: BodyMotion, chosen: Sequence[int]) -> FloatArray:
    """Force (n_chosen, 3, n_sample) per unit of each first moment and of the mass."""
    (x, y, z), (ax, ay, az) = motion.rate, motion.angular
    # Force on first moments is a x c + w x (w x c), on the mass the acceleration of the origin.
    yz, xz, xy = y * z, x * z, x * y
    xx, yy, zz = motion.rate**2
    rows: tuple[Callable[[], Sequence[FloatArray]], ...] = (
        lambda: (-yy - zz, xy + az, xz - ay),
        lambda: (xy - az, -xx - zz, yz + ax),
        lambda: (xz + ay, yz - ax, -xx - yy),
        lambda: tuple(motion.linear),
    )
    return np.array([rows[component]() for component in chosen])


def _rotor_column(motion: BodyMotion) -> FloatArray:
    """Torque (n_reach, n_sample) per unit of a disc's inertia about its axis."""
    (x, y, z), (ax, ay, az) = motion.rate, motion.angular
    xx, yy, zz = ROTOR[[0, 3, 5]]
    # Euler's equations of a disc about its own axes.
    moment = np.array([xx * ax + (zz - yy) * y * z, yy * ay + (xx - zz) * x * z, zz * az + (yy - xx) * x * y])
    return np.asarray(np.einsum("kcn,cn->kn", motion.turn, moment))
