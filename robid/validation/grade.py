"""How far to trust a fitted model: three grades, what keeps it from a better one, and the likely causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.fit.model_error import ModelError
from robid.fit.solution import Solution
from robid.validation.doubt import CAUSES, Doubt, two_digits

TRUST, PREDICTS, DO_NOT_USE = 2, 1, 0
WORDS = {
    TRUST: "trust",
    PREDICTS: "predicts, but single parameters may be off",
    DO_NOT_USE: "do not use",
}

_FLOOR = 0.001  # relative errors below move no spring by more than its interval
_EXPECTED, _SIGNIFICANT = 0.05, 3.0  # share of a right model's elements beyond their band, and deviations of it
_MISFIT_LIMIT = 1.5
_DROPPED_LIMIT = 0.5
_WIDE = 1.0


@dataclass(frozen=True)
class Grade:
    """How far to trust a fitted model.

    Attributes:
        value: 2 to trust, 1 predicts but single parameters may be off, 0 not to be used.
        reasons: What keeps it from a better grade, clauses without a full stop, the worst first.
        causes: Likely cause of each doubt, of `robid.validation.doubt.CAUSES`, the first to blame first.
        messages: What was seen.
        decisive (n_doubt,): Whether nothing that follows from the data may be used while a doubt stands.
        strength (n_doubt,): How far each is beyond what is normal.
        sentence: The grade, why it is no better, and the likeliest cause.
    """

    value: int
    reasons: tuple[str, ...]
    causes: tuple[str, ...]
    messages: tuple[str, ...]
    decisive: BoolArray
    strength: FloatArray
    sentence: str

    @property
    def doubts(self) -> tuple[Doubt, ...]:
        """The doubts, the first to blame first."""
        rows = zip(self.causes, self.messages, self.decisive.tolist(), self.strength.tolist(), strict=True)
        return tuple(Doubt(*row) for row in rows)


def grade_fit(solution: Solution, doubts: Sequence[Doubt], failures: Sequence[str] = ()) -> Grade:
    """Grades a fit that was held against nothing but its own data: it predicts at best.

    Args:
        solution: What the fit found.
        doubts: Doubts about its data, its parameters and its residual, the first to blame first.
        failures: What of its own data is beyond the limits of a validation, a clause each.
    """
    worst = (*_unusable(solution, doubts), *failures)
    if worst:
        return _made(DO_NOT_USE, worst, doubts)
    return _made(
        PREDICTS, ("it was not held against data that the fit never saw", *_doubtful(solution, doubts)), doubts
    )


def grade_validation(solution: Solution, doubts: Sequence[Doubt], failures: Sequence[str]) -> Grade:
    """Grades a fit that was held against data that it never saw.

    Args:
        solution: What the fit found.
        doubts: Doubts about its data, its parameters and its residual, the first to blame first.
        failures: What the validation found beyond its limits, a clause each.
    """
    worst = (*_unusable(solution, doubts), *failures)
    if worst:
        return _made(DO_NOT_USE, worst, doubts)
    reasons = _doubtful(solution, doubts)
    return _made(PREDICTS if reasons else TRUST, reasons, doubts)


def ordered(doubts: Sequence[Doubt]) -> tuple[Doubt, ...]:
    """Leaves out what repeats a cause; a decisive doubt takes the place of one that is not."""
    found: dict[str, Doubt] = {}
    for doubt in doubts:
        before = found.setdefault(doubt.cause, doubt)
        if doubt.decisive and not before.decisive:
            found[doubt.cause] = doubt
    return tuple(found.values())


def _made(value: int, reasons: Sequence[str], doubts: Sequence[Doubt]) -> Grade:
    return Grade(
        value=value,
        reasons=tuple(dict.fromkeys(reasons)),
        causes=tuple(doubt.cause for doubt in doubts),
        messages=tuple(doubt.message for doubt in doubts),
        decisive=np.array([doubt.decisive for doubt in doubts], bool),
        strength=np.array([doubt.strength for doubt in doubts], float),
        sentence=_sentence(value, tuple(dict.fromkeys(reasons)), doubts),
    )


def _sentence(value: int, reasons: Sequence[str], doubts: Sequence[Doubt]) -> str:
    words = WORDS[value]
    told = f"{words[0].upper()}{words[1:]}{': ' if reasons else ''}{'; '.join(reasons)}."
    if value == TRUST or not doubts:
        return told
    first = doubts[0]
    return f"{told} Look first for {CAUSES[first.cause]}{'' if first.message in reasons else f': {first.message}'}."


def _unusable(solution: Solution, doubts: Sequence[Doubt]) -> tuple[str, ...]:
    """Why a fit must not be used, whatever it was held against."""
    found = [doubt.message for doubt in doubts if doubt.decisive]
    if solution.status != "converged":
        found.append("the fit has not converged")
    share = solution.dropped / solution.modelled.size
    if share > _DROPPED_LIMIT:
        found.append(f"{share:.0%} of the response lies below 10 dB")
    springs = np.array([kind == "stiffness" for kind in solution.kinds])
    chosen = springs if springs.any() else np.ones(springs.size, bool)
    half = 0.5 * (solution.upper - solution.lower)[chosen] / np.maximum(np.abs(solution.estimate[chosen]), 1e-300)
    if not (half < _WIDE).any():
        found.append(f"no {'spring' if springs.any() else 'parameter'} is known to better than its own size")
    return tuple(found)


def _doubtful(solution: Solution, doubts: Sequence[Doubt]) -> tuple[str, ...]:
    """Why single parameters may be off by more than their intervals say."""
    found = [doubt.message for doubt in doubts if not doubt.decisive and doubt.strength > 1]
    if solution.misfit > _MISFIT_LIMIT:
        found.append(
            f"the residual costs {two_digits(solution.misfit)} times what noise and the assumed model error allow"
        )
    error = solution.model_error
    if error is not None:
        above, correlated = telling_shares(error)
        if above > _share_limit(error):
            found.append(
                f"the residuals of {above:.0%} of the response's elements are beyond their covariance and those of "
                f"{correlated:.0%} correlated over frequency, by more than {_FLOOR:.1%} of the response"
            )
    return tuple(found)


def is_unexplained(solution: Solution) -> bool:
    """Whether a residual holds so much more than noise that its cause is worth a search."""
    error = solution.model_error
    if solution.misfit > _MISFIT_LIMIT:
        return True
    return error is not None and telling_shares(error)[0] > _share_limit(error)


def _share_limit(error: ModelError) -> float:
    """Share of telling elements that a right model hardly ever has, however few they are."""
    count = max(int(np.isfinite(error.ratio).sum()), 1)
    return _EXPECTED + _SIGNIFICANT * float(np.sqrt(_EXPECTED * (1 - _EXPECTED) / count))


def telling_shares(error: ModelError) -> tuple[float, float]:
    """Shares of the elements above their band, and correlated over frequency, by more than moves any spring."""
    known = np.isfinite(error.ratio)
    if not known.any():
        return 0.0, 0.0
    large = error.level > _FLOOR
    above, correlated = (error.ratio > error.limit) & large, (error.correlation > error.correlation_limit) & large
    return float(above[known].mean()), float(correlated[known].mean())
