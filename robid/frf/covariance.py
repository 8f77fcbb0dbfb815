"""The covariance of a frequency response: from realizations, the scatter of periods, or chosen realizations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray
from robid.errors import DataError
from robid.frf.frf import Frf

_STANDS_OUT = 4.0  # standard deviations of a sum of chance correlations
FEWEST_FREEDOM = 2.0  # degrees of freedom below which inverted variances have no use


def total_covariance(residual: ComplexArray, n_in: int, pooled: int) -> tuple[ComplexArray | None, float]:
    """Covariance (n_freq, n_out, n_out) of the output residual over realizations, and its complex degrees of freedom.

    Args:
        residual (n_real, n_freq, n_out, n_exp): `Y - G U` of the period averages.
        n_in: Inputs, that is experiments' worth of freedom that the estimate of G took.
        pooled: Neighbouring lines pooled.
    """
    n_real, n_freq, _, n_exp = residual.shape
    freedom = n_exp * n_real - n_in
    if n_real < 2 or freedom < 1:
        return None, 0.0
    # The estimate of G takes n_in experiments' worth of freedom from the residuals.
    covariance = _outer(residual.transpose(1, 2, 0, 3)) / freedom
    return pool(covariance, pooled), float(freedom * min(pooled, n_freq))


def freedom_share(residual: ComplexArray, counted: float) -> float:
    """Share of the counted degrees of freedom that distinct experiments leave; at least some that an inverse needs."""
    share = distinct_experiments(residual) / residual.shape[-1]
    return max(share, min(1.0, FEWEST_FREEDOM / counted)) if counted > 0 else 1.0


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
    # Rows over their power at each line, so that no resonance decides the correlation.
    rows = np.divide(residual, np.sqrt(power), out=np.zeros_like(residual), where=power > 0).transpose(0, 2, 3, 1)
    cross = rows @ np.swapaxes(rows, -1, -2).conj()
    size = np.sqrt(np.real(np.diagonal(cross, axis1=-2, axis2=-1)))
    # Correlation of experiments over the lines, of each realization and output.
    product = size[..., :, None] * size[..., None, :]
    correlation = np.divide(cross, product, out=np.zeros_like(cross), where=product > 0) * (1 - np.eye(n_exp))
    couples = n_real * (n_real - 1)
    # |sum_r c_r|^2 - sum_r |c_r|^2 is the sum of products of different realizations: chance averages out of it.
    common = np.abs(correlation.sum(axis=0)) ** 2 - (np.abs(correlation) ** 2).sum(axis=0)
    excess = common.sum(axis=(1, 2)) / couples
    chance = n_exp * np.sqrt(2 / couples) / n_freq
    excess = np.where(excess > _STANDS_OUT * chance, excess, 0.0)
    return float(max(1.0, n_exp**2 / np.mean(n_exp + excess)))


def noise_covariance(scatter: ComplexArray, freedom: int, pooled: int) -> tuple[ComplexArray | None, float]:
    """Covariance (n_freq, n_out, n_out) of the output residual that noise causes, and its degrees of freedom.

    Args:
        scatter (n_real, n_scatter, n_freq, n_out, n_exp): Deviations `dY - G dU`, see `robid.frf.spectra.Blocks`.
        freedom: Complex degrees of freedom of the scatter in each experiment.
        pooled: Neighbouring lines pooled.
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
    # Residuals are short by what the fit took: M of M - n_in degrees of freedom are left.
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


def by_realizations(frf: Frf, chosen: Sequence[int], pooled: int) -> Frf:
    """Estimates the covariance of the whole response anew, as some of its realizations alone show it.

    Args:
        frf: A response with its `realization_error`.
        chosen: Indices of two realizations or more.
        pooled: Neighbouring lines pooled.

    Returns:
        The same response; its total covariance and element scale are those that the chosen realizations give for the
        mean of all of them.

    Raises:
        DataError: If the response does not know what its realizations add, or fewer than two are chosen.
    """
    if frf.realization_error is None or len(chosen) < 2:
        message = f"D023 a covariance from realizations needs two of them, not {len(chosen)}"
        raise DataError(message, remedy="record more realizations, with an estimator that keeps them apart")
    errors = frf.realization_error[:, list(chosen)]
    count, whole = errors.shape[1], frf.realization_error.shape[1]
    n_freq, n_in = frf.response.shape[1], frf.response.shape[3]
    deviation = errors - errors.mean(axis=1, keepdims=True)
    # An error E_r = V_r W_r has the covariance F (x) C_v: E_r F^-T E_r^H / n_in estimates C_v.
    weight = np.swapaxes(np.linalg.inv(frf.input_factor), -1, -2)
    outer = np.einsum("crfoi,cfij,crfpj->cfop", deviation, weight, deviation.conj(), optimize=True)
    covariance = np.stack([pool(each, pooled) for each in outer * (whole / (n_in * (count - 1)))])
    # The same scale of elements as of all realizations, by the errors of these alone.
    sample = (np.abs(deviation) ** 2).sum(axis=1) * (whole / (count - 1))
    changed = replace(
        frf,
        element_scale=np.ones_like(frf.element_scale),
        total_covariance=covariance,
        total_degrees_of_freedom=float(n_in * (count - 1) * min(pooled, n_freq)),
    )
    variance = changed.element_variance()
    ratio = np.divide(sample, variance, out=np.ones_like(variance), where=variance > 0)
    return replace(changed, element_scale=ratio.mean(axis=1))
