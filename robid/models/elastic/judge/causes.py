"""Likely causes of what a fitted model leaves unexplained: score tests, and trials of what is beyond a first order."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from robid.arrays import FloatArray
from robid.models.elastic.fit.gear_motion import swings_known
from robid.models.elastic.fit.nuisance.effects import Nuisance
from robid.models.elastic.fit.nuisance.kinds import ZERO
from robid.models.elastic.fit.nuisance.listing import list_nuisances, slipping_name
from robid.models.elastic.fit.nuisance.wording import free_with, remedy
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.solution import ElasticSolution
from robid.models.elastic.judge.amounts import as_set
from robid.models.elastic.judge.fitted import FittedModel
from robid.models.elastic.judge.ratios import (
    CHANCE,
    Explanation,
    RatioTrial,
    Scores,
    candidates,
    gain,
    score,
    try_ratios,
)
from robid.models.elastic.judge.reversals import try_samples, try_signs
from robid.models.elastic.judge.springs import missing_in
from robid.results.estimate import Estimate
from robid.results.finding import CAUSES, Finding, two_digits
from robid.robot.description import Robot

_MOST_OF_IT = 0.9  # of what all nuisances of a cause explain


def of_nuisances(scores: Scores, group: list[int], fitted: FittedModel, *, swings_known: bool) -> Explanation | None:
    """The fewest nuisances of a cause that explain most of what all do; None where chance explains as much.

    Args:
        scores: All nuisances held against what the fit leaves.
        group: Those of the cause.
        fitted: The fitted model.
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
    named = [scores.nuisances[index] for index in chosen]
    pairs = zip(named, amounts.tolist(), strict=True)
    titles, told, units, stated = zip(*(as_set(*pair, fitted.robot, fitted.parameters) for pair in pairs), strict=True)
    return Explanation(
        named[0].cause,
        titles,
        np.array(told),
        units,
        fair / scores.cost,
        scores.follow[:, chosen] @ amounts,
        stated,
        remedy(named, swings_known=swings_known),
        tuple(nuisance.name for nuisance in named if nuisance.name in fitted.options.fixed),
        tuple(_zero_setting(*each) for each in zip(named, amounts.tolist(), strict=True))
        if named[0].cause == ZERO
        else (),
        # A column of hysteresis fits any gear's loss; a torque of slip must act as the measured swing says.
        at_most=any(slipping_name(each) is not None for each in named),
    )


def _zero_setting(zero: Nuisance, amount_deg: float) -> str:
    """What to correct of a joint whose arm stands further than its encoder shows: the file's angle grows by that."""
    joint = zero.name.rpartition(".")[0]
    return f"`offset_deg` changed by {two_digits(amount_deg, '+')} for {joint} in the robot file"


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


TELLING = 0.1
"""Share of the residual's cost from which what explains it is worth a word."""
_RUINED = 0.2  # relative error of a spring
_MOSTLY = 0.5  # of the misfit
_CLEARLY = 3.0  # half-widths
_LEAST_RATIO_ERROR = 0.01
_SIGNS = ("torque_sign", "angle_sign")


def misfit_findings(solution: ElasticSolution, fitted: FittedModel) -> tuple[Finding, ...]:
    """Names what would explain a fit's residual, the most telling first.

    Args:
        solution: What the fit found.
        fitted: The fitted model in the configurations of the fit's own response.

    Returns:
        Findings whose strength is how many half widths of its interval some parameter would move. The first is decisive
        where it explains most of the residual and is a sign, or a spring that leaves another one far from its estimate.
    """
    found = [each for each in explain(fitted) if each.share > TELLING]
    return tuple(_finding(solution.estimate, each, found if each is found[0] else (), fitted.options) for each in found)


def explain(fitted: FittedModel) -> list[Explanation]:
    """Ranks what a robot file may have wrong by how much of a fit's residual it explains.

    Each nuisance is a column beside the parameters' own, which are at liberty to follow. Those of one cause are free
    together, as far as their priors let them, and the fewest are named that explain most of what all of them do. A
    missing spring, a gear ratio or a sign changes the response too much for that: each is put in its place and the fit
    goes on for some steps.

    Args:
        fitted: The fitted model in the configurations of the fit's own response.

    Source:
        Rao's score test; docs/methods, sec. 11.
    """
    robot, options = fitted.robot, fitted.options
    signs = try_signs(fitted)
    reversed_ = [] if signs is None else [signs]
    if signs is not None and signs.share > _MOSTLY:
        return reversed_  # a fit to reversed data says nothing of anything else
    nuisances = [
        each for each in list_nuisances(robot, options) if each.cause != "missing_spring" and each.common_std > 0
    ]
    scores = score(fitted, (*nuisances, *candidates(robot, fitted.problem.frf, options)))
    groups: dict[str, list[int]] = defaultdict(list)
    for index, nuisance in enumerate(scores.nuisances):
        groups[nuisance.cause].append(index)
    ratios = groups.pop("gear_ratio", [])
    known = swings_known(fitted.problem.frf)
    each_cause = (of_nuisances(scores, group, fitted, swings_known=known) for group in groups.values())
    found = [each for each in each_cause if each is not None]
    found += missing_in(fitted)
    found += _wrong_ratio(fitted, scores, ratios)
    samples = try_samples(fitted)
    found += [] if samples is None else [samples]
    return sorted([*found, *reversed_], key=lambda each: -each.share)


def _wrong_ratio(fitted: FittedModel, scores: Scores, listed: Sequence[int]) -> list[Explanation]:
    """The gear ratio that explains most, if it is off by more than ratios are rounded."""
    robot = fitted.robot
    names = [f"{joint.name}.gear_ratio" for joint in robot.joints]
    likely = sorted(listed, key=lambda index: -gain(scores, (index,))[0])
    joints = [names.index(scores.nuisances[index].name) for index in likely]
    trials = try_ratios(fitted, joints)
    stated = robot.gear_ratio
    return [
        of_ratio(robot, trial)
        for trial in trials[:1]
        if abs(trial.ratio / stated[trial.joint] - 1) > _LEAST_RATIO_ERROR
    ]


def _finding(estimate: Estimate, found: Explanation, ranked: Sequence[Explanation], options: ElasticOptions) -> Finding:
    """What an explanation speaks against; the first of those ranked tells of the next ones too."""
    leads = bool(ranked)
    half = np.maximum(0.5 * (estimate.upper - estimate.lower), 1e-300)
    slopes = np.where(np.array(estimate.nominal) == 0, 1.0, np.abs(estimate.value))
    telling = np.array([kind in ("stiffness", "damping") for kind in estimate.kinds])
    widths = np.where(telling, np.abs(found.moved) * slopes / half, 0.0)
    ruined = _ruined(estimate, found, widths) if leads else None
    worst = int(np.argmax(widths)) if ruined is None else ruined
    hints = _remedies(found, options)
    hints += [f"next: {'; '.join(f'{CAUSES[each.cause]}, {each.share:.0%}' for each in ranked[1:])}"] * (
        len(ranked) > 1
    )
    told = f" ({'; '.join(hints)})" if hints else ""
    share = f"{'up to ' * found.at_most}{found.share:.0%}"
    message = (
        f"{found.what} would explain {share} of the misfit{told} and move {estimate.names[worst]} by "
        f"{two_digits(float(widths[worst]))} half-widths of its interval"
    )
    if ruined is not None:
        message += f", which leaves it {_error(found)[ruined]:.0%} off"
    reversed_ = leads and found.cause in _SIGNS and found.share > _MOSTLY
    return Finding(found.cause, message, decisive=reversed_ or ruined is not None, strength=float(widths[worst]))


def _remedies(found: Explanation, options: ElasticOptions) -> list[str]:
    """What to write into the fit, the robot file or the log; nothing where that stands there already."""
    free = free_with(options.free, found.free)
    kept = [f"`{name}`" for name in found.fixed]
    more = [] if {*free} <= {*options.free, *options.kinds} else [f"try `free: [{', '.join(free)}]`"]
    corrected = [f"try {' and '.join(found.correct)}"] * bool(found.correct)
    return [*more, *corrected, *([f"take {' and '.join(kept)} out of `fixed`"] if kept else [])]


def _ruined(estimate: Estimate, found: Explanation, widths: FloatArray) -> int | None:
    """The identified spring that an explanation leaves farthest off, if that is far and the explanation good.

    Only springs that were put in place count: a column beside the parameters' own says little of what is far away.
    """
    if found.cause != "missing_spring" or found.share < _MOSTLY:
        return None
    springs = np.array([kind == "stiffness" for kind in estimate.kinds]) & estimate.identified & (widths > _CLEARLY)
    error = np.where(springs, _error(found), 0.0)
    worst = int(np.argmax(error))
    return worst if error[worst] > _RUINED else None


def _error(found: Explanation) -> FloatArray:
    """Relative error (n_param,) of each logarithmic estimate, were the explanation true."""
    return np.asarray(np.abs(np.expm1(np.clip(-found.moved, -50.0, 50.0))))
