"""Springs that a robot file lacks, tried: those that the physical model has put in place, and each by itself."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.models.elastic.fit.nuisance.moves import FurtherSpring, further_springs, missing_springs, stiffened
from robid.models.elastic.fit.nuisance.off_robot import carry_over, extend_options, extend_problem, problem_at
from robid.models.elastic.fit.optimizers import optimise
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.judge.fitted import FittedModel
from robid.models.elastic.judge.ratios import Explanation
from robid.results.levenberg import Minimum
from robid.robot.description import Robot, Spring

_IN_SERIES = 2.0  # times a fitted gear, for gear and trial alike: together as soft as the gear was
_FIRST_STEPS, _STEPS, _KEPT = 4, 25, 5
_ALONG = 0.9  # cosine above which two axes are one
_BETTER = 0.5  # of what one spring leaves, that several must leave at most
_PERCENT = 100.0
_MEGA = 1e-6


def missing_in(fitted: FittedModel) -> list[Explanation]:
    """Returns what explains most, at most one: all springs of the physical model together, or one by itself.

    Args:
        fitted: The fitted model in the configurations of the fit's own response.
    """
    one, together = try_springs(fitted)[:1], _try_placed(fitted)
    if together and (not one or 1 - together[0].share < _BETTER * (1 - one[0].share)):
        return together
    return one


def _try_placed(fitted: FittedModel) -> list[Explanation]:
    """The springs that the physical model has put in place, all together, from where it has them on."""
    found = fitted.placed
    listed = [spring for spring in missing_springs(fitted.robot) if spring.name in found]
    if len(listed) < 2:  # one alone is tried like all others
        return []
    # As soft as they were found, since the robot rests on them.
    springs = [stiffened(spring, _PERCENT / found[spring.name]) for spring in listed]
    robot = replace(fitted.robot, springs=(*fitted.robot.springs, *springs))
    try:
        options = extend_options(fitted.options, robot, springs, fixing=True)
        problem = extend_problem(fitted.problem, fitted.physical, robot, options)
        end = optimise(problem, carry_over(problem, fitted.problem, fitted.physical), max_iterations=_STEPS)
        problem = problem_at(problem, problem.parameters.parameters(end.parameters), robot, options)
    except DataError:  # it finds no rest
        return []
    return [_of_springs(springs, problem, optimise(problem, end.parameters, max_iterations=_STEPS), fitted)]


def try_springs(fitted: FittedModel) -> list[Explanation]:
    """Tries every spring that a robot file may lack, the most telling first.

    Args:
        fitted: The fitted model in the configurations of the fit's own response.
    """
    every = list(further_springs(fitted.robot))
    begun = _begun([further for further in every if not further.after], fitted)[:_KEPT]
    kept = {further.spring.name for _, _, further in begun}
    begun += _begun([further for further in every if further.after in kept], fitted)
    ends = [
        (further, problem, optimise(problem, end.parameters, max_iterations=_STEPS)) for end, problem, further in begun
    ]
    trials = (_of_springs((further.spring,), problem, end, fitted) for further, problem, end in ends)
    return sorted(trials, key=lambda trial: -trial.share)


def _begun(springs: Sequence[FurtherSpring], fitted: FittedModel) -> list[tuple[Minimum, Problem, FurtherSpring]]:
    """Each spring put in place, and where a few steps of the fit lead from there, what fits best first."""
    robot, begun = fitted.robot, []
    for further in springs:
        spring = further.spring
        try:
            more = replace(robot, springs=(*robot.springs, spring))
            extended = extend_options(fitted.options, more, (spring,), fixing=True)
            problem = extend_problem(fitted.problem, fitted.internal, more, extended)
        except DataError:  # a spring under which the robot finds no rest explains nothing
            continue
        starts = _starts(problem, spring, fitted)
        ends = (optimise(problem, start, max_iterations=_FIRST_STEPS) for start in starts)
        begun.append((min(ends, key=lambda end: end.cost), problem, further))
    return sorted(begun, key=lambda each: each[0].cost)


def _starts(problem: Problem, spring: Spring, fitted: FittedModel) -> Iterator[FloatArray]:
    """Where a trial starts: stiff beside the fitted values, and as one of two springs that share a gear's compliance.

    A fitted gear that stands for two springs in series is stiffer by itself: from its fitted value the trial's spring
    only gets stiffer, and the gear never recovers.
    """
    names = problem.parameters.names
    start = carry_over(problem, fitted.problem, fitted.internal)
    yield start
    stiffness = dict(
        zip((each.name for each in fitted.robot.springs), fitted.parameters.stiffness.tolist(), strict=True)
    )
    for gear in _gears_in_series(fitted.robot, spring):
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


def _of_springs(springs: Sequence[Spring], problem: Problem, end: Minimum, fitted: FittedModel) -> Explanation:
    """What springs would explain that the robot file lacks, as stiff as they ended."""
    after = dict(zip(problem.parameters.names, end.parameters.tolist(), strict=True))
    titles = {further.spring.name: further.title for further in further_springs(fitted.robot)}
    stiffness = [spring.stiffness * float(np.exp(after[f"{spring.name}.stiffness"])) for spring in springs]
    before = zip(fitted.problem.parameters.names, fitted.internal.tolist(), strict=True)
    return Explanation(
        "missing_spring",
        tuple(titles[spring.name] for spring in springs),
        _MEGA * np.array(stiffness),
        tuple("MN/m" if fitted.robot.is_linear(spring) else "MN m/rad" for spring in springs),
        1 - end.cost / fitted.cost,
        np.array([after[name] - value for name, value in before]),
        free=tuple(spring.name for spring in springs),
    )
