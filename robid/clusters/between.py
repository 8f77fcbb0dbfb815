"""How much parameters differ between places, by restricted maximum likelihood."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import minimize

from robid.arrays import BoolArray, FloatArray, IntArray
from robid.clusters.evidence import Evidence, inverted

_LOWEST = 1e-8  # smallest variance that is looked at, over the one where a search begins; below, it is zero
_SMALL = 1e-2  # variance over the one where a search begins, below which zero is tried
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


@dataclass(frozen=True)
class Search:
    """Evidence with all that does not change while some variances are sought.

    The rows of each place are turned so that what is sought is in the first ones alone.

    Attributes:
        rows (n_place, n_sought, n_param): Derivatives of these rows, what is known of differences taken out.
        target (n_place, n_sought): What is left of them.
        sought (n_sought,): Which parameters' variances are sought.
        information (n_param, n_param): Of all other rows, and what is known beforehand.
        slope (n_param,): Of these too.
        deviance: Their share of -2 times the log-likelihood.
    """

    rows: FloatArray
    target: FloatArray
    sought: IntArray
    information: FloatArray
    slope: FloatArray
    deviance: float

    def at(self, variance: FloatArray) -> tuple[float, FloatArray]:
        """Returns the restricted deviance and its derivative (n_sought,) by the variances that are sought."""
        own = self.rows[..., self.sought]
        covariance = np.eye(self.sought.size) + (own * variance) @ own.swapaxes(1, 2)
        root = np.linalg.cholesky(covariance)
        whole = np.linalg.solve(root, np.concatenate([self.rows, self.target[..., None]], axis=2))
        weighted, left = whole[..., :-1], whole[..., -1]
        flat = weighted.reshape(-1, weighted.shape[2])
        slope = self.slope + left.ravel() @ flat
        inverse, logarithm = inverted(self.information + flat.T @ flat)
        shift = inverse @ slope
        value = (left**2).sum() - slope @ shift + logarithm + self.deviance
        value += 2 * np.log(np.diagonal(root, axis1=1, axis2=2)).sum()
        seen = weighted[..., self.sought]
        leverage = np.eye(self.sought.size) - weighted @ inverse @ weighted.swapaxes(1, 2)
        pull = ((left - weighted @ shift)[:, None] @ seen)[:, 0]
        return float(value), np.asarray(((leverage @ seen) * seen).sum(axis=(0, 1)) - (pull**2).sum(axis=0))


def begin_search(evidence: Evidence, known: FloatArray, sought: IntArray) -> Search:
    """Takes out of evidence what does not change while variances are sought.

    Args:
        evidence: What each place says; what is known beforehand counts as one more observation.
        known (n_param,): Variances between places, zero for what is sought.
        sought (n_sought,): Which parameters' variances are sought.
    """
    rows = evidence.rows
    root = np.linalg.cholesky(np.eye(rows.shape[1]) + (rows * known) @ rows.swapaxes(1, 2))
    whole = np.linalg.solve(root, np.concatenate([rows, evidence.target[..., None]], axis=2))
    basis = np.linalg.qr(whole[..., sought], mode="complete")[0]
    turned = basis.swapaxes(1, 2) @ whole
    first, rest = turned[:, : sought.size], turned[:, sought.size :].reshape(-1, whole.shape[2])
    told, left = rest[:, :-1], rest[:, -1]
    return Search(
        rows=first[..., :-1],
        target=first[..., -1],
        sought=sought,
        information=evidence.precision + told.T @ told,
        slope=evidence.pull + left @ told,
        deviance=float((left**2).sum() + 2 * np.log(np.diagonal(root, axis1=1, axis2=2)).sum()),
    )


def restricted_deviance(evidence: Evidence, between: FloatArray) -> tuple[float, FloatArray]:
    """-2 times the restricted log-likelihood, but for a constant, and its derivative (n_param,) by the variances.

    The derivative is zero where each parameter's scores vary over places as they are expected to.

    Args:
        evidence: What each place says; what is known beforehand counts as one more observation.
        between (n_param,): Variance of each parameter between places.

    Source:
        Patterson and Thompson (1971); Jackson, Riley and White (2011), sec. 3.2.
    """
    return begin_search(evidence, np.zeros(between.size), np.arange(between.size)).at(between)


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
    where = np.flatnonzero(sought)
    search = begin_search(evidence, np.where(sought, 0.0, start), where)
    unit, now, alive = start[where], start[where], np.full(where.size, fill_value=True)
    bounds = np.log(_LOWEST), np.log(np.maximum(limits.largest**2 / unit, 1.0))
    converged = True
    for _ in range(_ROUNDS):
        now, converged = _search(search, now, alive, unit, bounds, limits.iterations)
        # On its way to zero a logarithm never arrives; a variance that did comes back where the deviance falls with it.
        now = _without_small(search, now, now < _SMALL * unit)
        back = (now == 0) & (search.at(now)[1] * unit < -1e-3)
        if not back.any():
            break
        alive = (now > 0) | back
        now = np.where(back, 1e-2 * unit, now)
    start[where] = now
    return Between(start, search.at(now)[0], converged)


def _without_small(search: Search, between: FloatArray, small: BoolArray) -> FloatArray:
    """Sets small variances to zero, those that the deviance rises without left as they are."""
    gone = np.where(small, 0.0, between)
    slope = search.at(gone)[1]
    return np.where(small & (slope < 0), between, gone)


def _start(seen: FloatArray, largest: float) -> FloatArray:
    """Where the search begins: the variance at which a typical place's information is halved, within bounds."""
    count = np.maximum((seen > 0).sum(axis=0), 1)
    typical = np.exp(np.log(np.where(seen > 0, seen, 1.0)).sum(axis=0) / count)
    return np.asarray(np.minimum(1 / typical, 0.25 * largest**2))


def _search(
    search: Search,
    start: FloatArray,
    alive: BoolArray,
    unit: FloatArray,
    bounds: tuple[float, FloatArray],
    iterations: int,
) -> tuple[FloatArray, bool]:
    """Descends over the logarithms of the variances (n_sought,) that are alive."""
    low, high = bounds

    def both(logarithm: FloatArray) -> tuple[float, FloatArray]:
        variance = start.copy()
        variance[alive] = unit[alive] * np.exp(logarithm)
        value, slope = search.at(variance)
        return value, slope[alive] * variance[alive]

    begin = np.clip(np.log(start[alive] / unit[alive]), low, high[alive])
    limits = [(low, top) for top in high[alive].tolist()]
    options = {"maxiter": iterations, "ftol": 1e-11, "gtol": 1e-4}
    end = minimize(both, begin, jac=True, method="L-BFGS-B", bounds=limits, options=options)
    found = start.copy()
    found[alive] = unit[alive] * np.exp(end.x)
    return found, bool(end.success)
