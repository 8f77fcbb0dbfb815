"""Defects that noise hides, and those that only the residual as a whole shows: what they would do to gears."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid.models.elastic.fit.options import spring_of
from robid.models.elastic.fit.solution import Detectable, ElasticSolution
from robid.models.elastic.judge.ratios import CHANCE
from robid.results.finding import Finding, two_digits
from robid.robot.description import Robot

FAR = 1.5
"""Half widths from the middle of an interval beyond which a value is outside: defects act to first order here."""

_QUIETER = 10.0  # times smaller errors than any campaign gives
_GEARS = ("transmission", "bearing")


@dataclass(frozen=True)
class Hidden:
    """A defect that may be there unseen, and what it would have done to a gear or bearing."""

    defect: int  # Its index among the detectable defects
    parameter: int  # Index of the parameter
    amount: float  # How large it may be
    moved: float  # What it would have moved the logarithm of the estimate by
    half_widths: float  # How far the true value would lie from the middle of the physical interval


def worst_hidden(robot: Robot, solution: ElasticSolution) -> Hidden | None:
    """Finds the unseen defect that would put a gear or bearing farthest outside its physical interval.

    A defect may be as large as what is known of it beforehand, what the residual would not have shown, and what its
    estimate along with the parameters leaves open. Where one of these says that none is there, or that one must be
    larger, it is not hidden.

    Args:
        robot: The robot file that the fit started from.
        solution: What the fit found, with what it would have shown.

    Returns:
        The defect, inside its interval or not; None where nothing is known of any.
    """
    found, doubts = solution.detectable, solution.doubts
    if found is None or doubts is None:
        return None
    amounts: list[tuple[int, float]] = []
    for defect, name in enumerate(found.names):
        if name not in doubts.names:
            continue
        own, shown = doubts.names.index(name), found.amount[defect]
        left = doubts.value[own] + np.array([-1, 1]) * doubts.half_width[own]
        least, most = max(found.lower[defect], -shown, left[0]), min(found.upper[defect], shown, left[1])
        amounts += [(defect, float(least)), (defect, float(most))] if least <= most else []
    return _worst(robot, solution, amounts)


def _worst(robot: Robot, solution: ElasticSolution, amounts: Sequence[tuple[int, float]]) -> Hidden | None:
    """Of defects and their amounts the one with which a true gear or bearing is farthest from its interval's middle."""
    found, estimate = solution.detectable, solution.estimate
    names = [f"{each.name}.stiffness" for each in robot.springs if each.place in _GEARS]
    rows = [index for index, name in enumerate(estimate.names) if name in names]
    if found is None or not rows:
        return None
    value, lower, upper = (np.log(each[rows]) for each in (estimate.value, estimate.lower, estimate.upper))
    middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    worst: list[Hidden] = []
    for defect, amount in amounts:
        # What a defect has moved an estimate by, the true value lies back.
        moved = found.moves[rows, defect] * amount
        far = np.abs(value - moved - middle) / half
        at = int(np.argmax(far))
        worst.append(Hidden(defect, rows[at], amount, float(moved[at]), float(far[at])))
    return max(worst, key=lambda each: each.half_widths, default=None)


def asked_for(robot: Robot, solution: ElasticSolution) -> Hidden | None:
    """Finds the defect that the residual asks for and that would put a gear or bearing farthest outside its interval.

    A defect that acts nearly as a gear leaves little in any single element, and noise hides that; the residual as a
    whole still follows its column. What is known of it beforehand says nothing against that.

    Arguments and result are as of `worst_hidden`.
    """
    found = solution.detectable
    if found is None:
        return None
    return _worst(
        robot,
        solution,
        [
            (defect, amount)
            for defect, amount in enumerate(found.asked.tolist())
            if found.gain[defect] > CHANCE and not found.lower[defect] >= 0 > amount
        ],
    )


def hidden_findings(robot: Robot, solution: ElasticSolution) -> tuple[Finding, ...]:
    """Findings where a defect that no element shows may put a gear or bearing outside its physical interval.

    Arguments are as of `worst_hidden`.
    """
    found, told = solution.detectable, []
    asked, hidden = asked_for(robot, solution), worst_hidden(robot, solution)
    if found is None:
        return ()
    if asked is not None and asked.half_widths > FAR:
        message = (
            f"{_amount(found, asked)} would explain more of the residual than chance does, though no element shows it"
            f"{_effect(solution, asked)} ({_remedy(found, asked)})"
        )
        strength = asked.half_widths / FAR
        told.append(Finding(found.causes[asked.defect], message, decisive=False, strength=strength))
    if hidden is not None and hidden.half_widths > FAR:
        shown = float(found.amount[hidden.defect])
        seen = f"would be seen from {two_digits(shown)} on" if np.isfinite(shown) else "would never be seen"
        message = (
            f"{_amount(found, hidden)} may be there, and {seen}{_effect(solution, hidden)} "
            f"({_quieter(shown / abs(hidden.amount))}measure configurations that bend it otherwise, or state in "
            "`doubts` how well it is known)"
        )
        told.append(Finding("hidden", message, decisive=False, strength=hidden.half_widths / FAR))
    return tuple(told)


def _amount(found: Detectable, hidden: Hidden) -> str:
    unit = found.units[hidden.defect]
    return f"{found.names[hidden.defect]} {two_digits(hidden.amount, '+')} {unit}".rstrip()


def _remedy(found: Detectable, asked: Hidden) -> str:
    if found.causes[asked.defect] == "missing_spring":
        return f"try `free: [{spring_of(found.names[asked.defect])}]`"
    return "measure it by itself, and correct the robot file"


def _effect(solution: ElasticSolution, hidden: Hidden) -> str:
    name, moved = solution.estimate.names[hidden.parameter], two_digits(100 * float(np.expm1(hidden.moved)), "+")
    far = two_digits(hidden.half_widths)
    return f"; it moves {name} by {moved} %, whose true value is then {far} half-widths from its interval's middle"


def _quieter(times: float) -> str:
    """What a response must be like to show the defect, where a campaign can be so; else nothing."""
    if not 1 < times < _QUIETER:
        return ""
    more = two_digits(times**2)
    return (
        f"errors {two_digits(times)} times smaller would show it: more torque, or {more} times as many realizations; "
    )
