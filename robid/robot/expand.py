"""How the linearised robot moves with its rest position and with the locations of its springs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypedDict

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.robot.description import Robot
from robid.robot.linearize import Equilibrium, LinearModel, Shifts, gravity_torque, linearize
from robid.robot.model import ElasticModel, build_model
from robid.robot.rest import Moves

_STEP_RAD = 1e-3
_STEP_M = 1e-3


def expand(
    model: ElasticModel,
    equilibrium: Equilibrium,
    linear: LinearModel,
    output_names: tuple[str, ...],
    located: IntArray | None = None,
) -> LinearModel:
    """Adds to a linearised robot how its matrices move to first order.

    Args:
        model: The elastic model.
        equilibrium: Where it was linearised.
        linear: The result.
        output_names: Its outputs.
        located (n_location,): Elements of the flattened locations that may move; none by default.

    Returns:
        The same with `rest.moves`, by central differences in MuJoCo.
    """
    chosen = np.zeros(0, int) if located is None else located
    n_motor = len(model.motor)
    to_rest = model.to_spring[:, n_motor:]
    pairs = []
    for index in range(to_rest.shape[1]):
        sides = [
            replace(equilibrium, position=equilibrium.position + step * to_rest[:, index]) for step in _sides(_STEP_RAD)
        ]
        pairs.append([linearize(model, side, output_names) for side in sides])
    torques = []
    for element in chosen.tolist():
        models = [build_model(moved_spring(model.robot, element, step)) for step in _sides(_STEP_M)]
        pairs.append([linearize(each, equilibrium, output_names) for each in models])
        behind, ahead = (gravity_torque(each, equilibrium.position) @ to_rest for each in models)
        torques.append((ahead - behind) / (2 * _STEP_M))
    width = np.array([_STEP_RAD] * to_rest.shape[1] + [_STEP_M] * chosen.size) * 2
    moves = Moves(
        **_slopes(pairs, width),
        torque=np.reshape(np.array(torques), (chosen.size, *equilibrium.deflection.shape)).swapaxes(0, 1),
        located=chosen,
    )
    return replace(linear, rest=replace(linear.rest, moves=moves))


def shifts_between(
    pairs: Sequence[tuple[LinearModel, LinearModel]], width: FloatArray, amounts: FloatArray, torque: FloatArray
) -> Shifts:
    """Returns how a linearised robot moves with doubts, by central differences.

    Args:
        pairs: The robot with less and with more of each doubt.
        width (n_doubt,): By how much each pair differs.
        amounts (n_doubt,): Amounts in the middle.
        torque (n_doubt, n_joint): As in `Shifts`.
    """
    return Shifts(amounts=amounts, torque=torque, **_slopes(pairs, width))


def moved_spring(robot: Robot, element: int, by_m: float) -> Robot:
    """Returns the robot with one element of its springs' flattened locations moved."""
    spring = robot.springs[element // 3]
    point = spring.point_m + by_m * np.eye(3)[element % 3]
    return with_springs_at(robot, {spring.name: point})


def with_springs_at(robot: Robot, points: dict[str, FloatArray]) -> Robot:
    """Returns the robot with some springs elsewhere, by their names."""
    springs = tuple(replace(spring, point_m=points.get(spring.name, spring.point_m)) for spring in robot.springs)
    return replace(robot, springs=springs)


def _sides(step: float) -> tuple[float, float]:
    return -step, step


class _Slopes(TypedDict):
    mass: FloatArray
    gravity_stiffness: FloatArray
    output: FloatArray
    tilt: FloatArray


def _slopes(pairs: Sequence[Sequence[LinearModel]], width: FloatArray) -> _Slopes:
    return _Slopes(
        mass=_differences([[_whole_mass(side) for side in pair] for pair in pairs], width),
        gravity_stiffness=_differences([[side.gravity_stiffness for side in pair] for pair in pairs], width),
        output=_differences([[side.output for side in pair] for pair in pairs], width),
        tilt=_differences([[side.tilt for side in pair] for pair in pairs], width),
    )


def _whole_mass(linear: LinearModel) -> FloatArray:
    return np.asarray(linear.mass + np.einsum("l,clij->cij", linear.axial, linear.link_inertia))


def _differences(pairs: list[list[FloatArray]], width: FloatArray) -> FloatArray:
    """Central differences (n_conf, n_move, ...)."""
    slopes = [(ahead - behind) / wide for (behind, ahead), wide in zip(pairs, width.tolist(), strict=True)]
    return np.stack(slopes, axis=1)
