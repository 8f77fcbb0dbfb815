"""What several families conclude alike: parameters from roots, grades and outcomes from findings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm, t

from robid.arrays import ComplexArray, FloatArray
from robid.errors import DataError
from robid.results.estimate import Estimate
from robid.results.finding import Finding
from robid.results.grade import Grade, forbidding, grade_alone, grade_held, ordered, undetermined_names, weakening
from robid.results.outcome import Outcome, recover

_LEAST_DAMPING = 0.05


@dataclass(frozen=True)
class Row:
    """A parameter that was computed from a model's coefficients."""

    name: str
    kind: str
    unit: str
    value: float
    scale: float  # what its relative deviation is related to
    moves: FloatArray  # its slope by each coefficient, or what each column of a root of their covariance moves it by
    reachable: bool = True  # whether it lies below half the sampling rate


def root_rows(
    name: str, kind: str, place: complex, moves: ComplexArray, *, is_real: bool, reachable: bool = True
) -> list[Row]:
    """Describes a real root by its rate, positive in the left half plane, a pair by frequency and damping ratio.

    The root is at `place`, that with positive imaginary part of a pair [rad/s]; `moves` (n,) are as of `Row`.
    """
    size = abs(place)
    if is_real:
        return [Row(name, kind, "rad/s", -place.real, size, -moves.real, reachable)]
    # w = |s|, so that dw = Re(conj(s) ds) / w; zeta = -Re(s) / w, so that dzeta = -(Re(ds) + zeta dw) / w.
    along, damping = (np.conj(place) * moves).real / size, -place.real / size
    turned = -(moves.real + damping * along) / size
    # A damping ratio near zero is known well when it is known to a share of a usual one.
    usual = max(abs(damping), _LEAST_DAMPING)
    return [
        Row(f"{name}.frequency", f"{kind}_frequency", "rad/s", size, size, along, reachable),
        Row(f"{name}.damping", f"{kind}_damping", "1", damping, usual, turned, reachable),
    ]


def estimate_of_rows(
    rows: Sequence[Row],
    covariance: FloatArray,
    rule: str,
    status: str,
    advice: str,
    *,
    confidence: float,
    identifiable_relative_std: float,
    undetermined: Sequence[str] = (),
    degrees_of_freedom: FloatArray | None = None,
) -> Estimate:
    """Puts parameters together with intervals by their covariance (n_param, n_param); none was known before.

    These are normal, or Student's where its `degrees_of_freedom` (n_param,) are finite.
    """
    value, scale = (np.array([getattr(row, key) for row in rows], float) for key in ("value", "scale"))
    nowhere = np.full(len(rows), np.inf)
    freedom = nowhere if degrees_of_freedom is None else degrees_of_freedom
    tail = 0.5 + 0.5 * confidence
    std, half = np.sqrt(np.maximum(np.diag(covariance), 0)), np.full(len(rows), norm.ppf(tail))
    half[np.isfinite(freedom)] = t.ppf(tail, freedom[np.isfinite(freedom)])
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.where(scale > 0, std / scale, np.inf)
    return Estimate(
        names=tuple(row.name for row in rows),
        kinds=tuple(row.kind for row in rows),
        units=tuple(row.unit for row in rows),
        nominal=np.full(len(rows), np.nan),
        value=value,
        lower=value - half * std,
        upper=value + half * std,
        covariance=covariance,
        degrees_of_freedom=freedom,
        confidence=confidence,
        interval_rule=rule,
        relative_std=relative,
        predicted_relative_std=relative,
        prior_relative_std=nowhere,
        relative_half_width=half * relative,
        identifiable=(relative <= identifiable_relative_std) & np.array([row.reachable for row in rows], bool),
        identifiable_relative_std=identifiable_relative_std,
        undetermined=tuple(undetermined),
        status=status,
        advice=advice,
    )


_SAME_RATE = 1e-6


def graded_alone(findings: Sequence[Finding], status: str) -> Grade:
    """Grades a fit that ended so by itself: it predicts at best."""
    every = ordered(findings)
    return grade_alone(forbidding(every, status), weakening(every), every)


def outcome_of(
    estimate: Estimate,
    findings: Sequence[Finding],
    failures: Sequence[str],
    verdict: str,
    truth: Mapping[str, float] | None = None,
) -> Outcome:
    """Grades a fit that was held against data that it never saw; findings are first to blame first."""
    every = ordered(findings)
    unusable = (*forbidding(every, estimate.status), *failures)
    grade = grade_held(unusable, weakening(every), every, undetermined_names(estimate))
    return Outcome(ok=not failures, verdict=verdict, grade=grade, recovery=recover(estimate, truth or {}))


def refuse_other_rate(own_s: float, new_s: Sequence[float]) -> None:
    """Refuses records of a validation whose sampling periods are not that of the fit [s].

    Raises:
        DataError: If there are such.
    """
    other = [period_s for period_s in new_s if abs(period_s / own_s - 1) > _SAME_RATE]
    if other:
        message = f"D259 the validation is sampled every {other[0]:g} s, the fit's record every {own_s:g} s"
        raise DataError(message, where="validation", remedy="validate on a record of the same sampling period")
