"""Springs in line with a gear: what lies about its axis, before it or behind it, acts with it as one spring."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

import numpy as np

from robid.arrays import FloatArray
from robid.robot.description import Robot, Spring

_PARALLEL = 0.99  # cosine from which two axes are parallel
_APART_M = 0.01  # up to which two parallel lines are one


def gears_in_line(robot: Robot, spring: Spring) -> tuple[str, ...]:
    """Names of the transmissions with which a spring lies in line: it turns about their line, whatever the joints do.

    A split link does so with its own joint's gear or the next one's, a base with the first one's, a bearing with its
    own joint's. What lies beyond a whole link is in line with nothing: its inertia tells the two apart.
    """
    here, upright = robot.joints[spring.joint], np.array([0.0, 0.0, 1.0])
    own = spring.joint, np.zeros(3), upright
    lines: list[tuple[int, FloatArray, FloatArray]] = []
    if spring.place == "base":
        lines = [(0, here.position_m, here.rotation @ upright)]
    elif spring.place in ("split", "bearing"):
        lines = [own]
    if spring.place == "split" and spring.joint + 1 < len(robot.joints):
        following = robot.joints[spring.joint + 1]
        lines.append((spring.joint + 1, following.position_m, following.rotation @ upright))
    point = np.zeros(3) if spring.place == "bearing" else spring.point_m
    joints = [joint for joint, start, axis in lines if _is_one_line(spring.axis, point - start, axis)]
    gears = (each for each in robot.springs if each.place == "transmission" and not robot.is_linear(each))
    return tuple(each.name for each in gears if each.joint in joints)


def with_chains(robot: Robot, known: Sequence[Spring]) -> tuple[Spring, ...]:
    """Returns the springs that are known of a robot, its gears as one with unknown springs in line with them.

    Args:
        robot: The robot.
        known: Springs that a model of it has, by name or, for others than gears, by place, joint and axis.
    """
    names = {spring.name for spring in known}
    own = [spring for spring in robot.springs if spring.name in names]
    unknown = [spring for spring in robot.springs if spring.name not in names and not _is_among(spring, known)]
    return tuple(_in_series(gear, tuple(_lying_with(robot, gear, unknown))) for gear in own)


def _lying_with(robot: Robot, gear: Spring, others: Collection[Spring]) -> Iterator[Spring]:
    if gear.place == "transmission":
        yield from (spring for spring in others if gear.name in gears_in_line(robot, spring))


def _in_series(gear: Spring, others: Sequence[Spring]) -> Spring:
    """A gear and what lies in line with it, as they act where nothing between them has weight, slowly."""
    # 1/(k + jwd) summed over the springs is 1/k_s - jw d_s/k_s^2 to first order in w: compliances add up, and so do
    # dampers over the squares of their stiffness.
    if not others:
        return gear
    every = (gear, *others)
    stiffness = 1 / sum(1 / each.stiffness for each in every)
    damping = stiffness**2 * sum(each.damping / each.stiffness**2 for each in every)
    # A cubic torque k3 x^3 acts on the gear's share of the deflection: both in series have k3 (k_s / k)^4.
    return replace(gear, stiffness=stiffness, damping=damping, cubic=gear.cubic * (stiffness / gear.stiffness) ** 4)


def _is_one_line(direction: FloatArray, between: FloatArray, axis: FloatArray) -> bool:
    parallel = abs(float(direction @ axis)) > _PARALLEL
    return parallel and float(np.linalg.norm(np.cross(between, axis))) < _APART_M


def _is_among(spring: Spring, known: Sequence[Spring]) -> bool:
    return any(
        (each.place, each.joint) == (spring.place, spring.joint) and abs(float(each.axis @ spring.axis)) > _PARALLEL
        for each in known
        if each.place != "transmission"
    )
