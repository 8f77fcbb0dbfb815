"""What windows over neighbouring lines do to errors: lines that share data, realizations that err as a whole."""

from __future__ import annotations

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray

_FEWEST = 1e-9  # share of a realization's own variance that the fit left


def window_correlation(gain: ComplexArray, index: IntArray) -> FloatArray:
    """Correlation of each line's error with those of the next lines, mean over the inputs.

    An error at one bin is in all windows that hold the bin: the correlation is that of the weights there.

    Args:
        gain (n_freq, n_in, n_row): What turns rows, bin after bin of each experiment, into the model at the line.
        index (n_freq, width): Position of each window's bins, one after the other.

    Returns:
        (n_freq, n_next), 0 where windows have no bin in common and beyond the last line.
    """
    n_freq, width = index.shape
    weights = gain.reshape(n_freq, -1, width)
    size = np.sqrt((np.abs(weights) ** 2).sum(axis=(1, 2)))
    found: list[FloatArray] = []
    for ahead in range(1, n_freq):
        shift = index[ahead:, 0] - index[:-ahead, 0]
        correlation = np.zeros(n_freq)
        for step in np.unique(shift[shift < width]):
            first = np.flatnonzero(shift == step)
            shared = weights[first, :, step:].conj() * weights[first + ahead, :, : width - step]
            correlation[first] = np.real(shared.sum(axis=(1, 2))) / (size[first] * size[first + ahead])
        if not (shift < width).any():
            break
        found.append(correlation)
    return np.stack(found, axis=1) if found else np.zeros((n_freq, 0))


def realization_scale(
    gain: ComplexArray, residual: ComplexArray, orthonormal: ComplexArray, covariance: ComplexArray, n_real: int
) -> FloatArray:
    """Variance of each element between realizations over that of independent rows (n_out, n_in), mean over the lines.

    Distortion errs alike at all lines and experiments of a realization. What a realization's residuals add to the
    response is compared with what independent ones would, less the part that the fit itself took out.

    Args:
        gain (n_freq, n_in, n_row): What turns rows, realization after realization, into the response.
        residual (n_freq, n_row, n_out): Output residual of each row.
        orthonormal (n_freq, n_row, n_column): Basis of what the fit took out.
        covariance (n_freq, n_out, n_out): Covariance of the output residual.
        n_real: Realizations; a single one has no scale of its own.
    """
    n_freq, n_in, _ = gain.shape
    n_out = residual.shape[-1]
    if n_real < 2:
        return np.ones((n_out, n_in))
    weights = gain.reshape(n_freq, n_in, n_real, -1)
    rows = residual.reshape(n_freq, n_real, -1, n_out)
    basis = orthonormal.reshape(n_freq, n_real, rows.shape[2], -1)
    added = (np.abs(np.einsum("fimk,fmko->fmoi", weights, rows, optimize=True)) ** 2).sum(axis=1)
    own = (np.abs(weights) ** 2).sum(axis=(2, 3))
    kept = own - (np.abs(np.einsum("fimk,fmkq->fimq", weights, basis, optimize=True)) ** 2).sum(axis=(2, 3))
    level = np.real(np.diagonal(covariance, axis1=1, axis2=2))
    expected = level[:, :, None] * kept[:, None, :]
    usable = (expected > 0) & (kept > _FEWEST * own)[:, None, :]
    return np.asarray(np.divide(added, expected, out=np.ones_like(added), where=usable).mean(axis=0))


def mean_correlation(correlation: FloatArray, told: BoolArray) -> FloatArray:
    """Mean correlation (n_conf, n_next) of a line's error with those of the next lines, where both tell something.

    Args:
        correlation (n_conf, n_freq, n_next): Of each line's error with those of the next lines.
        told (n_conf, n_freq): Lines that tell something; nothing is correlated with the others.
    """
    n_conf, n_freq, n_next = correlation.shape
    mean = np.zeros((n_conf, n_next))
    for ahead in range(1, min(n_next, n_freq - 1) + 1):
        both = told[:, :-ahead] & told[:, ahead:]
        shared = (correlation[:, :-ahead, ahead - 1] * both).sum(axis=1)
        mean[:, ahead - 1] = shared / np.maximum(both.sum(axis=1), 1)
    return mean
