"""How far to trust a rigid fit."""

from __future__ import annotations

from collections.abc import Sequence

from robid.fit.rigid.solution import RigidSolution
from robid.validation.doubt import Doubt
from robid.validation.grade import Grade, grade_alone, grade_held, ordered
from robid.validation.rigid.plausible import parameter_doubts


def assess_rigid(solution: RigidSolution) -> Grade:
    """Gathers the doubts about a rigid fit and grades it by itself: it predicts at best."""
    doubts = ordered(parameter_doubts(solution))
    return grade_alone(_unusable(solution, doubts), _doubtful(doubts), doubts)


def grade_rigid(solution: RigidSolution, doubts: Sequence[Doubt], failures: Sequence[str]) -> Grade:
    """Grades a rigid fit that was held against a motion that it never saw.

    Args:
        solution: What the fit found.
        doubts: Doubts about it, the first to blame first.
        failures: What the validation found beyond its limits, a clause each.
    """
    every = ordered(doubts)
    return grade_held((*_unusable(solution, every), *failures), _doubtful(every), every)


def _unusable(solution: RigidSolution, doubts: Sequence[Doubt]) -> tuple[str, ...]:
    found = [doubt.message for doubt in doubts if doubt.decisive]
    if solution.estimate.status != "converged":
        found.append("the fit has not converged")
    return tuple(found)


def _doubtful(doubts: Sequence[Doubt]) -> tuple[str, ...]:
    return tuple(doubt.message for doubt in doubts if not doubt.decisive and doubt.strength > 1)
