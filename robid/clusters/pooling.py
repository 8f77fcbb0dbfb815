"""How much parameters differ between clusters, those of all clusters together, and how far they may be off."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize
from scipy.special import erfcx
from scipy.stats import norm, t

from robid.arrays import BoolArray, FloatArray, IntArray, option
from robid.clusters.evidence import Evidence, inverted, saturated

_LOWEST = 1e-8  # smallest variance that is looked at, over the one where a search begins; below, it is zero
_SMALL = 1e-2  # variance over the one where a search begins, below which zero is tried
_ROUNDS = 3


@dataclass(frozen=True)
class BetweenOptions:
    """How variances between clusters are looked for."""

    largest: float = option(1.0, "Largest deviation between clusters, of a logarithm.", gt=0)
    iterations: int = option(200, "Iteration limit of the search.", ge=1)


@dataclass(frozen=True)
class Between:
    """How much parameters differ between clusters."""

    variance: FloatArray  # (n_param,) Of each parameter between clusters; 0 where noise explains the differences
    deviance: float  # -2 times the restricted log-likelihood there, but for a constant
    converged: bool  # Whether the search ended by itself


@dataclass(frozen=True)
class Search:
    """Evidence with all that does not change while some variances are sought.

    The rows of each cluster are turned so that what is sought is in the first ones alone.
    """

    rows: FloatArray  # (n_cluster, n_sought, n_param) Derivatives of these rows, what is known of differences taken out
    target: FloatArray  # (n_cluster, n_sought) What is left of them
    sought: IntArray  # (n_sought,) Which parameters' variances are sought
    information: FloatArray  # (n_param, n_param) Of all other rows, and what is known beforehand
    slope: FloatArray  # (n_param,) Of these too
    deviance: float  # Their share of -2 times the log-likelihood

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
        evidence: What each cluster says; what is known beforehand counts as one more observation.
        known (n_param,): Variances between clusters, zero for what is sought.
        sought (n_sought,): Which parameters' variances are sought.
    """
    rows = evidence.rows
    root = np.linalg.cholesky(np.eye(rows.shape[1]) + (rows * known) @ rows.swapaxes(1, 2))
    whole = np.linalg.solve(root, np.concatenate([rows, evidence.target[..., None]], axis=2))
    basis = np.linalg.qr(whole[..., sought], mode="complete")[0]
    turned = basis.swapaxes(1, 2) @ whole
    first, rest = turned[:, : sought.size], turned[:, sought.size :].reshape(-1, whole.shape[2])
    rest_rows, left = rest[:, :-1], rest[:, -1]
    return Search(
        rows=first[..., :-1],
        target=first[..., -1],
        sought=sought,
        information=evidence.precision + rest_rows.T @ rest_rows,
        slope=evidence.pull + left @ rest_rows,
        deviance=float((left**2).sum() + 2 * np.log(np.diagonal(root, axis1=1, axis2=2)).sum()),
    )


def restricted_deviance(evidence: Evidence, between: FloatArray) -> tuple[float, FloatArray]:
    """-2 times the restricted log-likelihood, but for a constant, and its derivative (n_param,) by the variances.

    The derivative is zero where each parameter's scores vary over clusters as they are expected to.

    Args:
        evidence: What each cluster says; what is known beforehand counts as one more observation.
        between (n_param,): Variance of each parameter between clusters.

    Source:
        Patterson and Thompson (1971); Jackson, Riley and White (2011), sec. 3.2.
    """
    return begin_search(evidence, np.zeros(between.size), np.arange(between.size)).at(between)


def estimate_between(
    evidence: Evidence, fixed: FloatArray | None = None, options: BetweenOptions | None = None
) -> Between:
    """Estimates how much each parameter differs between clusters.

    Args:
        evidence: What each cluster says.
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
    """Where the search begins: the variance at which a typical cluster's information is halved, within bounds."""
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


_SWEEPS = 50
_ARRIVED = 1e-6  # of a deviation
_DAMPING = 0.7
_FAR, _LITTLE = -1e4, -30.0  # deviations beyond a bound


def bounded_moments(mean: FloatArray, std: FloatArray, least: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Returns mean and variance of normal variables of which only what is at least a bound is left.

    Args:
        mean (n,): Means of the whole distributions.
        std (n,): Their standard deviations, above zero.
        least (n,): Bounds.
    """
    above = np.maximum((mean - least) / std, _FAR)
    ratio = np.sqrt(2 / np.pi) / erfcx(-above / np.sqrt(2))
    # The difference of large numbers, where little is left: 1 / above^2 to the next order.
    far = np.minimum(above, _LITTLE)
    left = np.where(above < _LITTLE, far**-2 - 6 * far**-4, 1 - ratio * (ratio + above))
    return np.asarray(least + std * (above + ratio)), np.asarray(np.clip(left, 0.0, 1.0) * std**2)


def bound(mean: FloatArray, covariance: FloatArray, least: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Finds what bounds say of a normal distribution, as if it had been observed: precision and pull of each quantity.

    The normal distribution with them has the mean and the variances that are left where all quantities are at least
    their bounds, as expectation propagation finds them.

    Args:
        mean (n,): Mean.
        covariance (n, n): Covariance.
        least (n,): Bounds; minus infinity for quantities without one.

    Returns:
        Precision and pull (n,), the precision times what was observed; zero without a bound.

    Source:
        Minka (2001); Cunningham, Hennig and Lacoste-Julien (2011), sec. 3.
    """
    own = np.flatnonzero(np.isfinite(least) & (np.diag(covariance) > 0))
    precision, pull = np.zeros(mean.size), np.zeros(mean.size)
    if not own.size:
        return precision, pull
    limit, known, start = least[own], covariance[np.ix_(own, own)], mean[own]
    tau, nu = np.zeros(own.size), np.zeros(own.size)
    for _ in range(_SWEEPS):
        # Of all sites together: (C^-1 + tau)^-1 without an inverse of C.
        gain = np.linalg.solve(np.eye(own.size) + known * tau, known)
        middle = gain @ nu + start - gain @ (tau * start)
        variance = np.diag(gain)
        cavity_precision = np.maximum(1 / variance - tau, 1e-12 / np.diag(known))
        cavity = (middle / variance - nu) / cavity_precision
        there, spread = bounded_moments(cavity, 1 / np.sqrt(cavity_precision), limit)
        new_tau = np.maximum(1 / spread - cavity_precision, 0.0)
        new_nu = there / spread - cavity * cavity_precision
        arrived = bool((np.abs(there - middle) <= _ARRIVED * np.sqrt(np.diag(known))).all())
        tau, nu = tau + _DAMPING * (new_tau - tau), nu + _DAMPING * (new_nu - nu)
        if arrived:
            break
    precision[own], pull[own] = tau, nu
    return precision, pull


_LEAST_FREEDOM = 1.0
ALONE = 0.9
"""Share of the information from which on it is a single cluster's."""


@dataclass(frozen=True)
class Pooled:
    """The parameters of all clusters together."""

    shift: FloatArray  # (n_param,) How far they lie from the point of the evidence
    between: FloatArray  # (n_param,) Variance of each between clusters
    assumed: FloatArray  # (n_param, n_param) Covariance, were noise and clusters' variances as assumed: `(sum K_c)^-1`
    covariance: FloatArray  # (n_param, n_param) The same by what the clusters really differ, whatever they differ by
    degrees_of_freedom: FloatArray  # (n_param,) Of Student's distribution that intervals follow
    # (n_param,) Share of the information about each that a single cluster gives; near 1 other clusters do not test it,
    # and its interval rests on that cluster alone
    dependence: FloatArray

    def spread(self, confidence: float) -> tuple[FloatArray, FloatArray]:
        """One covariance (n_param, n_param) and its degrees of freedom (n_param,), for the intervals of a level.

        Errors that are assumed but not there do not make clusters differ, so no interval is narrower than what is
        assumed gives; neither do the others test what a single cluster knows. What clusters differ by beyond what is
        assumed is added with its own correlations.
        """
        tail = 0.5 + 0.5 * confidence
        assumed, differing = np.diag(self.assumed), np.diag(self.covariance)
        reach = t.ppf(tail, self.degrees_of_freedom) * np.sqrt(differing), norm.ppf(tail) * np.sqrt(assumed)
        wider = (reach[0] > reach[1]) & ~self.untested
        size = np.where(wider, differing, 1.0)
        share = np.sqrt(np.where(wider, np.maximum(size - assumed, 0.0), 0.0) / size)
        both = self.assumed + self.covariance * np.outer(share, share)
        # Few degrees of freedom make an interval the wider one with the smaller variance.
        shrink = np.sqrt(np.where(wider, size / np.maximum(size, assumed), 1.0))
        return both * np.outer(shrink, shrink), np.where(wider, self.degrees_of_freedom, np.inf)

    def reach(self, confidence: float) -> FloatArray:
        """Half width (n_param,) of the intervals of a level."""
        covariance, freedom = self.spread(confidence)
        return np.asarray(t.ppf(0.5 + 0.5 * confidence, freedom) * np.sqrt(np.diag(covariance)))

    @property
    def untested(self) -> BoolArray:
        """Which parameters (n_param,) a single cluster knows."""
        return np.asarray(self.dependence > ALONE)


def pool(evidence: Evidence, between: FloatArray, least: FloatArray | None = None) -> Pooled:
    """Brings the clusters together.

    Each cluster's weight is what noise and differences between them leave of its information. The covariance is that
    of leaving out one cluster after the other, so it holds whatever the differences come from, as long as they are
    independent; what is known beforehand errs by as much as it says.

    Args:
        evidence: What each cluster says.
        between (n_param,): Variance of each parameter between clusters.
        least (n_param,): Smallest shift that makes sense, what is left of a distribution beyond which is as if it had
            been observed; all make sense when not given.

    Source:
        CR3 of Bell and McCaffrey (2002); degrees of freedom as in Pustejovsky and Tipton (2018), sec. 3.1, of each
        parameter alone.
    """
    own = saturated(evidence, between)
    total = own.information.sum(axis=0) + evidence.precision
    assumed, _ = inverted(total)
    shift = assumed @ (own.score.sum(axis=0) + evidence.pull)
    if least is not None and np.isfinite(least).any():
        precision, pull = bound(shift, assumed, least)
        bounded = replace(evidence, precision=evidence.precision + np.diag(precision), pull=evidence.pull + pull)
        return pool(bounded, between)
    left = own.score - own.information @ shift
    without = np.array([inverted(total - each)[0] for each in own.information])
    moved = np.einsum("cij,cj->ci", without, left)
    known = assumed @ evidence.precision @ assumed
    covariance = moved.T @ moved + known
    scale = np.diagonal(without, axis1=1, axis2=2)
    share = 1 - np.divide(np.diag(assumed), scale, out=np.zeros_like(scale), where=scale > 0)
    freedom = _freedom(own.information, without, assumed, np.diag(known))
    return Pooled(shift, between, assumed, np.asarray(covariance), freedom, np.asarray(share.max(axis=0)))


def _freedom(information: FloatArray, without: FloatArray, assumed: FloatArray, known: FloatArray) -> FloatArray:
    """Degrees of freedom (n_param,) of the diagonal of the covariance, noise and clusters as assumed.

    Each variance is a sum of squares of linear forms, one a cluster; its first two moments are those of their
    covariance.

    Args:
        information (n_cluster, n_param, n_param): What each cluster says.
        without (n_cluster, n_param, n_param): Covariance that leaving it out would leave.
        assumed (n_param, n_param): Covariance of all together.
        known (n_param,): Variance that does not come from the clusters.
    """
    pulls = without @ information  # (cluster, wanted, param): what each cluster's score does to each parameter
    own = np.einsum("cij,cij->ic", pulls, without)
    mixed = -np.einsum("cik,kl,dil->icd", pulls, assumed, pulls, optimize=True)
    index = np.arange(len(information))
    mixed[:, index, index] += own
    mean = np.trace(mixed, axis1=1, axis2=2) + known
    square = (mixed**2).sum(axis=(1, 2))
    found = np.divide(mean**2, square, out=np.full_like(mean, np.inf), where=square > 0)
    return np.asarray(np.maximum(found, _LEAST_FREEDOM))
