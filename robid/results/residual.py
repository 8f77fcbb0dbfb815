"""What a fit leaves: measured less model, and that whitened."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from robid.arrays import ComplexArray, FloatArray


@dataclass(frozen=True)
class Residual:
    """Data of a fit, what its model says of them, and the difference.

    | kind | axes | what | whitened by |
    |---|---|---|---|
    | `elastic` | configuration, frequency, output, input | responses with the fitted friction | their covariance |
    | `lpv` | configuration, frequency, output, input | responses that were fitted | the deviation of each element |
    | `rigid` | row, joint | filtered torques by least squares, NaN where a row does not count | RMS of each joint |
    | `transmission` | row, gear | differences of the encoders | RMS of each gear |
    | `external` | row | motions, one output of one record after the other | RMS of each label |
    | `external` of a response | frequency, channel | responses, NaN where unknown | the deviation of each element |
    """

    measured: FloatArray | ComplexArray  # Data of the fit
    model: FloatArray | ComplexArray  # What its model says of them
    whitened: FloatArray | ComplexArray  # Measured less model, of unit variance where the model is right
    axes: tuple[str, ...]  # Names of the axes of these three
    abscissa: FloatArray  # (n,) What they are over: frequencies [Hz] or times [s]
    over: Literal["frequency_hz", "time_s"]  # Which of the two
    # Names along the last axis, or of each row where that is the only axis; empty where the fit does not keep them
    labels: tuple[str, ...]

    @property
    def values(self) -> FloatArray | ComplexArray:
        """Measured less model, in the unit of the data."""
        return np.asarray(self.measured - self.model)

    def __repr__(self) -> str:
        shape = ", ".join(f"{axis} {size}" for axis, size in zip(self.axes, self.measured.shape, strict=True))
        rms = float(np.sqrt(np.nanmean(np.abs(self.whitened) ** 2)))
        return f"residual ({shape}) over {self.over}, RMS whitened {rms:.3g}"


def scaled_by_group(values: FloatArray, group: NDArray[Any]) -> FloatArray:
    """Divides residuals (n_row,) by the RMS of their own group (n_row,)."""
    found = np.full(values.shape, np.nan)
    for each in np.unique(group):
        own = group == each
        scale = np.sqrt(np.nanmean(values[own] ** 2))
        found[own] = values[own] / scale if scale > 0 else 0.0
    return found


def whitened_responses(
    error: ComplexArray, output: ComplexArray, given: ComplexArray, scale: FloatArray
) -> ComplexArray:
    """Whitens errors of responses by their structured covariance, see `robid.frf.frf.Frf`.

    With `C_v = L L^H`, `F = K K^H` and `S` the roots of `scale`, `vec(L^-1 X K^-T)` has the covariance I where
    `vec(S X)` has `S (F (x) C_v) S`: `(K (x) L)^-1` is the inverse of a root of the product.

    Args:
        error (n_conf, n_freq, n_out, n_in): Errors of the response.
        output (n_conf, n_freq, n_out, n_out): Output factor `C_v`, positive definite.
        given (n_conf, n_freq, n_in, n_in): Input factor `F`, positive definite.
        scale (n_conf, n_freq or 1, n_out, n_in): Variance of each element over that of the product.

    Returns:
        Whitened errors (n_conf, n_freq, n_out, n_in), `E|w|^2 = 1`.
    """
    left, right = np.linalg.cholesky(output), np.linalg.cholesky(given)
    plain = error / np.sqrt(scale)
    half = np.linalg.solve(left, plain)  # L^-1 X
    # X K^-T = (K^-1 X^T)^T
    return np.asarray(np.swapaxes(np.linalg.solve(right, np.swapaxes(half, -1, -2)), -1, -2))
