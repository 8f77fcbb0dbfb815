"""Angles that count against another joint's: a log whose axis is the sum of two, or a gear that is not coupled."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from robid.arrays import FloatArray
from robid.models.rigid.fit.options import RigidFitOptions
from robid.models.rigid.fit.shots import Shot
from robid.models.rigid.judge.scales import solved, thinned
from robid.results.doubt import Doubt, two_digits
from robid.robot.description import Robot
from robid.robot.regressor.base import find_base_parameters
from robid.robot.regressor.model import RigidModel, build_rigid_model

_UNEXPLAINED = 0.15
_BETTER = 0.4
_CLEARLY = 0.7  # of what the next best leaves


def sum_doubts(robot: Robot, shots: Sequence[Shot], options: RigidFitOptions) -> tuple[Doubt, ...]:
    """Names an angle that looks like the sum or the difference of two joints', at most one.

    Controllers show some axes against the horizontal, though their motors turn them against the link before. Where
    the torques are badly explained, they are explained again with each angle less or plus each other.

    Args:
        robot: The robot file's.
        shots: What was recorded, motor side.
        options: Options of the fit.
    """
    if len(robot.joints) < 2:
        return ()
    try:
        rows = thinned(shots, options)
    except ValueError:
        return ()
    before = _unexplained(_base_model(robot, options), rows)
    if before < _UNEXPLAINED:
        return ()
    free = replace(robot, joints=tuple(replace(joint, couplings={}) for joint in robot.joints))
    model = _base_model(free, options)
    tried = [
        (_unexplained(model, changed), joint, other, sign) for changed, joint, other, sign in _changed(robot, rows)
    ]
    tried.sort(key=lambda one: one[0])
    (share, joint, other, sign), following = tried[0], [each for each in tried[1:] if each[1] != tried[0][1]]
    if share > _BETTER * before or any(share > _CLEARLY * each[0] for each in following):
        return ()
    told = f"the torques are explained to {_percent(share)} instead of {_percent(before)} "
    return (Doubt("gear_coupling", told + _what(robot, joint, other, sign), decisive=True, strength=before / share),)


def _base_model(robot: Robot, options: RigidFitOptions) -> RigidModel:
    model = build_rigid_model(robot, options.model)
    return model.only(find_base_parameters(model, options.base).columns.tolist())


def _changed(
    robot: Robot, rows: tuple[FloatArray, FloatArray, FloatArray, FloatArray]
) -> Iterator[tuple[tuple[FloatArray, ...], int, int, int]]:
    """Rows of a robot without couplings: each arm's motion less or plus each other's; the arms' own where none is."""
    *motions, torque = rows
    arms = [motion @ robot.arm_per_motor.T for motion in motions]
    coupled = any(joint.couplings for joint in robot.joints)
    if coupled:
        yield (*(arm * robot.gear_ratio for arm in arms), torque), -1, -1, 0
        return
    for (joint, other), sign in itertools.product(itertools.permutations(range(len(robot.joints)), 2), (1, -1)):
        other_way = np.eye(len(robot.joints))
        other_way[joint, other] = -sign
        yield (*(arm @ other_way.T * robot.gear_ratio for arm in arms), torque), joint, other, sign


def _unexplained(model: RigidModel, rows: tuple[FloatArray, ...]) -> float:
    """Share of the torques that no parameters explain."""
    position, velocity, acceleration, torque = rows
    columns = model.columns(position, velocity, acceleration, torque=torque if model.needs_torque else None)
    scale = np.maximum(torque.std(axis=0), 1e-300)
    left = (columns @ solved(columns / scale[:, None], torque / scale) - torque) / scale
    return float(np.linalg.norm(left) / np.linalg.norm((torque - torque.mean(axis=0)) / scale))


def _what(robot: Robot, joint: int, other: int, sign: int) -> str:
    names = [one.name for one in robot.joints]
    ratio = robot.gear_ratio
    if sign:
        weights = {(joint, other): -sign * ratio[joint] / ratio[other]}
        kind = "sum" if sign > 0 else "difference"
        told = f"if the angle of {names[joint]} is the {kind} of those of {names[joint]} and {names[other]}: "
    else:
        turns = (robot.arm_per_motor - np.diag(1 / ratio)) * ratio[:, None]
        weights = {(row, column): turns[row, column] for row, column in np.argwhere(turns).tolist()}
        listed = ", ".join(dict.fromkeys(names[row] for row, _ in weights))
        told = (
            f"if the motors of {listed} turn their own joints alone, and only their logged angles count others' too: "
            "leave `couplings` out of the robot file, and "
        )
    sums = [
        f"`<{names[row]}> {'+' if weight > 0 else '-'} {abs(weight):.6g}*<{names[column]}>`"
        for (row, column), weight in weights.items()
    ]
    listed = " and ".join(sums)
    return (
        f"{told}state as its `variable` {listed}, of the log's variables of the motors (weights of 1 where arms' are)"
    )


def _percent(share: float) -> str:
    return f"{two_digits(100 * share)} %"
