"""The recursion over a tree: motion of its bodies, and how each coordinate moves them; samples along the last axis."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.robot.regressor.tree import Body, Tree

_VELOCITY, _ACCELERATION, _SCREWS = 0, 1, 2


@dataclass(frozen=True)
class BodyMotion:
    """Motion of a body in its own frame.

    Attributes:
        rate (3, n_sample): Angular velocity [rad/s].
        angular (3, n_sample): Angular acceleration [rad/s^2].
        linear (3, n_sample): Acceleration of the frame's origin less gravity [m/s^2].
        turn (n_reach, 3, n_sample): Angular velocity per unit speed of each coordinate that can move it.
        shift (n_reach, 3, n_sample): Velocity of the frame's origin per unit speed of each of these [m].
    """

    rate: FloatArray
    angular: FloatArray
    linear: FloatArray
    turn: FloatArray
    shift: FloatArray


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
    base[_ACCELERATION, 1] = -tree.gravity_m_s2[:, None]
    for index, (body, state) in enumerate(zip(tree.bodies, states, strict=True)):
        _carry(states[body.parent] if body.parent >= 0 else base, body, state)
        move = _slide if body.slides else _turn
        move(state, *(values[index] for values in own))
        reach = len(state) - _SCREWS
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
        state[:size, 1] -= (turned @ cross_matrix(body.position_m)) @ parent[:, 0]
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
    angular[0] += rate[1] * speed
    angular[1] -= rate[0] * speed
    angular[2] += acceleration
    rate[2] += speed


def _slide(state: FloatArray, travel: FloatArray, speed: FloatArray, acceleration: FloatArray) -> None:
    """Shifts a motion in place by a joint's motion along z."""
    state[:, 1, 0] += travel * state[:, 0, 1]
    state[:, 1, 1] -= travel * state[:, 0, 0]
    rate, linear = state[_VELOCITY, 0], state[_ACCELERATION, 1]
    linear[0] += travel * rate[0] * rate[2] + 2 * speed * rate[1]
    linear[1] += travel * rate[1] * rate[2] - 2 * speed * rate[0]
    linear[2] += acceleration - travel * (rate[0] ** 2 + rate[1] ** 2)


def cross_matrix(vector: FloatArray) -> FloatArray:
    """Returns the matrix (3, 3) of the cross product from the left."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
