"""Motors that turn nearly the same combination of joints: a sign or a number of their couplings is wrong."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robid.arrays import FloatArray
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath

_LEAST_SINGULAR_VALUE = 0.1
_SHARE = 0.2
_N_SCALING = 20


def check_independence(robot: RobotFile) -> Iterator[tuple[FieldPath, str]]:
    """Yields the motors that cannot move their joints apart from each other."""
    turns = _arm_per_motor(robot)
    if turns is None:
        return
    names = [joint.name for joint in robot.joints]
    for group in _blocks(turns):
        part = _balanced(turns[np.ix_(group, group)])
        _, values, right = np.linalg.svd(part)
        if values[-1] >= _LEAST_SINGULAR_VALUE * values[0]:
            continue
        alike = np.flatnonzero(np.abs(right[-1]) > _SHARE * np.abs(right[-1]).max())
        index = next(group[i] for i in alike if robot.joints[group[i]].couplings)
        motors = " and ".join(f"`{names[group[i]]}`" for i in alike)
        told = (
            f"the motors of {motors} turn the same combination of joints, or nearly so, and nothing moves these apart:"
            " look at the signs of `couplings` and `gear_ratio` (of a differential, q_1 = m_1 + m_2, q_2 = m_1 - m_2)"
        )
        yield ("joints", index, "couplings"), told


def _arm_per_motor(robot: RobotFile) -> FloatArray | None:
    """Returns arm motion per motor angle (n_joint, n_joint); None without couplings, or where a value is wrong."""
    names = [joint.name for joint in robot.joints]
    # A joint without a motor, whose torque is measured behind the gear, moves as it is.
    ratios = [1.0 if not one.has_motor else None if one.motor is None else one.motor.ratio for one in robot.joints]
    if not all(ratios) or not any(joint.couplings for joint in robot.joints) or len(set(names)) < len(names):
        return None
    turns = np.diag([1 / ratio for ratio in ratios if ratio])
    for row, joint in enumerate(robot.joints):
        for name, turn in joint.couplings.items():
            if name not in names or name == joint.name:
                return None
            turns[row, names.index(name)] = turn
    return turns


def _blocks(turns: FloatArray) -> list[list[int]]:
    """Returns the groups of two and more joints whose motors turn each other along, both ways or around."""
    reach = turns != 0
    for _ in range(len(turns)):
        reach = reach | (reach.astype(int) @ reach.astype(int) > 0)
    groups = {tuple(np.flatnonzero(reach[i] & reach[:, i]).tolist()) for i in range(len(turns))}
    return [list(group) for group in sorted(groups) if len(group) > 1]


def _balanced(turns: FloatArray) -> FloatArray:
    """Scales rows and columns to a common size, so that neither units nor gear ratios count."""
    scaled = turns.copy()
    for _ in range(_N_SCALING):
        scaled = scaled / np.sqrt(np.linalg.norm(scaled, axis=1))[:, None]
        scaled = scaled / np.sqrt(np.linalg.norm(scaled, axis=0))
    return scaled
