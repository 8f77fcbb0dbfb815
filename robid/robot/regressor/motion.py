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
        turn (3, n_reach, n_sample): Angular velocity per unit speed of each coordinate that can move it.
        shift (3, n_reach, n_sample): Velocity of the frame's origin per unit speed of each of these [m].
    """

    rate: FloatArray
    angular: FloatArray
    linear: FloatArray
    turn: FloatArray
    shift: FloatArray


def body_motions(
    tree: Tree, position: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> Iterator[BodyMotion]:
    """Yields the motion of each body of a tree.

    Args:
        tree: The tree.
        position (n_coordinate, n_sample): Independent coordinates [rad, or m].
        velocity (n_coordinate, n_sample): Their speeds.
        acceleration (n_coordinate, n_sample): Their accelerations.
    """
    own = [tree.turns @ position + tree.offset[:, None], tree.turns @ velocity, tree.turns @ acceleration]
    base = np.zeros((2, 3, _SCREWS, position.shape[1]))
    base[1, :, _ACCELERATION] = -tree.gravity_m_s2[:, None]
    states: list[FloatArray] = []
    for index, (body, reach) in enumerate(zip(tree.bodies, tree.reach, strict=True)):
        parent = states[body.parent] if body.parent >= 0 else base
        state = _carried(parent, body, reach)
        move = _slide if body.slides else _turn
        move(state, *(values[index] for values in own))
        screws = state[1 if body.slides else 0, 2, _SCREWS:]
        screws += tree.turns[index, :reach, None]
        states.append(state)
        yield BodyMotion(
            rate=state[0, :, _VELOCITY],
            angular=state[0, :, _ACCELERATION],
            linear=state[1, :, _ACCELERATION],
            turn=state[0, :, _SCREWS:],
            shift=state[1, :, _SCREWS:],
        )


def _carried(parent: FloatArray, body: Body, reach: int) -> FloatArray:
    """Motion (2, 3, 2 + n_reach, n_sample) of the parent where the body's frame is at zero, in that frame.

    The first axis is angular and linear; the third has velocity, acceleration and the screws of the coordinates.
    """
    size = parent.shape[2]
    state = np.zeros((2, 3, _SCREWS + reach, parent.shape[3]))
    lever = -body.rotation.T @ cross_matrix(body.position_m)
    flat = parent.reshape(2, 3, -1)
    turned = body.rotation.T @ flat
    if body.position_m.any():
        turned[1] += lever @ flat[0]
    state[:, :, :size] = turned.reshape(parent.shape)
    if body.position_m.any():
        offset = body.rotation.T @ body.position_m
        rate = state[0, :, _VELOCITY]
        state[1, :, _ACCELERATION] += rate * (offset @ rate) - offset[:, None] * (rate * rate).sum(axis=0)
    return state


def _turn(state: FloatArray, angle: FloatArray, speed: FloatArray, acceleration: FloatArray) -> None:
    """Turns a motion (2, 3, n, n_sample) in place by a joint's motion about z."""
    cosine, sine = np.cos(angle), np.sin(angle)
    x, y = state[:, 0], state[:, 1]
    turned = cosine * x
    turned += sine * y
    y *= cosine
    y -= sine * x
    x[...] = turned
    rate, angular = state[0, :, _VELOCITY], state[0, :, _ACCELERATION]
    angular[0] += rate[1] * speed
    angular[1] -= rate[0] * speed
    angular[2] += acceleration
    rate[2] += speed


def _slide(state: FloatArray, travel: FloatArray, speed: FloatArray, acceleration: FloatArray) -> None:
    """Shifts a motion (2, 3, n, n_sample) in place by a joint's motion along z."""
    state[1, 0] += travel * state[0, 1]
    state[1, 1] -= travel * state[0, 0]
    rate, linear = state[0, :, _VELOCITY], state[1, :, _ACCELERATION]
    linear[0] += travel * rate[0] * rate[2] + 2 * speed * rate[1]
    linear[1] += travel * rate[1] * rate[2] - 2 * speed * rate[0]
    linear[2] += acceleration - travel * (rate[0] ** 2 + rate[1] ** 2)


def cross_matrix(vector: FloatArray) -> FloatArray:
    """Returns the matrix (3, 3) of the cross product from the left."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
