"""How much estimates of the models scatter about the truth, over individuals of the robot."""

from __future__ import annotations

import numpy as np
from scipy.stats import gmean
from scipy.stats import t as student

from robid.arrays import FloatArray

_LEVEL = 0.95


def scatter(error: FloatArray) -> float:
    """Standard deviation of each parameter's error over all samples, geometric mean over the parameters.

    One that no data can tell would outweigh all others in a plain mean.

    Args:
        error (n_seed, n_set, n_param): Logarithm of estimate over truth of each individual, from each of the sets of
            configurations that the model may have.

    Returns:
        The scatter; NaN of a single sample.
    """
    samples = error.reshape(-1, error.shape[-1])
    return float(gmean(samples.std(axis=0, ddof=1))) if len(samples) > 1 else float("nan")


def scatter_error(error: FloatArray) -> float:
    """Standard error of the logarithm of the scatter, by leaving out one individual after the other.

    Args:
        error (n_seed, n_set, n_param): As for `scatter`.

    Returns:
        The error; NaN of fewer than three individuals.
    """
    return _jackknife(np.array([np.log(scatter(np.delete(error, out, axis=0))) for out in _seeds(error)]))


def scatters_differ(one: FloatArray, other: FloatArray) -> bool:
    """Tells whether two models scatter differently by more than chance over the individuals, which both share.

    Args:
        one (n_seed, n_set, n_param): Errors of one model, as for `scatter`.
        other (n_seed, n_other, n_param): Those of another.

    Returns:
        Whether 0 lies outside the 95 % interval of the logarithm of their ratio; never of fewer than three individuals.
    """
    ratio = [
        np.log(scatter(np.delete(one, out, axis=0)) / scatter(np.delete(other, out, axis=0))) for out in _seeds(one)
    ]
    if len(ratio) == 0:
        return False
    reach = student.ppf(0.5 + 0.5 * _LEVEL, len(one) - 1) * _jackknife(np.array(ratio))
    return bool(abs(np.log(scatter(one) / scatter(other))) > reach)


def _seeds(error: FloatArray) -> range:
    return range(len(error) if len(error) > 2 else 0)


def _jackknife(values: FloatArray) -> float:
    count = values.size
    return float(np.sqrt((count - 1) * values.var())) if count else float("nan")
