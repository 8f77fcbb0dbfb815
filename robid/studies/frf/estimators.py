"""Estimates of a frequency response, made many times, against a reference: scatter, bias and honesty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robid.arrays import ComplexArray, FloatArray


@dataclass(frozen=True)
class Scatter:
    """How one estimator's estimates lie about a reference, per configuration, line and element.

    Every field has the shape (n_conf, n_freq, n_out, n_in); NaN where fewer than two estimates were made.

    Attributes:
        error: Root mean square over the estimates of `|G_hat - G_ref| / |G_ref|`.
        bias: `|mean(G_hat) - G_ref| / |G_ref|`.
        std_ratio: Root of the mean reported variance over the standard deviation of the estimates.
    """

    error: FloatArray
    bias: FloatArray
    std_ratio: FloatArray


def scatter(estimates: ComplexArray, variance: FloatArray, reference: ComplexArray) -> Scatter:
    """Compares estimates with a reference and their spread with what they report.

    Args:
        estimates (n_conf, n_estimate, n_freq, n_out, n_in): Independent estimates; NaN where one was refused.
        variance (n_conf, n_estimate, n_freq, n_out, n_in): Variance that each reports, `E|G_hat - G|^2`.
        reference (n_conf, n_freq, n_out, n_in): What they should be.
    """
    count = np.isfinite(estimates).sum(axis=1)
    enough = count > 1
    mean = _mean(estimates, count)
    size = np.abs(reference)
    error = np.sqrt(_mean(np.abs(estimates - reference[:, None]) ** 2, count)) / size
    spread = _mean(np.abs(estimates - mean[:, None]) ** 2, count) * count / np.maximum(count - 1, 1)
    reported = _mean(variance, count)
    ratio = np.sqrt(np.divide(reported, spread, out=np.full_like(spread, np.nan), where=enough & (spread > 0)))
    return Scatter(np.where(enough, error, np.nan), np.where(enough, np.abs(mean / reference - 1), np.nan), ratio)


def error_ratio(
    first: ComplexArray, second: ComplexArray, reference: ComplexArray, *, draws: int = 200, seed: int = 1
) -> tuple[float, float, float]:
    """Median error of one estimator over another's, with the 95 % interval of a bootstrap over the estimates.

    Args:
        first (n_conf, n_estimate, n_freq, n_out, n_in): Estimates from the same data as `second`.
        second (n_conf, n_estimate, n_freq, n_out, n_in): Estimates to compare with.
        reference (n_conf, n_freq, n_out, n_in): What both should be.
        draws: Bootstrap draws.
        seed: Their seed.

    Returns:
        Ratio, lower and upper end; NaN where the two share no estimate.
    """
    both = np.isfinite(first).all(axis=(0, 2, 3, 4)) & np.isfinite(second).all(axis=(0, 2, 3, 4))
    if both.sum() < 2:
        return np.nan, np.nan, np.nan
    size = np.abs(reference[:, None])
    squares = [
        np.moveaxis((np.abs(each[:, both] - reference[:, None]) / size) ** 2, 1, 0).reshape(both.sum(), -1)
        for each in (first, second)
    ]

    def ratio(weights: FloatArray) -> float:
        ours, theirs = (np.median(np.sqrt(weights @ square)) for square in squares)
        return float(ours / theirs)

    count = int(both.sum())
    weights = np.random.default_rng(seed).multinomial(count, np.full(count, 1 / count), draws) / count
    ends = np.quantile([ratio(row) for row in weights], [0.025, 0.975])
    return ratio(np.full(count, 1 / count)), float(ends[0]), float(ends[1])


def elements(values: FloatArray, *, diagonal: bool) -> FloatArray:
    """Returns the elements on the diagonal, or those off it, with the two matrix axes flattened to one."""
    row, column = np.indices(values.shape[-2:])
    return np.asarray(values[..., (row == column) if diagonal else (row != column)])


def _mean(values: ComplexArray | FloatArray, count: NDArray[np.int_]) -> ComplexArray | FloatArray:
    return np.asarray(np.where(np.isfinite(values), values, 0).sum(axis=1) / np.maximum(count, 1))
