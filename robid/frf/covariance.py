"""The structured covariance of a frequency response, from realizations and from periods."""

from __future__ import annotations

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray

_STANDS_OUT = 4.0  # standard deviations of a sum of chance correlations
_FEWEST = 2.0  # degrees of freedom below which inverted variances have no use


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
    covariance = _outer(residual.transpose(1, 2, 0, 3)) / freedom
    return pool(covariance, pooled), float(freedom * min(pooled, n_freq))


def freedom_share(residual: ComplexArray, counted: float) -> float:
    """Share of the counted degrees of freedom that distinct experiments leave; at least some that an inverse needs."""
    share = distinct_experiments(residual) / residual.shape[-1]
    return max(share, min(1.0, _FEWEST / counted)) if counted > 0 else 1.0


def distinct_experiments(residual: ComplexArray) -> float:
    """Independent experiments that have the scatter of a block's residuals.

    Signals that repeat up to their sign repeat the friction: what one experiment of the block shows, others show
    again. n experiments whose residuals have the correlations `rho` are as good as `n^2 / sum |rho|^2`. Chance
    correlations do not come back in other realizations, so products of different ones count; a sum that does not
    stand out counts as none.

    Args:
        residual (n_real, n_freq, n_out, n_exp): `Y - G U` of the period averages.

    Returns:
        From 1 to `n_exp`, harmonic mean over the outputs.

    Source:
        Satterthwaite (1946), of a variance from correlated samples.
    """
    n_real, n_freq, _, n_exp = residual.shape
    if n_exp < 2 or n_real < 2:
        return float(n_exp)
    power = (np.abs(residual) ** 2).mean(axis=(0, 3), keepdims=True)
    rows = np.divide(residual, np.sqrt(power), out=np.zeros_like(residual), where=power > 0).transpose(0, 2, 3, 1)
    cross = rows @ np.swapaxes(rows, -1, -2).conj()
    size = np.sqrt(np.real(np.diagonal(cross, axis1=-2, axis2=-1)))
    product = size[..., :, None] * size[..., None, :]
    correlation = np.divide(cross, product, out=np.zeros_like(cross), where=product > 0) * (1 - np.eye(n_exp))
    couples = n_real * (n_real - 1)
    common = np.abs(correlation.sum(axis=0)) ** 2 - (np.abs(correlation) ** 2).sum(axis=0)
    excess = common.sum(axis=(1, 2)) / couples
    chance = n_exp * np.sqrt(2 / couples) / n_freq
    excess = np.where(excess > _STANDS_OUT * chance, excess, 0.0)
    return float(max(1.0, n_exp**2 / np.mean(n_exp + excess)))


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
    covariance = _outer(scatter.transpose(2, 3, 0, 1, 4)) / whole
    return pool(covariance, pooled), float(whole * min(pooled, n_freq))


def element_scale(
    errors: ComplexArray, factor: ComplexArray, total: ComplexArray | None, n_exp: int, told: BoolArray | None = None
) -> FloatArray:
    """Sample variance of each element over that of the Kronecker product (n_out, n_in), mean over the lines.

    Args:
        errors (n_real, n_freq, n_out, n_in): `V_m W_m`, what each realization's residual adds to the response.
        factor (n_freq, n_in, n_in): Input factor of the structured covariance.
        total (n_freq, n_out, n_out): Its other factor, or None where there is only one realization.
        n_exp: Experiments of each realization.
        told (n_freq, n_in): Lines that count for each input; all when not given, or where there are none.
    """
    if total is None:
        return np.ones(errors.shape[2:])
    whole, n_in = len(errors) * n_exp, errors.shape[-1]
    sample = (np.abs(errors) ** 2).sum(axis=0) * whole / (whole - n_in)
    rows = np.real(np.diagonal(total, axis1=-2, axis2=-1))
    columns = np.real(np.diagonal(factor, axis1=-2, axis2=-1))
    product = rows[:, :, None] * columns[:, None, :]
    ratio = np.divide(sample, product, out=np.ones_like(product), where=product > 0)
    if told is None:
        return np.asarray(ratio.mean(axis=0))
    counts = (told | ~told.any(axis=0))[:, None] & np.ones_like(ratio, bool)
    return np.asarray(ratio.mean(axis=0, where=counts))


def pool(covariance: ComplexArray, count: int) -> ComplexArray:
    """Averages covariances (n_freq, ...) over `count` neighbouring lines, fewer at the edges."""
    half, n_freq = count // 2, len(covariance)
    total, members = np.zeros_like(covariance), np.zeros((n_freq, *(1,) * (covariance.ndim - 1)))
    for offset in range(-min(half, n_freq - 1), min(half, n_freq - 1) + 1):
        here, there = slice(max(0, -offset), n_freq - max(0, offset)), slice(max(0, offset), n_freq + min(0, offset))
        total[here] += covariance[there]
        members[here] += 1
    return np.asarray(total / members)


def _outer(vectors: ComplexArray) -> ComplexArray:
    """Sum of the outer products (n_freq, n_out, n_out) of vectors (n_freq, n_out, ...)."""
    flat = vectors.reshape(*vectors.shape[:2], -1)
    return np.asarray(flat @ np.swapaxes(flat, 1, 2).conj())
