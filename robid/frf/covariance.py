"""The structured covariance of a frequency response, from realizations and from periods."""

from __future__ import annotations

import numpy as np

from robid.arrays import ComplexArray, FloatArray


def total_covariance(residual: ComplexArray, n_in: int, pooled: int) -> tuple[ComplexArray | None, float]:
    """Covariance of one experiment's output residual over realizations.

    Args:
        residual (n_real, n_freq, n_out, n_exp): `Y - G U` of the period averages.
        n_in: Inputs, that is experiments' worth of freedom that the estimate of G took.
        pooled: Neighbouring lines pooled.

    Returns:
        Covariance (n_freq, n_out, n_out) and its complex degrees of freedom; None and 0 without freedom left.
    """
    n_real, n_freq, _, n_exp = residual.shape
    freedom = n_exp * n_real - n_in
    if n_real < 2 or freedom < 1:
        return None, 0.0
    covariance = np.einsum("rfoe,rfpe->fop", residual, residual.conj()) / freedom
    return pool(covariance, pooled), float(freedom * min(pooled, n_freq))


def noise_covariance(scatter: ComplexArray, freedom: int, pooled: int) -> tuple[ComplexArray | None, float]:
    """Covariance of one experiment's output residual that noise causes.

    Args:
        scatter (n_real, n_scatter, n_freq, n_out, n_exp): Deviations `dY - G dU`, see `robid.frf.spectra.Blocks`.
        freedom: Complex degrees of freedom of the scatter in each experiment.
        pooled: Neighbouring lines pooled.

    Returns:
        Covariance (n_freq, n_out, n_out) and its complex degrees of freedom; None and 0 without freedom.
    """
    n_real, _, n_freq, _, n_exp = scatter.shape
    if freedom < 1:
        return None, 0.0
    whole = n_real * n_exp * freedom
    covariance = np.einsum("rafoe,rafpe->fop", scatter, scatter.conj()) / whole
    return pool(covariance, pooled), float(whole * min(pooled, n_freq))


def element_scale(per_block: ComplexArray, factor: ComplexArray, total: ComplexArray | None) -> FloatArray:
    """Sample variance of each element's mean over that of the Kronecker product (n_out, n_in), mean over lines."""
    n_real = per_block.shape[0]
    if total is None:
        return np.ones(per_block.shape[2:])
    sample = per_block.var(axis=0) / (n_real - 1)
    rows = np.real(np.diagonal(total, axis1=-2, axis2=-1))
    columns = np.real(np.diagonal(factor, axis1=-2, axis2=-1))
    product = rows[:, :, None] * columns[:, None, :]
    ratio = np.divide(sample, product, out=np.ones_like(product), where=product > 0)
    return np.asarray(ratio.mean(axis=0))


def pool(covariance: ComplexArray, count: int) -> ComplexArray:
    """Averages covariances (n_freq, n, n) over `count` neighbouring lines, fewer at the edges."""
    half = count // 2
    n_freq = covariance.shape[0]
    return np.array([covariance[max(0, k - half) : min(n_freq, k + half + 1)].mean(axis=0) for k in range(n_freq)])
