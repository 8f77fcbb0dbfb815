"""How far to trust a position-dependent fit: absolute limits of its error beyond noise."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from robid.models.lpv.fit.solution import Held, LpvSolution, Ports
from robid.results.doubt import Doubt
from robid.results.grade import Grade, forbidding, grade_alone, grade_held, ordered, weakening

UNUSABLE = 0.3
"""Error beyond noise, over the response, from which on a model must not be used."""

DOUBTFUL = 0.1
"""The same from which on it is to be doubted."""

MISFIT = 2.0
"""Errors on a fit's own data over their deviation, of the median element, from which single poles are to be doubted."""


def assess_lpv(solution: LpvSolution, told: Sequence[Doubt] = ()) -> Grade:
    """Gathers the doubts about a fit and grades it by itself: it predicts at best.

    Args:
        solution: What the fit found.
        told: Further doubts about its data.
    """
    own = error_doubts(solution.own, solution.ports, "the fit's own data")
    choosing = error_doubts(solution.choosing, solution.ports, "what chooses the structure")
    doubts = ordered([*_unstable(solution), *_unexplained(solution.own), *told, *own, *choosing])
    return grade_alone(forbidding(doubts, solution.estimate.status), weakening(doubts), doubts)


def grade_lpv(solution: LpvSolution, doubts: Sequence[Doubt], failures: Sequence[str]) -> Grade:
    """Grades a fit that was held against responses that it never saw.

    Args:
        solution: What the fit found.
        doubts: Doubts about it, the first to blame first.
        failures: What the validation found beyond its limits, a clause each.
    """
    every = ordered(doubts)
    return grade_held((*forbidding(every, solution.estimate.status), *failures), weakening(every), every)


def error_doubts(held: Held, ports: Ports, where: str) -> Iterator[Doubt]:
    """Yields a doubt where the error beyond noise is too large, decisive where the model must not be used."""
    worst = float(np.nanmax(held.agreement.excess, initial=0.0))
    if worst > DOUBTFUL:
        told = f"{worst_place(held, ports)} is off by {worst:.0%} beyond noise on {where}, limit {DOUBTFUL:.0%}"
        yield Doubt("model", told, decisive=worst > UNUSABLE, strength=worst / DOUBTFUL)


def worst_place(held: Held, ports: Ports) -> str:
    """Names the element and position with the largest error beyond noise."""
    position, output, port = np.unravel_index(int(np.nanargmax(held.agreement.excess)), held.agreement.excess.shape)
    return f"{ports.outputs[output]} by {ports.inputs[port]} at {ports.place(held.points[position])}"


def _unexplained(held: Held) -> Iterator[Doubt]:
    """Yields a doubt where errors are not of the size that the covariance says, however small they are."""
    ratio = held.agreement.error_ratio
    typical = float(np.nanmedian(ratio)) if np.isfinite(ratio).any() else 0.0
    if typical > MISFIT:
        told = (
            f"the fit is off by {typical:.3g} deviations of its own data (limit {MISFIT:g}): it may predict as well as"
            " is said, but its poles may be off by more than their intervals"
        )
        yield Doubt("model", told, decisive=False, strength=typical / MISFIT)


def _unstable(solution: LpvSolution) -> Iterator[Doubt]:
    if solution.largest_pole >= 1:
        told = (
            f"the model is unstable within its range, with a pole of absolute value {solution.largest_pole:.6g} at"
            f" {solution.ports.place(solution.largest_pole_at)}: fit a position there, or take fewer basis functions"
        )
        yield Doubt("model", told, decisive=True, strength=3.0)
