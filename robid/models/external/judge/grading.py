"""How far to trust an external fit."""

from __future__ import annotations

from collections.abc import Sequence

from robid.models.external.fit.options import ExternalOptions
from robid.models.external.fit.solution import ExternalSolution
from robid.models.external.judge.plausible import solution_doubts
from robid.results.doubt import Doubt
from robid.results.grade import Grade, forbidding, grade_alone, grade_held, ordered, weakening


def assess_external(solution: ExternalSolution, options: ExternalOptions) -> Grade:
    """Gathers the doubts about an external fit and grades it by itself: it predicts at best."""
    doubts = ordered(solution_doubts(solution, options))
    return grade_alone(forbidding(doubts, solution.estimate.status), weakening(doubts), doubts)


def grade_external(solution: ExternalSolution, doubts: Sequence[Doubt], failures: Sequence[str]) -> Grade:
    """Grades an external fit that was held against motions that it never saw.

    Args:
        solution: What the fit found.
        doubts: Doubts about it, the first to blame first.
        failures: What the validation found beyond its limits, a clause each.
    """
    every = ordered(doubts)
    return grade_held((*forbidding(every, solution.estimate.status), *failures), weakening(every), every)
