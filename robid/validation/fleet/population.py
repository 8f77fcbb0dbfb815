"""What a population of robots is like in one figure, whatever a minority of them shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.stats import norm, t

from robid.arrays import BoolArray, FloatArray

_HALF = float(norm.ppf(0.75))
_FAR = 3.0
_LEFT = 1 - 2 * _FAR * norm.pdf(_FAR) / (2 * norm.cdf(_FAR) - 1)
"""Variance of what a normal distribution has within these limits."""

_ROUNDS = 50
_ROUNDING = 1e-12


@dataclass(frozen=True)
class Population:
    """A figure of a population.

    Attributes:
        centre: Its mean.
        centre_std: Standard deviation of that.
        spread: Standard deviation of the figure itself between robots, errors of measurement apart.
        kept (n,): Which of the values it was found from.
        degrees_of_freedom: Robots among these less two: one for the centre, one for what was left out first.
        robots: Number of robots that it was found from.
    """

    centre: float
    centre_std: float
    spread: float
    kept: BoolArray
    degrees_of_freedom: float
    robots: int

    def away(self, value: FloatArray, std: FloatArray) -> FloatArray:
        """Returns by how many standard deviations values (n,) that are known to `std` (n,) are off the centre."""
        return np.asarray((value - self.centre) / np.sqrt(self.spread**2 + std**2 + self.centre_std**2))

    def chance(self, value: FloatArray, std: FloatArray, *, only_large: bool = False) -> FloatArray:
        """Returns the chance (n,) that a robot of this population is as far off, to both sides or above it alone."""
        away = self.away(value, std)
        if only_large:
            return np.asarray(t.sf(away, self.degrees_of_freedom))
        return np.asarray(2 * t.sf(np.abs(away), self.degrees_of_freedom))


def population(value: FloatArray, std: FloatArray, weight: FloatArray | None = None) -> Population:
    """Finds the centre and the spread of a population from values of known errors.

    Values are normal about the centre, with the variance of the population and that of their own error. The search
    begins with the weighted median and the spread for which half of the values lie within their quartiles; then values
    beyond three deviations are left out, and mean and variance of the others are those of maximum likelihood and of
    Paule and Mandel, corrected for what was cut off, until nothing changes.

    Args:
        value (n,): Values, logarithms where errors are relative.
        std (n,): Standard deviations of their errors.
        weight (n,): How much each counts; a robot that was measured several times counts once.

    Returns:
        The population; with less than three robots nothing is said to be outside.

    Source:
        Paule and Mandel (1982), J. Res. NBS 87; Rousseeuw and Leroy (1987), sec. 5.1, for the reweighting.
    """
    weight = np.ones(len(value)) if weight is None else weight
    std = np.maximum(std, _ROUNDING * max(float(np.abs(value).max(initial=0.0)), 1.0))
    centre = _median(value, weight)
    for _ in range(3):
        spread = _middle_spread(value - centre, std, weight)
        centre = _median(value, weight / np.sqrt(spread**2 + std**2))
    kept, centre_std = np.ones(len(value), bool), 0.0
    for _ in range(_ROUNDS):
        before = kept
        limit = _FAR * np.sqrt(spread**2 + std**2 + centre_std**2)
        kept = np.abs(value - centre) <= limit
        spread = _moment_spread(value[kept], std[kept], weight[kept])
        precision = weight[kept] / (spread**2 + std[kept] ** 2)
        centre = float(precision @ value[kept] / precision.sum())
        centre_std = float(
            np.sqrt((precision**2 / weight[kept] * (spread**2 + std[kept] ** 2)).sum()) / precision.sum()
        )
        if (kept == before).all():
            break
    freedom = max(float(weight[kept].sum()) - 2, 0.0)
    return Population(centre, centre_std, spread, kept, freedom, round(float(weight.sum())))


def _median(value: FloatArray, weight: FloatArray) -> float:
    order = np.argsort(value)
    share = np.cumsum(weight[order])
    first, last = (int(np.searchsorted(share, half * share[-1])) for half in (0.5 - 1e-12, 0.5 + 1e-12))
    return float(0.5 * (value[order[first]] + value[order[min(last, len(order) - 1)]]))


def _middle_spread(away: FloatArray, std: FloatArray, weight: FloatArray) -> float:
    """The spread for which half of the weight lies within the quartiles of its distribution."""

    def excess(spread: float) -> float:
        return _median(np.abs(away) / np.sqrt(spread**2 + std**2), weight) - _HALF

    most = float(np.abs(away).max(initial=0.0)) / _HALF
    least = 1e-9 * most
    return 0.0 if most == 0 or excess(least) <= 0 else float(brentq(excess, least, most, rtol=1e-6))


def _moment_spread(value: FloatArray, std: FloatArray, weight: FloatArray) -> float:
    """The spread for which the weighted squares about the mean are as many as there are degrees of freedom."""
    freedom = _LEFT * (weight.sum() - 1)
    if freedom <= 0:
        return 0.0

    def excess(spread: float) -> float:
        precision = weight / (spread**2 + std**2)
        mean = precision @ value / precision.sum()
        return float(precision @ (value - mean) ** 2 - freedom)

    most = float(np.ptp(value)) * np.sqrt(weight.sum() / freedom)
    least = 1e-9 * most
    return 0.0 if most == 0 or excess(least) <= 0 else float(brentq(excess, least, most, rtol=1e-9))
