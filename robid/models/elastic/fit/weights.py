"""Weights of the residuals: chosen by the user, optimal for a covariance, or allowing for an error of the model."""

from __future__ import annotations

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.frf.residual import Residual
from robid.models.elastic.fit.options import Weights

_MIN_SNR = 10.0
_ROUNDING = 1e-13  # Of an element's variance


def make_weights(
    frf: Frf, weights: Weights, residual: Residual, size: FloatArray | None = None, level: FloatArray | None = None
) -> tuple[FloatArray, int]:
    """Weights of the squared residuals.

    Args:
        frf: Measured response with its variance.
        weights: Which weights.
        residual: What they are weights of; the logarithms drop elements below 10 dB.
        size (n_conf, n_freq, n_out, n_in): Magnitude that errors are relative to, the measured one by default.
            A fitted model's is better: noise then does not choose its own weight.
        level (n_conf, n_out, n_in): Relative model error of each element that `estimated` adds, see `assumed_error`.

    Returns:
        Weights (n_conf, n_freq, n_out, n_in), and the number of elements dropped though their lines tell of them.
        Without a covariance the model error takes the place of the noise. User weights of plain residuals are constant
        over lines and configurations like the others: relative to the element's mean power.

    Source:
        Wernholt and Moberg (2008), eq. 6, 8 and sec. 6; docs/methods, sec. 5.
    """
    size = np.abs(frf.response) if size is None else size
    power, variance, freedom = size**2, frf.element_variance(), frf.degrees_of_freedom
    relative = np.divide(variance, power, out=np.full(power.shape, np.inf), where=power > 0)
    # What is exactly zero has no logarithm, whatever the model's size there.
    below = (relative > 1 / _MIN_SNR) | (frf.response == 0)
    if weights.kind == "user":
        base = _user_weights(weights, relative, below)
        size = np.broadcast_to(np.sqrt(power.mean(axis=(0, 1))), power.shape)
    elif variance.any():
        # The inverse of an estimated variance is too large in the mean, by n / (n - 1) of a complex chi-squared one.
        base = ((freedom - 1) / freedom if freedom > 1 else 1.0) / (relative + assumed_error(weights, level) ** 2)
    else:
        base = np.full(power.shape, 1 / (weights.model_error**2 or 1.0))
    shown = np.abs(residual.per_relative(size + 0j)) ** 2
    base = np.divide(base, shown, out=np.zeros(power.shape), where=shown > 0)
    known = np.isfinite(variance)
    dropped = below & known & residual.drops_noise
    keep = ~dropped & known & (frf.frequency_hz >= weights.low_cut_hz)[None, :, None, None]
    return np.where(keep, base, 0.0), int(dropped.sum())


def _user_weights(weights: Weights, relative: FloatArray, below: BoolArray) -> FloatArray:
    """Constant weights, scaled so that weight times variance is one in the mean over what stands out of the noise."""
    base = np.where(np.eye(*relative.shape[2:]) > 0, 1.0, weights.off_diagonal) + np.zeros(relative.shape)
    # A coupling that is nothing but noise says nothing of the others.
    trusted = (base > 0) & ~below
    typical = float((base * relative)[trusted].sum() / max(trusted.sum(), 1))
    return np.asarray(base / (typical if 0 < typical < np.inf else weights.model_error**2 or 1.0))


def assumed_error(weights: Weights, level: FloatArray | None = None, *, known: bool = True) -> FloatArray:
    """Relative model error that the weights allow for: one number, or (n_conf, 1, n_out, n_in) once estimated.

    Where the response's own errors are not `known`, it takes their place whatever the weights.
    """
    if weights.kind == "estimated" and level is not None:
        return level[:, None]
    if not known:
        return np.asarray(weights.model_error or 1.0)
    return np.asarray(weights.model_error if weights.kind in ("inflated", "estimated") else 0.0)


def make_whitening(frf: Frf, kept: BoolArray, residual: Residual, fitted: ComplexArray | None = None) -> ComplexArray:
    """Root of the inverse covariance of the residuals of each line, correlations of its elements included.

    Args:
        frf: Measured response with its structured covariance.
        kept (n_conf, n_freq, n_out, n_in): Elements that count; the others are left out of the covariance.
        residual: Whose covariance it is.
        fitted (n_conf, n_freq, n_out, n_in): Response that errors are relative to, the measured one by default.

    Returns:
        (n_conf, n_freq, n_element, n_element), zero where an element is left out, rows of the response in order.

    Raises:
        DataError: If the covariance has no inverse: too few realizations, or errors that determine each other.

    Source:
        Wernholt and Moberg (2008), eq. 6 and 8; mean of the inverted complex Wishart distribution.
    """
    n_conf, n_freq, n_out, n_in = frf.response.shape
    freedom = frf.degrees_of_freedom
    if freedom <= n_out:
        message = (
            f"D134 weights `optimal_full` need more than {n_out} degrees of freedom of the covariance, not {freedom:g}"
        )
        raise DataError(message, where="fit", remedy="record more realizations, or choose other `weights`")
    relative = frf.response if fitted is None else fitted
    # Elements of the covariance stand column by column, those of the residual row by row.
    by_row = np.arange(n_out * n_in).reshape(n_in, n_out).T.ravel()
    whitening = np.zeros((n_conf, n_freq, n_out * n_in, n_out * n_in), complex)
    for configuration in range(n_conf):
        covariance = frf.full_covariance(configuration)[:, by_row][:, :, by_row]
        size = residual.divisor(relative[configuration]).reshape(n_freq, -1)
        covariance = residual.part(covariance / (size[:, :, None] * size[:, None, :].conj()))
        for line, used in enumerate(kept[configuration].reshape(n_freq, -1)):
            both = np.ix_(used, used)
            whitening[configuration, line][both] = _inverse_root(covariance[line][both], frf.frequency_hz[[line]])
    # The mean of an inverted complex Wishart matrix is n / (n - p) times the inverse: its root is taken back.
    return np.asarray(whitening * np.sqrt((freedom - n_out) / freedom))


def _inverse_root(covariance: ComplexArray, frequency_hz: FloatArray) -> ComplexArray:
    """L^-1 of C = L L^H: residuals times it have unit covariance."""
    root = _cholesky(covariance)
    if root is None:
        raise singular_covariance(frequency_hz, "fit")
    return np.asarray(np.linalg.inv(root))


def _cholesky(covariance: ComplexArray) -> ComplexArray | None:
    """Lower root of a covariance (n, n); None where it has no inverse beyond rounding."""
    try:
        root = np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        return None
    # A pivot is what the elements before leave of an element's variance.
    left = np.diag(root).real ** 2 / np.diag(covariance).real
    return np.asarray(root) if (left > _ROUNDING).all() else None


def singular_covariance(frequency_hz: FloatArray, where: str) -> DataError:
    """Returns the refusal of weights that invert a covariance which has no inverse at some lines (n_freq,) [Hz]."""
    lines = ", ".join(f"{frequency:.3g}" for frequency in frequency_hz[:5])
    message = f"D243 the covariance is singular at {lines} Hz, and optimal weights invert it"
    remedy = "use the weights `inflated` or `user`, or look for a channel without noise"
    return DataError(message, where=where, remedy=remedy)
