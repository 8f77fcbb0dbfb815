"""The noise of a mean over few periods: the spectrum of their differences, and what of it leaks into each line."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.fft import rfft
from scipy.special import chdtri

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.frf.covariance import FEWEST_FREEDOM
from robid.frf.spectra import output_factor, period_contrasts, ramp_of_period
from robid.signals.record import Record

FEW_PERIODS = 4  # Periods up to which their scatter at a line tells the noise of the mean badly
FEWEST_SAMPLES = 16  # Of a period whose lines are enough for a spectrum
_LOWEST = 3  # Lines from 0 whose share in others is integrated: there the removal of drift acts
_SLOPE = 1.5  # Noise of line 0, which drift hides, over that of line 1: slow noise falls with frequency
# Share of records whose periods scatter by more than chance, by chance: a smaller excess stays within the band.
_CHANCE = 0.05
_SPARSE = 16  # Samples from one to the next of those that show a signal's size
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
    share = min(1.0, max(_freedom_left(_diagonal(own), _diagonal(leaked), single), FEWEST_FREEDOM) / freedom)
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
    rows, size = _deviations(record.outputs[0], record.inputs[0])
    return np.asarray((np.swapaxes(rows, 1, 2) @ rows.conj()) * np.outer(size, size))


def _deviations(outputs: FloatArray, inputs: FloatArray) -> tuple[ComplexArray, FloatArray]:
    """Contrasts of the periods under a Hann window (n_line, n_row, n_channel) over the root of their number `n_row`.

    They come over their size (n_channel,), in single precision: what repeats is gone before, and a covariance that is
    told to some per cent needs no more.

    Periods less their mean have as many degrees of freedom as orthonormal contrasts, which are fewer transforms. Line
    0 is drift as well as noise, and is left out; line 1 stands in its place.

    Args:
        outputs (n_real, n_exp, n_period, n_sample, n_out): Signals whose drift is removed.
        inputs (n_real, n_exp, n_period, n_sample, n_in): The others.
    """
    n_period, n_sample = outputs.shape[2:4]
    taken = period_contrasts(n_period)
    n_row = outputs.shape[0] * outputs.shape[1] * len(taken)
    # Hann window; sqrt(1.5) makes white noise as large as without.
    window = (1 - np.cos(2 * np.pi * np.arange(n_sample) / n_sample)) / np.sqrt(1.5 * n_row)
    spectra, sizes = [], []
    for samples, drifts in ((outputs, n_period > 2), (inputs, False)):
        moved = np.ascontiguousarray(np.einsum("dp,repsc->sredc", taken, samples)).reshape(n_sample, n_row, -1)
        moved -= moved.mean(axis=0)
        if drifts:  # Between two periods the slope is the same at both.
            slope = np.einsum("dp,repc->redc", taken, np.gradient(samples.mean(axis=3), axis=2)).reshape(n_row, -1)
            moved -= slope * ramp_of_period(n_sample)[:, :, None]
        size = np.abs(moved[::_SPARSE]).max(axis=(0, 1))
        size = np.where(size > np.finfo(np.float32).tiny, size, 1.0)
        reduced = np.empty(moved.shape, np.float32)
        np.multiply(moved, window[:, None, None] / size, out=reduced, casting="same_kind")
        spectra.append(rfft(reduced, axis=0, norm="forward", overwrite_x=True)[:-1])
        sizes.append(size)
    spectrum = np.concatenate(spectra, axis=2)
    # Without line 0, line 1 keeps its size: its share of what it leaves out is unknown.
    spectrum[1] *= np.sqrt(1.5)
    spectrum[0] = np.sqrt(_SLOPE) * spectrum[1]
    return spectrum, np.concatenate(sizes)


def _far_share(spectrum: ComplexArray, lines: IntArray, n_period: int, n_sample: int) -> ComplexArray:
    """What other lines above the lowest ones make of the mean's covariance (n_freq, n_channel, n_channel).

    Of a wave somewhere within a line, half a turn's square on average; beyond half the sampling rate lines come back.
    """
    count = len(spectrum)
    # Power of the kernel |sin(pi P f) / (P N sin(pi f / N))|^2 with its numerator averaged to 1/2.
    distance = np.arange(2 * count)
    size = 2 * (n_period * n_sample * np.sin(np.pi * distance / n_sample)) ** 2
    kernel = np.divide(1.0, size, out=np.zeros(len(size)), where=distance % n_sample != 0)
    far, at = np.arange(_LOWEST + 1, count), np.minimum(lines, count - 1)[:, None]
    # Real signals: the spectrum at negative lines is conjugate.
    above, below = kernel[np.abs(at - far)], kernel[at + far]
    shape = (len(far), -1)
    found = np.empty((len(lines), *spectrum.shape[1:]), complex)
    found.real = ((above + below) @ spectrum[far].real.reshape(shape)).reshape(found.shape)
    found.imag = ((above - below) @ spectrum[far].imag.reshape(shape)).reshape(found.shape)
    return found


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
