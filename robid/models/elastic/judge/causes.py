"""Likely causes of what a fitted model leaves unexplained: score tests, and trials of what is beyond a first order."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from robid.arrays import FloatArray
from robid.models.elastic.fit.gear_motion import swings_known
from robid.models.elastic.fit.nuisance.kinds import list_nuisances
from robid.models.elastic.fit.nuisance.wording import free_with
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.solution import ElasticSolution
from robid.models.elastic.judge.explanations import (
    Explanation,
    of_doubts,
    of_ratio,
    of_samples,
    of_signs,
    of_spring,
    try_springs,
)
from robid.models.elastic.judge.fitted import FittedModel
from robid.models.elastic.judge.ratios import candidates, try_ratios
from robid.models.elastic.judge.reversals import try_samples, try_signs
from robid.models.elastic.judge.scores import Scores, gain, score
from robid.results.doubt import CAUSES, Doubt, two_digits
from robid.results.estimate import Estimate
from robid.robot.description import Robot

_TELLING = 0.1
_RUINED = 0.2  # relative error of a spring
_MOSTLY = 0.5  # of the misfit
_CLEARLY = 3.0  # half-widths
_LEAST_RATIO_ERROR = 0.01
_SIGNS = ("torque_sign", "angle_sign")


def misfit_doubts(
    robot: Robot, solution: ElasticSolution, fitted: FittedModel, options: ElasticOptions
) -> tuple[Doubt, ...]:
    """Names what would explain a fit's residual, the most telling first.

    Args:
        robot: The robot file that the fit started from, with its campaign's payload.
        solution: What the fit found.
        fitted: The fitted model in the configurations of the fit's own response.
        options: Options of the fit.

    Returns:
        Doubts whose strength is how many half widths of its interval some parameter would move. The first is decisive
        where it explains most of the residual and is a sign, or a spring that leaves another one far from its estimate.
    """
    found = [each for each in explain(robot, fitted, options) if each.share > _TELLING]
    return tuple(_doubt(solution.estimate, each, found if each is found[0] else (), options) for each in found)


def explain(robot: Robot, fitted: FittedModel, options: ElasticOptions) -> list[Explanation]:
    """Ranks what a robot file may have wrong by how much of a fit's residual it explains.

    Each doubt is a column beside the parameters' own, which are at liberty to follow. Those of one cause are freed
    together, as far as their priors let them, and the fewest are named that explain most of what all of them do. A
    missing spring, a gear ratio or a sign changes the response too much for that: each is put in its place and the fit
    goes on for some steps.

    Args:
        robot: The robot file that the fit started from, with its campaign's payload.
        fitted: The fitted model in the configurations of the fit's own response.
        options: Options of the fit.

    Source:
        Rao's score test; docs/methods, sec. 11.
    """
    signs = try_signs(robot, fitted, options)
    reversed_ = [] if signs is None else [of_signs(robot, signs)]
    if signs is not None and signs.share > _MOSTLY:
        return reversed_  # a fit to reversed data says nothing of anything else
    doubts = [each for each in list_nuisances(robot, options) if each.cause != "missing_spring" and each.common_std > 0]
    scores = score(robot, fitted, options, (*doubts, *candidates(robot, fitted.problem.frf)))
    groups: dict[str, list[int]] = defaultdict(list)
    for index, doubt in enumerate(scores.doubts):
        groups[doubt.cause].append(index)
    ratios = groups.pop("gear_ratio", [])
    known = swings_known(fitted.problem.frf)
    each_cause = (of_doubts(scores, group, options, swings_known=known) for group in groups.values())
    found = [each for each in each_cause if each is not None]
    found += [of_spring(robot, trial) for trial in try_springs(robot, fitted, options)[:1]]
    found += _wrong_ratio(robot, fitted, options, scores, ratios)
    samples = try_samples(fitted)
    found += [] if samples is None else [of_samples(samples)]
    return sorted([*found, *reversed_], key=lambda each: -each.share)


def _wrong_ratio(
    robot: Robot, fitted: FittedModel, options: ElasticOptions, scores: Scores, listed: Sequence[int]
) -> list[Explanation]:
    """The gear ratio that explains most, if it is off by more than ratios are rounded."""
    names = [f"{joint.name}.gear_ratio" for joint in robot.joints]
    likely = sorted(listed, key=lambda index: -gain(scores, (index,))[0])
    joints = [names.index(scores.doubts[index].name) for index in likely]
    trials = try_ratios(robot, fitted, options, joints)
    stated = robot.gear_ratio
    return [
        of_ratio(robot, trial)
        for trial in trials[:1]
        if abs(trial.ratio / stated[trial.joint] - 1) > _LEAST_RATIO_ERROR
    ]


def _doubt(estimate: Estimate, found: Explanation, ranked: Sequence[Explanation], options: ElasticOptions) -> Doubt:
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
    message = (
        f"{found.what} would explain {found.share:.0%} of the misfit{told} and move {estimate.names[worst]} by "
        f"{two_digits(float(widths[worst]))} half-widths of its interval"
    )
    if ruined is not None:
        message += f", which leaves it {_error(found)[ruined]:.0%} off"
    reversed_ = leads and found.cause in _SIGNS and found.share > _MOSTLY
    return Doubt(found.cause, message, decisive=reversed_ or ruined is not None, strength=float(widths[worst]))


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
