"""Quantities that cannot be negative: what is left of a normal distribution where each is at least its bound."""

from __future__ import annotations

import numpy as np
from scipy.special import erfcx

from robid.arrays import FloatArray

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
