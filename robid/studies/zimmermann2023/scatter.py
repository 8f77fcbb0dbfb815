"""How much estimates of the models scatter about the truth, over individuals of the robot."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
from scipy.stats import gmean
from scipy.stats import t as student

from robid.arrays import FloatArray

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
