"""Individuals of a robot that a study measures: what differs surely over them, and what fits state of each."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm
from scipy.stats import t as student

from robid.arrays import FloatArray

_TIE_LEVEL = 0.95


def ratio_interval(one: FloatArray, other: FloatArray) -> tuple[float, float]:
    """The 95 % interval of the geometric mean ratio of two figures over the individuals, which both were measured on.

    Args:
        one (n_seed,): Figures of one model, above 0.
        other (n_seed,): Those of another.

    Returns:
        Its ends, by the t distribution; 0 and infinity with one individual.
    """
    ratio = np.log(one / other)
    if ratio.size < 2:
        return 0.0, float("inf")
    reach = student.ppf(0.5 + 0.5 * _TIE_LEVEL, ratio.size - 1) * ratio.std(ddof=1) / np.sqrt(ratio.size)
    return float(np.exp(ratio.mean() - reach)), float(np.exp(ratio.mean() + reach))


def differs(one: FloatArray, other: FloatArray) -> bool:
    """Tells whether two figures (n_seed,) differ by more than chance over the individuals, see `ratio_interval`."""
    low, high = ratio_interval(one, other)
    return low > 1 or high < 1


def stated_std(lower: FloatArray, upper: FloatArray, confidence: float) -> FloatArray:
    """Deviation (n_param,) of each parameter's logarithm whose normal interval is as wide as that of a fit.

    Args:
        lower (n_param,): Lower ends of the fit's intervals; they need not lie around the estimated values.
        upper (n_param,): Upper ends.
        confidence: Their level.

    Returns:
        The deviations; NaN where the interval does not lie above 0.
    """
    ratio = np.divide(upper, lower, out=np.full(lower.shape, np.nan), where=lower > 0)
    return np.asarray(np.log(ratio) / (2 * norm.ppf(0.5 + 0.5 * confidence)))
