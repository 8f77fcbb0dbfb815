"""Individuals of a robot that a study measures: what fits state of each, how estimates scatter, what differs surely."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
from scipy.stats import gmean, norm
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


Mean: TypeAlias = Literal["average", "typical"]
"""Arithmetic or geometric mean over springs: a spring that no data can tell outweighs all others in the first."""

_LEVEL = 0.95


def over_springs(values: FloatArray, mean: Mean) -> FloatArray:
    """Mean (...) of figures (..., n_param) over the parameters."""
    return np.asarray(values.mean(axis=-1) if mean == "average" else gmean(values, axis=-1))


def scatter(error: FloatArray, mean: Mean) -> float:
    """Standard deviation of each parameter's error over all samples, mean over the parameters.

    Args:
        error (n_seed, n_set, n_param): Logarithm of estimate over truth of each individual, from each of the sets of
            configurations that the model may have.
        mean: Which mean.

    Returns:
        The scatter; NaN of a single sample.
    """
    samples = error.reshape(-1, error.shape[-1])
    return float(over_springs(samples.std(axis=0, ddof=1), mean)) if len(samples) > 1 else float("nan")


def scatter_error(error: FloatArray, mean: Mean) -> float:
    """Standard error of the logarithm of the scatter, by leaving out one individual after the other.

    Args:
        error (n_seed, n_set, n_param): As for `scatter`.
        mean: Which mean.

    Returns:
        The error; NaN of fewer than three individuals.
    """
    return _jackknife(np.array([np.log(scatter(np.delete(error, out, axis=0), mean)) for out in _seeds(error)]))


def scatters_differ(one: FloatArray, other: FloatArray, mean: Mean) -> bool:
    """Tells whether two models scatter differently by more than chance over the individuals, which both share.

    Args:
        one (n_seed, n_set, n_param): Errors of one model, as for `scatter`.
        other (n_seed, n_other, n_param): Those of another.
        mean: Which mean.

    Returns:
        Whether 0 lies outside the 95 % interval of the logarithm of their ratio; never of fewer than three individuals.
    """

    def log_ratio(one: FloatArray, other: FloatArray) -> float:
        return float(np.log(scatter(one, mean) / scatter(other, mean)))

    ratio = [log_ratio(np.delete(one, out, axis=0), np.delete(other, out, axis=0)) for out in _seeds(one)]
    if len(ratio) == 0:
        return False
    reach = student.ppf(0.5 + 0.5 * _LEVEL, len(one) - 1) * _jackknife(np.array(ratio))
    return bool(abs(log_ratio(one, other)) > reach)


def _seeds(error: FloatArray) -> range:
    return range(len(error) if len(error) > 2 else 0)


def _jackknife(values: FloatArray) -> float:
    count = values.size
    return float(np.sqrt((count - 1) * values.var())) if count else float("nan")
