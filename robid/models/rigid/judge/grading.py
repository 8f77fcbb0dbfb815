"""How far to trust a rigid fit."""

from __future__ import annotations

from collections.abc import Sequence

from robid.models.rigid.fit.solution import RigidSolution
from robid.models.rigid.judge.plausible import parameter_doubts
from robid.results.doubt import Doubt
from robid.results.grade import Grade, forbidding, grade_alone, grade_held, ordered, weakening


def assess_rigid(solution: RigidSolution, scales: Sequence[Doubt] = ()) -> Grade:
    """Gathers the doubts about a rigid fit and grades it by itself: it predicts at best.

    Args:
        solution: What the fit found.
        scales: Wrong units and other scales of its record; nothing else is looked for beside them.
    """
    doubts = ordered(scales or parameter_doubts(solution))
    return grade_alone(forbidding(doubts, solution.estimate.status), weakening(doubts), doubts)


def grade_rigid(solution: RigidSolution, doubts: Sequence[Doubt], failures: Sequence[str]) -> Grade:
    """Grades a rigid fit that was held against a motion that it never saw.

    Args:
        solution: What the fit found.
        doubts: Doubts about it, the first to blame first.
        failures: What the validation found beyond its limits, a clause each.
    """
    every = ordered(doubts)
    return grade_held((*forbidding(every, solution.estimate.status), *failures), weakening(every), every)
