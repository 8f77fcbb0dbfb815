"""Where the arm was while it was recorded: enough of it to know the motion again."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.models.rigid.fit.shots import Shot
from robid.models.rigid.fit.solution import Travel
from robid.robot.description import Robot

_MOMENTS = 64  # of each shot
_SAME = 0.02  # of a joint's range of motion
_ENOUGH = 0.5  # of the moments, and of each joint's range among them


def travel_of(robot: Robot, shots: Sequence[Shot]) -> Travel:
    """Returns where the arm of a robot was during some shots, at moments evenly spread over each."""
    turns = robot.arm_per_motor.T
    index = [np.linspace(0, len(shot.position) - 1, _MOMENTS).round().astype(int) for shot in shots]
    extremes = np.array([[_extremes(shot.position @ joint) for joint in turns.T] for shot in shots])
    return Travel(
        shot=np.repeat(np.arange(len(shots)), _MOMENTS),
        time_s=np.concatenate([own * shot.sampling_period_s for own, shot in zip(index, shots, strict=True)]),
        position=np.concatenate([shot.position[own] @ turns for own, shot in zip(index, shots, strict=True)]),
        lowest=extremes[..., 0].min(axis=0),
        highest=extremes[..., 1].max(axis=0),
        lower_limit=robot.lower,
        upper_limit=robot.upper,
    )


def _extremes(course: FloatArray) -> tuple[float, float]:
    return float(course.min()), float(course.max())


def repeats(travel: Travel, robot: Robot, shot: Shot) -> bool:
    """Whether a shot moves the arm as one of those did before, sooner or later in its course.

    At some delay, half of the moments of the earlier shot, or of those that a shorter one has room for, lie in the shot
    with all positions within 2 % of the range, and half of the earlier shot's range of motion among them.
    """
    position = shot.position @ robot.arm_per_motor.T
    reach = np.maximum(travel.highest - travel.lowest, 1e-12)
    for one in np.unique(travel.shot):
        own = travel.shot == one
        steps = np.round((travel.time_s[own] - travel.time_s[own][0]) / shot.sampling_period_s).astype(int)
        if _found(travel.position[own] / reach, steps, position / reach):
            return True
    return False


def _found(moments: FloatArray, steps: IntArray, course: FloatArray) -> bool:
    """Whether moments (n_moment, n_joint), so many steps after each other, are in a course (n_sample, n_joint)."""
    n_sample = len(course)
    delay = np.arange(-steps[-1], n_sample)
    first, last = np.searchsorted(steps, -delay), np.searchsorted(steps, n_sample - delay)
    possible = last - first >= _ENOUGH * np.count_nonzero(steps < n_sample)
    delay, first, last = delay[possible], first[possible], last[possible]
    for index, (moment, step) in enumerate(zip(moments, steps, strict=True)):
        inside = (first <= index) & (index < last)
        there = course[np.clip(step + delay, 0, n_sample - 1)]
        near = ~inside | (np.abs(there - moment).max(axis=1) < _SAME)
        delay, first, last = delay[near], first[near], last[near]
    wanted = _ENOUGH * np.ptp(moments, axis=0)
    spans = (np.ptp(moments[one:other], axis=0) for one, other in zip(first, last, strict=True))
    return any(np.all(span >= wanted) for span in spans)
