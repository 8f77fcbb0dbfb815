"""Springs that a robot file may lack, tried one by one: a short descent each with the spring in place."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.models.elastic.fit.doubts.extension import carry_over, extend_options, extend_problem
from robid.models.elastic.fit.doubts.further import FurtherSpring, further_springs
from robid.models.elastic.fit.optimizers import optimise
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.judge.fitted import FittedModel
from robid.results.levenberg import Minimum
from robid.robot.description import Robot, Spring

_IN_SERIES = 2.0  # times a fitted gear, for gear and trial alike: together as soft as the gear was
_FIRST_STEPS, _STEPS, _KEPT = 4, 25, 5
_ALONG = 0.9  # cosine above which two axes are one


@dataclass(frozen=True)
class SpringTrial:
    """What one more spring does to a fit.

    Attributes:
        spring: The spring, with the stiffness that it ended at.
        title: What it is, for a sentence.
        share: Share of the residual's cost that it takes away.
        moved (n_param,): How far it moves the internal parameters.
    """

    spring: Spring
    title: str
    share: float
    moved: FloatArray


def try_springs(robot: Robot, fitted: FittedModel, options: ElasticOptions) -> list[SpringTrial]:
    """Tries every spring that a robot file may lack, the most telling first.

    Args:
        robot: The robot file that the fit started from, with its campaign's payload.
        fitted: The fitted model in the configurations of the fit's own response.
        options: Options of the fit.
    """
    begun = []
    for further in further_springs(robot):
        spring = further.spring
        try:
            more = replace(robot, springs=(*robot.springs, spring))
            extended = extend_options(options, more, (spring,), holding=True)
            problem = extend_problem(fitted.problem, fitted.internal, more, extended)
        except DataError:  # a spring under which the robot finds no rest explains nothing
            continue
        starts = _starts(robot, problem, spring, fitted)
        first = min((_descend(problem, start, _FIRST_STEPS) for start in starts), key=lambda end: end.cost)
        begun.append((first, problem, further))
    begun.sort(key=lambda each: each[0].cost)
    ends = [(further, problem, _descend(problem, end.parameters, _STEPS)) for end, problem, further in begun[:_KEPT]]
    return sorted((_trial(*end, fitted) for end in ends), key=lambda trial: -trial.share)


def _descend(problem: Problem, start: FloatArray, steps: int) -> Minimum:
    return optimise(problem, start, max_iterations=steps)


def _starts(robot: Robot, problem: Problem, spring: Spring, fitted: FittedModel) -> Iterator[FloatArray]:
    """Where a trial starts: stiff beside the fitted values, and as one of two springs that share a gear's compliance.

    A fitted gear that stands for two springs in series is stiffer by itself: from its fitted value the trial's spring
    only gets stiffer, and the gear never recovers.
    """
    names = problem.parameters.names
    start = carry_over(problem, fitted.problem, fitted.internal)
    yield start
    stiffness = dict(zip((each.name for each in robot.springs), fitted.parameters.stiffness.tolist(), strict=True))
    for gear in _gears_in_series(robot, spring):
        own = f"{gear}.stiffness"
        if own in names:
            shared = start.copy()
            shared[names.index(own)] += np.log(_IN_SERIES)
            shared[names.index(f"{spring.name}.stiffness")] = np.log(_IN_SERIES * stiffness[gear] / spring.stiffness)
            yield shared


def _gears_in_series(robot: Robot, spring: Spring) -> Iterator[str]:
    """Transmissions next to a spring that turn about the same axis, at zero joint angles."""
    own, upright = robot.joints[spring.joint], np.array([0.0, 0.0, 1.0])
    axes = {spring.joint: own.rotation @ upright if spring.place == "base" else upright}
    if spring.place == "bearing" and spring.joint > 0:
        axes[spring.joint - 1] = own.rotation.T @ upright
    if spring.place == "split" and spring.joint + 1 < len(robot.joints):
        axes[spring.joint + 1] = robot.joints[spring.joint + 1].rotation @ upright
    for each in robot.springs:
        turns = each.place == "transmission" and not robot.is_linear(each)
        if turns and each.joint in axes and abs(float(axes[each.joint] @ spring.axis)) > _ALONG:
            yield each.name


def _trial(further: FurtherSpring, problem: Problem, end: Minimum, fitted: FittedModel) -> SpringTrial:
    spring, after = further.spring, dict(zip(problem.parameters.names, end.parameters.tolist(), strict=True))
    stiffness = spring.stiffness * float(np.exp(after[f"{spring.name}.stiffness"]))
    before = zip(fitted.problem.parameters.names, fitted.internal.tolist(), strict=True)
    return SpringTrial(
        replace(spring, stiffness=stiffness),
        further.title,
        1 - end.cost / fitted.problem.cost(fitted.internal),
        np.array([after[name] - value for name, value in before]),
    )
