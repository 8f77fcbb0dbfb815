"""Grade and outcome as most families find them: from doubts, from how the fit ended, and from what failed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from robid.errors import DataError
from robid.results.doubt import Doubt
from robid.results.estimate import Estimate
from robid.results.grade import Grade, forbidding, grade_alone, grade_held, ordered, weakening
from robid.results.outcome import Outcome, recover

_SAME_RATE = 1e-6


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


def refuse_other_rate(own_s: float, new_s: Sequence[float]) -> None:
    """Refuses records of a validation whose sampling periods are not that of the fit [s].

    Raises:
        DataError: If there are such.
    """
    other = [period_s for period_s in new_s if abs(period_s / own_s - 1) > _SAME_RATE]
    if other:
        message = f"the validation is sampled every {other[0]:g} s, the fit's record every {own_s:g} s"
        raise DataError(message, where="validation", remedy="validate on a record of the same sampling period")
