"""The covariance of a frequency response: from realizations, from periods, from some of the realizations alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.fft import rfft
from scipy.signal import fftconvolve
from scipy.special import chdtri

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.frf.spectra import output_factor, ramp_of_period
from robid.signals.record import Record

FEW_PERIODS = 4  # Periods up to which their scatter at a line tells the noise of the mean badly
_LOWEST = 3  # Lines from 0 whose share in others is integrated: there the removal of drift acts
_SLOPE = 1.5  # Noise of line 0, which drift hides, over that of line 1: slow noise falls with frequency
# Share of records whose periods scatter by more than chance, by chance: a smaller excess stays within the band.
_CHANCE = 0.05
_POINTS = 4  # Points of that integral per period and line


class PeriodNoise(NamedTuple):
    """Covariance of the output residual of a mean over periods."""

    covariance: ComplexArray  # (n_freq, n_out, n_out) Of one experiment
    freedom: float  # Complex degrees of freedom that are counted, each period, experiment and pooled line alike
    share: float  # Part of them that is left, mean over lines and outputs


def period_noise(
    record: Record, lines: IntArray, response: ComplexArray, pooled: int, *, accelerations: bool = True
) -> PeriodNoise:
    """Estimates the noise of `Y - G U` of a mean over two periods or more.

    The mean at line k holds noise of all frequencies f, by the transform's kernel `D(f - k)`: most of it of the line
    itself, and of others what leaks, as the noise does not end as it began. Leakage is one jump for all lines, so
    deviations at a line tell its variance badly; the spectrum of the noise, from deviations under a Hann window at
    all lines, tells it well: `sum_m T_k S_m T_k^H int |D(f - k)|^2 df`, `T_k = (1, -G_k)`, m the lines from DC on.

    Args:
        record: Record of a single configuration.
        lines (n_freq,): Lines of the response.
        response (n_freq, n_out, n_in): The response.
        pooled: Neighbouring lines pooled.
        accelerations: As in `robid.frf.spectra.record_blocks`.

    Source:
        Pintelon and Schoukens (2012), System Identification, 2nd ed., ch. 2 (leakage); Satterthwaite (1946) (freedom).
    """
    n_period, n_sample = record.inputs.shape[3:5]
    spectrum = _noise_spectrum(record)
    factor = output_factor(record, lines, accelerations=accelerations)
    diagonal = factor[:, :, None] * np.eye(factor.shape[1])
    # The residual Y - G U takes outputs with their factor to accelerations, inputs with minus the response.
    take = np.concatenate([diagonal, -response], axis=2)
    around = lines[:, None] + 2 * (np.arange(2 * (pooled // 2) + 1) - pooled // 2)
    around = np.clip(np.abs(around), 1, len(spectrum) - 1)
    kept = 1 / n_period - 1 / (6 * n_period**2)
    # What a line's own noise leaves in the mean; the lowest lines are integrated apart, since drift is removed there.
    own = np.where(lines > _LOWEST, kept, 0.0)[:, None, None, None] * spectrum[around]
    own = np.stack([_residual(take, own[:, place]) for place in range(around.shape[1])])
    leaked = _residual(take, _far_share(spectrum, lines, n_period, n_sample))
    leaked = leaked + _low_share(spectrum, take, lines, n_period, n_sample)
    # Each realization and experiment has one difference less than periods.
    single = float(record.inputs.shape[1] * record.inputs.shape[2] * (n_period - 1))
    freedom = single * min(pooled, len(lines))
    share = min(1.0, max(_freedom_left(_diagonal(own), _diagonal(leaked), single), _FEWEST_FREEDOM) / freedom)
    return PeriodNoise(own.mean(axis=0) + leaked, freedom, share)


def exceeds(scatter: ComplexArray, covariance: ComplexArray, single: float) -> bool:
    """Whether the periods scatter by more than their spectrum and chance explain, at half an output's lines.

    Args:
        scatter (n_freq, n_out, n_out): Covariance by the scatter of the periods, each line's own.
        covariance (n_freq, n_out, n_out): The same by their spectrum.
        single: Differences of periods that there are: one jump in each may be all that the lines scatter by.
    """
    told = np.maximum(_diagonal(covariance), np.finfo(float).tiny)
    return bool((np.median(_diagonal(scatter) / told, axis=0) > chdtri(single, _CHANCE) / single).any())


def _noise_spectrum(record: Record) -> ComplexArray:
    """Covariance of outputs and inputs (n_line, n_channel, n_channel) in one period, from line 0 on."""
    joint = np.concatenate([_deviations(record.outputs[0], drifts=True), _deviations(record.inputs[0])], axis=-1)
    rows = joint.reshape(-1, *joint.shape[-2:]).transpose(1, 2, 0)
    n_real, n_exp, n_period = record.inputs.shape[1:4]
    return np.asarray(rows @ np.swapaxes(rows.conj(), 1, 2) / (n_real * n_exp * (n_period - 1)))


def _deviations(samples: FloatArray, *, drifts: bool = False) -> ComplexArray:
    """Deviations of the periods from their mean under a Hann window (n_real, n_exp, n_period, n_line, n_channel).

    Those of line 0 are drift as well as noise, and are left out; those of line 1 stand in their place.
    """
    whole = rfft(samples, axis=-2, norm="forward")
    if drifts:
        slope = np.gradient(whole[..., 0, :].real, axis=2)
        whole = whole - slope[..., None, :] * rfft(ramp_of_period(samples.shape[3]), axis=0, norm="forward")
    moved = whole - whole.mean(axis=2, keepdims=True)
    moved[..., 0, :] = 0.0
    inner = moved[..., 1:-1, :]
    # Hann window in the frequency domain: half of each neighbour is subtracted.
    inner = inner - 0.5 * (moved[..., :-2, :] + moved[..., 2:, :])
    # Without line 0, line 1 keeps its size: its share of what it leaves out is unknown.
    inner[..., 1:, :] /= np.sqrt(1.5)
    return np.concatenate([np.sqrt(_SLOPE) * inner[..., :1, :], inner], axis=-2)


def _far_share(spectrum: ComplexArray, lines: IntArray, n_period: int, n_sample: int) -> ComplexArray:
    """What other lines above the lowest ones make of the mean's covariance (n_freq, n_channel, n_channel).

    Of a wave somewhere within a line, half a turn's square on average; beyond half the sampling rate lines come back.
    """
    count = len(spectrum)
    kept = np.where(np.arange(count)[:, None, None] > _LOWEST, spectrum, 0.0)
    # Real signals: the spectrum at negative lines is conjugate.
    both = np.concatenate([kept[:0:-1].conj(), kept])
    distance = np.arange(2 - 2 * count, 2 * count - 1)
    # Power of the kernel |sin(pi P f) / (P N sin(pi f / N))|^2 with its numerator averaged to 1/2.
    size = 2 * (n_period * n_sample * np.sin(np.pi * distance / n_sample)) ** 2
    kernel = np.divide(1.0, size, out=np.zeros(len(size)), where=distance != 0)
    spread = fftconvolve(both, kernel[:, None, None], mode="same", axes=0)
    return np.asarray(spread[count - 1 + np.minimum(lines, count - 1)])


def _low_share(
    spectrum: ComplexArray, take: ComplexArray, lines: IntArray, n_period: int, n_sample: int
) -> ComplexArray:
    """What the lowest lines make of the residual's covariance (n_freq, n_out, n_out)."""
    points, n_out = _POINTS * n_period, take.shape[1]
    nearest = np.arange(-_LOWEST, _LOWEST + 1)
    offset = (np.arange(len(nearest) * points) + 0.5) / points - _LOWEST - 0.5
    # What a wave between the lines leaves in the mean over P periods, and in the ramp that is removed with it.
    mean = _mean_of_wave(offset - lines[:, None], n_period, n_sample)
    slope = np.asarray(np.gradient(np.eye(n_period), axis=0)).mean(axis=0)
    drift = (slope @ np.exp(2j * np.pi * np.outer(np.arange(n_period), offset))) * _mean_of_wave(offset, 1, n_sample)
    ramp = rfft(ramp_of_period(n_sample), axis=0, norm="forward")[lines]
    parts, kind = np.stack([mean - ramp * drift, mean]), np.repeat([0, 1], [n_out, take.shape[2] - n_out])
    # Between lines the spectrum runs straight.
    shares = np.maximum(1 - np.abs(np.clip(offset, -_LOWEST, _LOWEST) - nearest[:, None]), 0) / points
    found = np.zeros((*take.shape[:2], n_out), complex)
    for line, share in zip(nearest, shares, strict=True):
        own = spectrum[line] if line >= 0 else spectrum[-line].conj()
        kernel = np.einsum("afp,bfp->fab", parts * share, parts.conj())
        found += _residual(take, kernel[:, kind][:, :, kind] * own)
    return found


def _mean_of_wave(frequency: FloatArray, n_period: int, n_sample: int) -> ComplexArray:
    """Mean over the periods' samples of a wave of some turns in each period, none of them whole."""
    turn = np.pi * frequency
    size = np.sin(turn * n_period) / (n_period * n_sample * np.sin(turn / n_sample))
    return np.asarray(size * np.exp(1j * turn * (n_period * n_sample - 1) / n_sample))


def _residual(take: ComplexArray, covariance: ComplexArray) -> ComplexArray:
    """Covariance of the output residual (n_freq, n_out, n_out) from that of all channels."""
    return np.asarray(take @ covariance @ np.swapaxes(take.conj(), 1, 2))


def _diagonal(covariance: ComplexArray) -> FloatArray:
    return np.asarray(np.real(np.diagonal(covariance, axis1=-2, axis2=-1)))


def _freedom_left(own: FloatArray, leaked: FloatArray, single: float) -> float:
    """Degrees of freedom, harmonic mean over lines and outputs, of a mean of unequal parts and what leaks into all.

    Pooled variances are (n_pooled, n_freq, n_out), those that leak (n_freq, n_out); each part has `single` of its own.
    """
    whole = own.mean(axis=0) + leaked
    # A squared estimate is too large by its own variance.
    square = ((own**2).mean(axis=0) / len(own) + leaked**2) * single / (single + 1)
    mean = np.maximum(whole**2 - square / single, square)
    ratio = np.divide(square, mean, out=np.ones_like(mean), where=mean > 0)
    return float(single / np.maximum(ratio, 1 / len(own)).mean())


_STANDS_OUT = 4.0  # standard deviations of a sum of chance correlations
_FEWEST_FREEDOM = 2.0  # degrees of freedom below which inverted variances have no use


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
    return max(share, min(1.0, _FEWEST_FREEDOM / counted)) if counted > 0 else 1.0


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
