"""How much parameters differ between places, by restricted maximum likelihood."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import minimize

from robid.arrays import BoolArray, FloatArray
from robid.places.evidence import Evidence
from robid.places.saturation import inverted, saturated

_LOWEST = 1e-8
"""Smallest variance that is looked at, over the one where a search begins; below, it is zero."""
_SMALL = 1e-2
"""Variance over the one where a search begins, below which zero is tried."""
_ROUNDS = 3


@dataclass(frozen=True)
class BetweenOptions:
    """How variances between places are looked for."""

    largest: float = field(
        default=1.0, metadata={"description": "Largest deviation between places, of a logarithm.", "gt": 0}
    )
    iterations: int = field(default=200, metadata={"description": "Iteration limit of the search.", "ge": 1})


@dataclass(frozen=True)
class Between:
    """How much parameters differ between places.

    Attributes:
        variance (n_param,): Of each parameter between places; 0 where noise explains the differences.
        deviance: -2 times the restricted log-likelihood there, but for a constant.
        converged: Whether the search ended by itself.
    """

    variance: FloatArray
    deviance: float
    converged: bool


def restricted_deviance(evidence: Evidence, between: FloatArray) -> tuple[float, FloatArray]:
    """-2 times the restricted log-likelihood, but for a constant, and its derivative (n_param,) by the variances.

    The derivative is zero where each parameter's scores vary over places as they are expected to.

    Args:
        evidence: What each place says; what is known beforehand counts as one more observation.
        between (n_param,): Variance of each parameter between places.

    Source:
        Patterson and Thompson (1971); Jackson, Riley and White (2011), sec. 3.2.
    """
    own = saturated(evidence, between)
    total = own.information.sum(axis=0) + evidence.precision
    slope = own.score.sum(axis=0) + evidence.pull
    covariance, logarithm = inverted(total)
    shift = covariance @ slope
    value = own.log_determinant.sum() + own.square.sum() - slope @ shift + logarithm
    left = own.score - own.information @ shift
    spread = ((own.information @ covariance) * own.information).sum(axis=2)
    expected = np.diagonal(own.information, axis1=1, axis2=2) - spread
    return float(value), np.asarray((expected - left**2).sum(axis=0))


def estimate_between(
    evidence: Evidence, fixed: FloatArray | None = None, options: BetweenOptions | None = None
) -> Between:
    """Estimates how much each parameter differs between places.

    Args:
        evidence: What each place says.
        fixed (n_param,): Variances that are known, NaN where they are sought; all are sought when not given.
        options: Bounds and limits.
    """
    limits = options or BetweenOptions()
    n_param = len(evidence.pull)
    known = np.full(n_param, np.nan) if fixed is None else fixed
    seen = np.diagonal(evidence.information, axis1=1, axis2=2)
    sought = np.isnan(known) & (seen.sum(axis=0) > 0)
    start = np.where(sought, _start(seen, limits.largest), np.where(np.isnan(known), 0.0, known))
    if not sought.any():
        return Between(start, restricted_deviance(evidence, start)[0], converged=True)
    unit, now, alive = start.copy(), start.copy(), sought.copy()
    low, high = np.log(_LOWEST), np.log(np.maximum(limits.largest**2 / np.where(sought, unit, 1.0), 1.0))
    converged = True
    for _ in range(_ROUNDS):
        now, converged = _search(evidence, now, alive, unit, (low, high), limits.iterations)
        # On its way to zero a logarithm never arrives; a variance that did comes back where the deviance falls with it.
        now = _without_small(evidence, now, sought & (now < _SMALL * unit))
        slope = restricted_deviance(evidence, now)[1]
        back = sought & (now == 0) & (slope * unit < -1e-3)
        if not back.any():
            break
        alive = sought & ((now > 0) | back)
        now = np.where(back, 1e-2 * unit, now)
    return Between(now, restricted_deviance(evidence, now)[0], converged)


def _without_small(evidence: Evidence, between: FloatArray, small: BoolArray) -> FloatArray:
    """Sets small variances to zero, those that the deviance rises without left as they are."""
    gone = np.where(small, 0.0, between)
    slope = restricted_deviance(evidence, gone)[1]
    return np.where(small & (slope < 0), between, gone)


def _start(seen: FloatArray, largest: float) -> FloatArray:
    """Where the search begins: the variance at which a typical place's information is halved, within bounds."""
    count = np.maximum((seen > 0).sum(axis=0), 1)
    typical = np.exp(np.log(np.where(seen > 0, seen, 1.0)).sum(axis=0) / count)
    return np.asarray(np.minimum(1 / typical, 0.25 * largest**2))


def _search(
    evidence: Evidence,
    start: FloatArray,
    alive: FloatArray,
    unit: FloatArray,
    bounds: tuple[float, FloatArray],
    iterations: int,
) -> tuple[FloatArray, bool]:
    """Descends over the logarithms of the variances that are alive."""
    low, high = bounds
    where = np.flatnonzero(alive)

    def both(logarithm: FloatArray) -> tuple[float, FloatArray]:
        variance = start.copy()
        variance[where] = unit[where] * np.exp(logarithm)
        value, slope = restricted_deviance(evidence, variance)
        return value, slope[where] * variance[where]

    begin = np.clip(np.log(start[where] / unit[where]), low, high[where])
    limits = [(low, top) for top in high[where].tolist()]
    options = {"maxiter": iterations, "ftol": 1e-11, "gtol": 1e-4}
    end = minimize(both, begin, jac=True, method="L-BFGS-B", bounds=limits, options=options)
    found = start.copy()
    found[where] = unit[where] * np.exp(end.x)
    return found, bool(end.success)
