"""What would explain a misfit and how it is told, springs that a robot file may lack among it, each tried in place."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.models.elastic.fit.nuisance.off_robot import carry_over, extend_options, extend_problem
from robid.models.elastic.fit.nuisance.springs import FurtherSpring, further_springs
from robid.models.elastic.fit.nuisance.wording import remedy
from robid.models.elastic.fit.optimizers import optimise
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.judge.fitted import FittedModel
from robid.models.elastic.judge.ratios import RatioTrial
from robid.models.elastic.judge.reversals import Reversal, SamplesTrial
from robid.models.elastic.judge.scores import CHANCE, Scores, gain
from robid.results.doubt import two_digits
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


_MOST_OF_IT = 0.9  # of what all doubts of a cause explain
_MOST_NAMED = 3
_MEGA = 1e-6


@dataclass(frozen=True)
class Explanation:
    """What freeing something that the robot file states would do to a fit.

    Attributes:
        cause: The cause, of `robid.results.doubt.CAUSES`.
        names: What would be free, the one that explains most first.
        amounts (n_name,): How much of each.
        units: Units of the amounts.
        share: Share of the residual's cost that it explains, beyond what as many random columns would.
        moved (n_param,): How far the internal parameters would move.
        stated: What the robot file says of each; zero where only amounts are.
        free: Names that free it; none where no fit can estimate it.
        fixed: Names that the options keep at the file's value, though their kind is estimated.
        correct: What to correct in the robot file or where logs are described, where no fit can estimate it.
    """

    cause: str
    names: tuple[str, ...]
    amounts: FloatArray
    units: tuple[str, ...]
    share: float
    moved: FloatArray
    stated: tuple[float, ...] = ()
    free: tuple[str, ...] = ()
    fixed: tuple[str, ...] = ()
    correct: tuple[str, ...] = ()

    @property
    def what(self) -> str:
        """What would be free and how much of it, the first few."""
        stated = self.stated or (0.0,) * len(self.names)
        signed = "" if self.cause == "missing_spring" else "+"
        named = zip(self.names, self.amounts.tolist(), self.units, stated, strict=True)
        told = [_told(*each, signed) for each in named]
        more = f" and {len(told) - _MOST_NAMED} more" if len(told) > _MOST_NAMED else ""
        return ", ".join(told[:_MOST_NAMED]) + more


def _told(name: str, amount: float, unit: str, stated: float, signed: str) -> str:
    if stated:
        return f"a {name} of {stated + float(two_digits(amount)):.6g} instead of {stated:.6g} {unit}".rstrip()
    return f"{name} {two_digits(amount, signed)} {unit}" if unit else f"a {name}"


def of_doubts(scores: Scores, group: list[int], options: ElasticOptions, *, swings_known: bool) -> Explanation | None:
    """The fewest doubts of a cause that explain most of what all do; None where chance explains as much.

    Args:
        scores: All doubts held against what the fit leaves.
        group: Those of the cause.
        options: Options of the fit.
        swings_known: Whether the response tells how far the gears swing.
    """
    whole, _ = gain(scores, group)
    chosen: list[int] = []
    gained: float = 0.0
    amounts: FloatArray = np.zeros(0)
    while len(chosen) < len(group) and gained < _MOST_OF_IT * whole:
        trials = [(*gain(scores, [*chosen, index]), index) for index in group if index not in chosen]
        gained, amounts, index = max(trials, key=lambda trial: trial[0])
        chosen.append(index)
    fair = gained - len(chosen) * CHANCE * (scores.cost - gained) / scores.freedom
    if fair <= 0:
        return None
    named = [scores.doubts[index] for index in chosen]
    return Explanation(
        named[0].cause,
        tuple(doubt.title for doubt in named),
        amounts,
        tuple(doubt.unit for doubt in named),
        fair / scores.cost,
        scores.follow[:, chosen] @ amounts,
        tuple(doubt.stated for doubt in named),
        remedy(named, swings_known=swings_known),
        tuple(doubt.name for doubt in named if doubt.name in options.fixed),
    )


def of_spring(robot: Robot, trial: SpringTrial) -> Explanation:
    """What a spring would explain that the robot file lacks."""
    size = np.array([_MEGA * trial.spring.stiffness])
    units = ("MN/m" if robot.is_linear(trial.spring) else "MN m/rad",)
    free = (trial.spring.name,)
    return Explanation("missing_spring", (trial.title,), size, units, trial.share, trial.moved, free=free)


def of_ratio(robot: Robot, trial: RatioTrial) -> Explanation:
    """What another gear ratio would explain."""
    joint, slides = robot.joints[trial.joint], robot.prismatic[trial.joint]
    stated = joint.motor.gear_ratio
    setting = f"{'gear_ratio_rad_m' if slides else 'gear_ratio'}: {trial.ratio:.5g}"
    return Explanation(
        "gear_ratio",
        (f"gear ratio of {joint.name}",),
        np.array([trial.ratio - stated]),
        ("rad/m" if slides else "",),
        trial.share,
        trial.moved,
        (stated,),
        correct=(f"`{setting}` for {joint.name} in the robot file",),
    )


def of_samples(trial: SamplesTrial) -> Explanation:
    """What other samples of the speeds would explain."""
    words = {"instants": "values at their instants", "difference": "differences from the sample before"}
    what = words.get(trial.sampled, "differences across both neighbours")
    told = f"reading of the speed of {', '.join(trial.names)} as {what}"
    correct = (f"`sampled: {trial.sampled}` for the speeds where their log is described",)
    return Explanation("samples", (told,), np.zeros(1), ("",), trial.share, trial.moved, correct=correct)


def of_signs(robot: Robot, found: Reversal) -> Explanation:
    """What other signs of torques and angles would explain."""
    ratios = {joint.name: (joint.type, joint.motor.gear_ratio) for joint in robot.joints}
    kinds = (("torque", found.torques), ("angle", found.angles))
    named = [(f"reversed {kind} of {name}", _by_sign(kind, name)) for kind, names in kinds for name in names]
    for name in found.joints:
        slides, ratio = ratios[name][0] == "prismatic", ratios[name][1]
        setting = f"{'gear_ratio_rad_m' if slides else 'gear_ratio'}: {-ratio:.6g}"
        named.append((f"motor of {name} that turns against its joint", f"`{setting}` for {name} in the robot file"))
    cause = "torque_sign" if found.torques else "angle_sign" if found.angles else "gear_ratio"
    names, correct = zip(*named, strict=True)
    nothing = np.zeros(len(names))
    return Explanation(cause, names, nothing, ("",) * len(names), found.share, found.moved, correct=correct)


def _by_sign(kind: str, name: str) -> str:
    return f"`sign: -1` for the {kind} of {name} where its log is described"
