"""Spectra of a record's experiment blocks at chosen lines, also with a transient removed (robust local polynomials)."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import rfft

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid.errors import DataError
from robid.frf.options import EstimateOptions
from robid.signals.record import Record

_FEW_LINES = 16  # Up to so many lines a matrix product is faster than an FFT


@dataclass(frozen=True)
class Blocks:
    """Spectra of one configuration, averaged over the periods, and the scatter of the periods.

    Complex amplitudes are DFT sums over one period divided by its number of samples.
    """

    lines: IntArray  # (n_freq,) DFT lines of one period
    inputs: ComplexArray  # (n_real, n_freq, n_in, n_exp) Inputs [their units]
    outputs: ComplexArray  # (n_real, n_freq, n_out, n_exp) Outputs, or their accelerations [their units]
    reference: ComplexArray | None  # (n_real, n_freq, n_in, n_exp) What was injected, or None where it was not recorded
    # (n_real, n_scatter, n_freq, n_in, n_exp) Deviations whose summed outer products over `scatter_freedom` estimate
    # the noise covariance of `inputs`
    input_scatter: ComplexArray
    output_scatter: ComplexArray  # (n_real, n_scatter, n_freq, n_out, n_exp) The same of `outputs`
    scatter_freedom: int  # Complex degrees of freedom of the scatter in each experiment; 0 with a single period

    def select(self, chosen: IntArray) -> Blocks:
        """Returns the blocks at some of the lines, by index."""
        return replace(
            self,
            lines=self.lines[chosen],
            inputs=self.inputs[:, chosen],
            outputs=self.outputs[:, chosen],
            reference=None if self.reference is None else self.reference[:, chosen],
            input_scatter=self.input_scatter[:, :, chosen],
            output_scatter=self.output_scatter[:, :, chosen],
        )


def record_blocks(
    record: Record, lines: IntArray, *, with_reference: bool = False, accelerations: bool = True
) -> Blocks:
    """Transforms one configuration's record, averaged over the periods, drift of the outputs removed.

    Args:
        record: Record of a single configuration.
        lines (n_freq,): DFT lines of one period.
        with_reference: Whether what was injected is transformed too, if it was recorded.
        accelerations: Whether motions are brought to accelerations; else they stay as they were measured.
    """
    factor = output_factor(record, lines, accelerations=accelerations)
    beside = np.isin(lines - 1, record.excited_lines) | np.isin(lines + 1, record.excited_lines)
    inputs, input_scatter = _mean_and_scatter(record.inputs[0], lines, beside)
    outputs, output_scatter = _mean_and_scatter(record.outputs[0], lines, beside, factor)
    injected = record.reference if with_reference else None
    reference = None if injected is None else _experiments_last(line_amplitudes(injected[0], lines))
    return Blocks(lines, inputs, outputs, reference, input_scatter, output_scatter, record.inputs.shape[3] - 1)


def line_amplitudes(samples: FloatArray, lines: IntArray) -> ComplexArray:
    """Complex amplitudes (..., n_lines, n_channel) of samples (..., n_sample, n_channel) at some DFT lines."""
    n_sample = samples.shape[-2]
    if len(lines) > _FEW_LINES:
        return np.asarray(rfft(samples, axis=-2, norm="forward")[..., lines, :])
    parts = _dft_rows(n_sample, lines.tobytes(), lines.dtype.str) @ samples
    amplitudes = np.empty((*parts.shape[:-2], len(lines), parts.shape[-1]), complex)
    amplitudes.real, amplitudes.imag = parts[..., : len(lines), :], parts[..., len(lines) :, :]
    return amplitudes


@functools.lru_cache(maxsize=8)
def _dft_rows(n_sample: int, lines: bytes, dtype: str) -> FloatArray:
    """Real and imaginary rows (2 n_lines, n_sample) of the DFT, over the number of samples."""
    # Whole turns off first, so that large products of line and sample keep their digits.
    turns = np.outer(np.frombuffer(lines, dtype), np.arange(n_sample)) % n_sample / n_sample
    return np.concatenate([np.cos(2 * np.pi * turns), -np.sin(2 * np.pi * turns)]) / n_sample


def output_factor(record: Record, lines: IntArray, *, accelerations: bool = True) -> FloatArray | ComplexArray:
    """What turns each output's spectrum into that of the response's output (n_lines, n_out).

    Args:
        record: The record.
        lines (n_lines,): DFT lines of one period.
        accelerations: Whether motions are brought to accelerations.
    """
    omega, channels = 2 * np.pi * lines / record.period_s, record.output_channels
    if not accelerations:
        return np.ones((len(lines), len(channels)))
    columns = [channel.to_acceleration(omega, record.sampling_period_s) for channel in channels]
    factor: ComplexArray = np.stack(columns, axis=-1)
    if factor.imag.any():
        return factor
    return np.asarray(factor.real)


def mean_without_drift(angle: FloatArray) -> FloatArray:
    """Mean over the periods (n_real, n_exp, n_sample, n_out), the ramp between their means removed.

    Args:
        angle (n_real, n_exp, n_period, n_sample, n_out): Angles [rad].
    """
    n_period, n_sample = angle.shape[2:4]
    mean = angle.mean(axis=2)
    if n_period < 2:
        return np.asarray(mean)
    # The mean over the samples as a product with ones, which is faster.
    drift = np.gradient(np.ones(n_sample) @ angle / n_sample, axis=2).mean(axis=2)
    return np.asarray(mean - drift[:, :, None] * ramp_of_period(angle.shape[3]))


def ramp_of_period(n_sample: int) -> FloatArray:
    """A rise of 1 over one period, without mean (n_sample, 1)."""
    return ((np.arange(n_sample) + 0.5) / n_sample - 0.5)[:, None]


def period_contrasts(n_period: int) -> FloatArray:
    """Orthonormal combinations (n_period - 1, n_period) of the periods that are zero where all are alike (Helmert)."""
    rows = np.tril(np.ones((n_period - 1, n_period)))
    rows[np.arange(n_period - 1), np.arange(1, n_period)] = -np.arange(1, n_period)
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))


def _experiments_last(spectrum: ComplexArray) -> ComplexArray:
    """Reorders (n_real, n_exp, n_freq, n_channel) to (n_real, n_freq, n_channel, n_exp)."""
    return np.asarray(np.moveaxis(spectrum, 1, -1))


def _mean_and_scatter(
    samples: FloatArray, lines: IntArray, beside: BoolArray, factor: FloatArray | ComplexArray | None = None
) -> tuple[ComplexArray, ComplexArray]:
    """Mean over the periods and deviations that stand for its noise, see `Blocks`.

    Noise that does not repeat jumps at the ends of a period and leaks over its lines; the jumps of successive
    periods cancel in their mean, whose leakage falls with the square of the number of periods P. Contrasts under
    a Hann window do not leak; one part in P + 1 of the plain ones adds what is left in the mean. The window takes in
    both neighbours of a line: where these are excited, and vary with the response, plain deviations stand alone.

    Args:
        samples (n_real, n_exp, n_period, n_sample, n_channel): Signals.
        lines (n_freq,): DFT lines of one period.
        beside (n_freq,): Whether a line has an excited neighbour.
        factor (n_freq, n_channel): What turns outputs, whose drift is removed, into those of the response; None
            for inputs.

    Returns:
        Mean (n_real, n_freq, n_channel, n_exp) and scatter (n_real, 2 (n_period - 1), n_freq, n_channel, n_exp).
    """
    n_period = samples.shape[2]
    plain, neighbours = _at_lines(samples, lines, drifts=factor is not None)
    # Hann window by neighbours in frequency; sqrt(1.5) makes white noise as large as without.
    hann = (plain - 0.5 * neighbours) / np.sqrt(1.5)
    scale = np.ones(1) if factor is None else factor
    # One part in P + 1 of plain deviations holds the leakage that is left in the mean; see above.
    share = np.where(beside, 1.0, 1 / (n_period + 1))[:, None]
    taken = period_contrasts(n_period)
    scatter = [
        np.einsum("dp,repfc->rdfce", taken, each) * (scale * np.sqrt(part / n_period))[..., None]
        for each, part in ((plain, share), (hann, 1 - share))
    ]
    return _experiments_last(plain.mean(axis=2) * scale), np.concatenate(scatter, axis=1)


def _at_lines(samples: FloatArray, lines: IntArray, *, drifts: bool) -> tuple[ComplexArray, ComplexArray]:
    """Amplitudes of each period at some lines (..., n_freq, n_channel), and the sums of those at their neighbours."""
    n_period, n_sample = samples.shape[2:4]
    spectrum = rfft(samples, axis=-2, norm="forward")
    # The spectrum of real signals goes on beyond line 0 and the highest one as in a mirror.
    end = n_sample // 2
    places = (lines, np.abs(lines - 1), end - np.abs(end - lines - 1))
    plain, below, above = (spectrum[..., place, :] for place in places)
    if drifts and n_period > 1:
        # A ramp from mean to mean of the periods is taken off: drift would leak over all lines.
        per_period = np.gradient(spectrum[..., 0, :].real, axis=2)[..., None, :]
        ramp = rfft(ramp_of_period(n_sample), axis=0, norm="forward")
        for each, place in zip((plain, below, above), places, strict=True):
            each -= per_period * ramp[place]
    return plain, below + above


def robust_blocks(record: Record, lines: IntArray, options: EstimateOptions, *, accelerations: bool = True) -> Blocks:
    """Transforms a record with its transient removed; scatter is the noise of lines and of the transient's estimate.

    In the spectrum over all P periods the excitation and what it causes lies at every P-th bin; between them are
    the transient, which is smooth over the bins, and noise. A polynomial through the bins around a line is the
    transient at the line, and its residual the noise.

    Args:
        record: Record of a single configuration.
        lines (n_freq,): DFT lines of one period.
        options: `local_order` and `local_half_width_lines`, here bins without excitation on each side of a line.
        accelerations: As in `robid.frf.spectra.record_blocks`.

    Raises:
        DataError: If the record holds one period only, or fewer bins than the window needs.

    Source:
        Pintelon, Schoukens, Vandersteen and Barbe (2010), MSSP 24(3), robust method.
    """
    periods, n_sample = record.inputs.shape[3:5]
    half_width = options.local_order + 1 if options.local_half_width_lines is None else options.local_half_width_lines
    _check(periods, n_sample, half_width, options.local_order)
    long, bins = record.as_one_period(), lines * periods
    # Bins between the lines hold transient and noise only: the excitation has none there.
    window = _silent_bins(bins, periods, half_width, periods * n_sample // 2)
    smooth = _Smooth((window - bins[:, None]) / (half_width * periods), options.local_order)
    both = np.concatenate([bins[:, None], window], axis=1)
    inputs, input_scatter = smooth.split(line_amplitudes(long.inputs[0, :, :, 0], both.ravel()))
    # Angles turn into accelerations before the fit: a ramp's spectrum is then a polynomial.
    motion = line_amplitudes(long.outputs[0, :, :, 0], both.ravel())
    factor = output_factor(long, both.ravel(), accelerations=accelerations)
    outputs, output_scatter = smooth.split(motion * factor)
    reference = None if record.reference is None else _experiments_last(line_amplitudes(record.reference[0], lines))
    # 2 half_width bins, of which the polynomial's coefficients take order + 1.
    freedom = 2 * half_width - options.local_order - 1
    return Blocks(lines, inputs, outputs, reference, input_scatter, output_scatter, freedom)


class _Smooth:
    """Polynomials through the windows of all lines, evaluated at the lines."""

    def __init__(self, offset: FloatArray, order: int) -> None:
        powers = offset[..., None] ** np.arange(order + 1)
        inverse = np.linalg.pinv(powers)
        self._centre = inverse[:, 0]
        self._residual = np.eye(offset.shape[1]) - powers @ inverse
        # The line's own noise and that of the polynomial at the line add up.
        self._scale = np.sqrt(1 + (self._centre**2).sum(axis=1))

    def split(self, spectrum: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Transient-free lines (n_real, n_freq, n_channel, n_exp) of lines and windows in one axis; their scatter."""
        shape = (*spectrum.shape[:2], len(self._centre), -1, spectrum.shape[-1])
        line, around = np.split(spectrum.reshape(shape), [1], axis=3)
        periodic = line[:, :, :, 0] - np.einsum("fw,refwc->refc", self._centre, around)
        scatter = np.einsum("fvw,refwc->rvfce", self._residual * self._scale[:, None, None], around, optimize=True)
        return np.asarray(np.moveaxis(periodic, 1, -1)), np.asarray(scatter)


def _silent_bins(bins: IntArray, periods: int, half_width: int, highest: int) -> IntArray:
    """Nearest bins (n_freq, 2 half_width) without excitation, as many on either side where the band allows."""
    silent = np.arange(1, highest)
    silent = silent[silent % periods > 0]
    first = np.clip(np.searchsorted(silent, bins) - half_width, 0, silent.size - 2 * half_width)
    return np.asarray(silent[first[:, None] + np.arange(2 * half_width)])


def _check(periods: int, n_sample: int, half_width: int, order: int) -> None:
    if periods < 2:
        message = "D026 `robust_local` finds the transient between the lines of several periods, but there is only one"
        raise DataError(message, remedy="record two periods or more, or use the estimator `local`")
    if 2 * half_width <= order + 1:
        message = f"D027 {2 * half_width} bins around a line leave no freedom beside a polynomial of order {order}"
        raise DataError(message, remedy=f"set `local_half_width_lines` to {order // 2 + 1} or more")
    if periods * (n_sample // 2) < 4 * half_width:
        message = f"D028 the record's {periods} periods of {n_sample} samples are too short for the window"
        raise DataError(message, remedy="record longer, or lower `local_half_width_lines`")
