"""Grade and outcome as most families find them: from doubts, from how the fit ended, and from what failed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from robid.results.doubt import Doubt
from robid.results.estimate import Estimate
from robid.results.grade import Grade, forbidding, grade_alone, grade_held, ordered, weakening
from robid.results.outcome import Outcome, recover


def graded_alone(doubts: Sequence[Doubt], status: str) -> Grade:
    """Grades a fit that ended so by itself: it predicts at best."""
    every = ordered(doubts)
    return grade_alone(forbidding(every, status), weakening(every), every)


def outcome_of(
    estimate: Estimate,
    doubts: Sequence[Doubt],
    failures: Sequence[str],
    verdict: str,
    truth: Mapping[str, float] | None = None,
) -> Outcome:
    """Grades a fit that was held against data that it never saw.

    Args:
        estimate: What the fit found.
        doubts: Doubts about it, the first to blame first.
        failures: What the validation found beyond its limits, a clause each.
        verdict: The same in words, to follow "the model".
        truth: True values by parameter name, of a simulated robot.
    """
    every = ordered(doubts)
    grade = grade_held((*forbidding(every, estimate.status), *failures), weakening(every), every)
    return Outcome(ok=not failures, verdict=verdict, grade=grade, recovery=recover(estimate, truth or {}))
