"""What the models reached from many starts have in common."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, FloatArray


@dataclass(frozen=True)
class StartSpread:
    """Statistics of parameters over models, each parameter divided by the best model's.

    Attributes:
        minimum (n_param,): Smallest value.
        median (n_param,): Median.
        maximum (n_param,): Largest value.
        mean (n_param,): Mean.
        std (n_param,): Standard deviation; 0 for a single model.
        count: Number of models.
    """

    minimum: FloatArray
    median: FloatArray
    maximum: FloatArray
    mean: FloatArray
    std: FloatArray
    count: int


def spread(values: FloatArray, best: FloatArray) -> StartSpread:
    """Returns the statistics of models near the best one.

    Args:
        values (n_model, n_param): Their parameters.
        best (n_param,): The best model's, none of them zero.

    Source:
        Wernholt and Moberg (2008), Table 1.
    """
    relative = values / best
    return StartSpread(
        minimum=relative.min(axis=0),
        median=np.asarray(np.median(relative, axis=0)),
        maximum=relative.max(axis=0),
        mean=relative.mean(axis=0),
        std=relative.std(axis=0, ddof=1) if len(values) > 1 else np.zeros(values.shape[1]),
        count=len(values),
    )


def within_factor(values: FloatArray, best: FloatArray, factor: float) -> BoolArray:
    """Tells which parameters (n_model, n_param) lie within a factor of the best model's, ends included."""
    relative = values / best
    return np.asarray((relative >= 1 / factor) & (relative <= factor))


def shares_differ(first: float, second: float, count: int) -> bool:
    """Tells whether one share of starts is larger than another by more than two standard errors.

    Args:
        first: The share that should be larger.
        second: The other.
        count: Number of starts behind each.
    """
    variance = (first * (1 - first) + second * (1 - second)) / count
    return first - second > 2 * float(np.sqrt(variance))
