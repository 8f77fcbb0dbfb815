"""Gear ratios that a robot file may have wrong, tried one by one: far off, they are beyond a first order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.models.elastic.fit.doubts.extension import problem_at
from robid.models.elastic.fit.optimizers import optimise
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.candidates import gear_ratio, with_gear_ratio
from robid.models.elastic.judge.fitted import FittedModel
from robid.models.elastic.judge.scores import gain, score
from robid.robot.description import Robot

_ROUNDS, _STEPS, _LAST_STEPS = 4, 4, 25
_ARRIVED = 1e-3
_LONGEST = 0.15  # of the ratio, in a round
_KEPT = 2
_ENOUGH = 0.9  # of the cost, so that no other joint needs to be tried


@dataclass(frozen=True)
class RatioTrial:
    """What another gear ratio does to a fit.

    Attributes:
        joint: Index of the joint.
        ratio: The ratio that explains most.
        share: Share of the residual's cost that it takes away.
        moved (n_param,): How far it moves the internal parameters.
    """

    joint: int
    ratio: float
    share: float
    moved: FloatArray


def try_ratios(robot: Robot, fitted: FittedModel, options: ElasticOptions, likely: Sequence[int]) -> list[RatioTrial]:
    """Tries other gear ratios, the most telling first.

    Each round moves a ratio by what the score test says, and lets the fit follow for some steps.

    Args:
        robot: The robot file that the fit started from, with its campaign's payload.
        fitted: The fitted model in the configurations of the fit's own response.
        options: Options of the fit.
        likely: Joints, those first that explain most to first order.
    """
    found: list[RatioTrial] = []
    for joint in likely[:_KEPT]:
        trial = _try(robot, fitted, options, joint)
        found += [] if trial is None else [trial]
        if trial is not None and trial.share > _ENOUGH:
            break
    return sorted(found, key=lambda trial: -trial.share)


def _try(robot: Robot, fitted: FittedModel, options: ElasticOptions, joint: int) -> RatioTrial | None:
    stated = abs(robot.joints[joint].motor.gear_ratio)
    before = cost = fitted.problem.cost(fitted.internal)
    now, moving = fitted, robot
    for _ in range(_ROUNDS):
        try:
            scores = score(moving, now, options, (gear_ratio(moving, joint),))
            amount = float(np.clip(gain(scores, (0,))[1][0], -_LONGEST * stated, _LONGEST * stated))
            if abs(amount) < _ARRIVED * stated:
                break
            other = with_gear_ratio(joint, moving, amount)
            there = _followed(other, now, options, now.internal + scores.follow[:, 0] * amount)
        except DataError:  # a robot that finds no rest explains nothing
            break
        if there.problem.cost(there.internal) >= cost:
            break
        now, moving, cost = there, other, there.problem.cost(there.internal)
    if moving is robot:
        return None
    end = optimise(now.problem, now.internal, max_iterations=_LAST_STEPS)
    ratio = moving.joints[joint].motor.gear_ratio
    return RatioTrial(joint, ratio, 1 - end.cost / before, end.parameters - fitted.internal)


def _followed(robot: Robot, fitted: FittedModel, options: ElasticOptions, start: FloatArray) -> FittedModel:
    """Another robot's model, some steps on: from a start, from where it was, or from the robot file's values.

    A fit by a ratio that is far off is lost: from there nothing leads back.
    """
    problem = problem_at(fitted.problem, fitted.parameters, robot, options)
    starts = start, fitted.internal, np.zeros_like(start)
    end = min((optimise(problem, each, max_iterations=_STEPS) for each in starts), key=lambda end: end.cost)
    return replace(fitted, problem=problem, internal=end.parameters)
