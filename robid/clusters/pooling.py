"""The parameters of all places together, and how far they may be off by what differs between places."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import erfcx
from scipy.stats import norm, t

from robid.arrays import BoolArray, FloatArray
from robid.clusters.evidence import Evidence, inverted, saturated

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
"""Share of the information from which on it is a single place's."""


@dataclass(frozen=True)
class Pooled:
    """The parameters of all places together.

    Attributes:
        shift (n_param,): How far they lie from the point of the evidence.
        between (n_param,): Variance of each between places.
        assumed (n_param, n_param): Covariance, were noise and variances between places as assumed: `(sum K_c)^-1`.
        covariance (n_param, n_param): The same by what the places really differ, whatever they differ by.
        degrees_of_freedom (n_param,): Of Student's distribution, whose quantile times the deviation is an interval.
        dependence (n_param,): Share of the information about each that a single place gives; near 1 other places
            do not test it, and its interval rests on that place alone.
    """

    shift: FloatArray
    between: FloatArray
    assumed: FloatArray
    covariance: FloatArray
    degrees_of_freedom: FloatArray
    dependence: FloatArray

    def spread(self, confidence: float) -> tuple[FloatArray, FloatArray]:
        """One covariance (n_param, n_param) and its degrees of freedom (n_param,), for the intervals of a level.

        Errors that are assumed but not there do not make places differ, so no interval is narrower than what is
        assumed gives; neither do the others test what a single place knows. What places differ by beyond what is
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
        """Which parameters (n_param,) a single place knows."""
        return np.asarray(self.dependence > ALONE)


def pool(evidence: Evidence, between: FloatArray, least: FloatArray | None = None) -> Pooled:
    """Brings the places together.

    Each place's weight is what noise and differences between places leave of its information. The covariance is that
    of leaving out one place after the other, so it holds whatever the differences come from, as long as they are
    independent; what is known beforehand errs by as much as it says.

    Args:
        evidence: What each place says.
        between (n_param,): Variance of each parameter between places.
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
    """Degrees of freedom (n_param,) of the diagonal of the covariance, noise and places as assumed.

    Each variance is a sum of squares of linear forms, one a place; its first two moments are those of their
    covariance.

    Args:
        information (n_place, n_param, n_param): What each place says.
        without (n_place, n_param, n_param): Covariance that leaving it out would leave.
        assumed (n_param, n_param): Covariance of all together.
        known (n_param,): Variance that does not come from the places.
    """
    pulls = without @ information  # (place, wanted, param): what each place's score does to each parameter
    own = np.einsum("cij,cij->ic", pulls, without)
    mixed = -np.einsum("cik,kl,dil->icd", pulls, assumed, pulls, optimize=True)
    index = np.arange(len(information))
    mixed[:, index, index] += own
    mean = np.trace(mixed, axis1=1, axis2=2) + known
    square = (mixed**2).sum(axis=(1, 2))
    found = np.divide(mean**2, square, out=np.full_like(mean, np.inf), where=square > 0)
    return np.asarray(np.maximum(found, _LEAST_FREEDOM))
