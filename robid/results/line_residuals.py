"""Residuals of a modelled response line by line: relative to it, and in the deviations that are expected of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray


@dataclass(frozen=True)
class LineResiduals:
    """Sizes of residuals, each (n_conf, n_freq, n_out, n_in); NaN where an element does not count or none is known."""

    relative: FloatArray  # Measured less modelled response, over the modelled one
    noise: FloatArray  # Standard deviation of the measured response, over the modelled one
    # The residual as a fit weighs it, over the standard deviation that its weights allow for; 1 is expected
    deviations: FloatArray
    noise_deviations: FloatArray  # The part of that deviation that is noise; 1 or NaN where it is all of it


def compare_lines(measured: ComplexArray, modelled: ComplexArray, std: FloatArray) -> LineResiduals:
    """Compares responses (n_conf, n_freq, n_out, n_in) where nothing but noise is allowed for.

    `std` is the root of `E|error|^2` of the measured one, NaN where it is unknown, infinite where an element is left
    out.
    """
    size = np.where((modelled == 0) | np.isinf(std), np.nan, np.abs(modelled))
    known = np.where(std > 0, std, np.nan)
    residual = np.where(np.isnan(size), np.nan, np.abs(measured - modelled))
    return LineResiduals(residual / size, known / size, residual / known, np.full(size.shape, np.nan))


def root_mean_square(values: FloatArray, axis: tuple[int, ...]) -> FloatArray:
    """Root mean square over some axes of what is known; NaN where nothing is."""
    known = np.isfinite(values)
    total, count = (np.where(known, values, 0.0) ** 2).sum(axis=axis), known.sum(axis=axis)
    return np.asarray(np.sqrt(np.divide(total, count, out=np.full(count.shape, np.nan), where=count > 0)))
