"""Steady-state spectra of records that still hold a transient, by the robust local polynomial method."""

from __future__ import annotations

import numpy as np

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.errors import DataError
from robid.frf.options import EstimateOptions
from robid.frf.spectra import Blocks, line_amplitudes, output_factor
from robid.signals.record import Record


def robust_blocks(record: Record, lines: IntArray, options: EstimateOptions, *, accelerations: bool = True) -> Blocks:
    """Transforms one configuration's record with its transient removed, noise from the bins between the lines.

    In the spectrum over all P periods the excitation and what it causes lies at every P-th bin; between them are
    the transient, which is smooth over the bins, and noise. A polynomial through the bins around a line is the
    transient at the line, and its residual the noise.

    Args:
        record: Record of a single configuration.
        lines (n_freq,): DFT lines of one period.
        options: `local_order` and `local_half_width_lines`, here bins without excitation on each side of a line.
        accelerations: As in `robid.frf.spectra.record_blocks`.

    Returns:
        The spectra; their scatter is the noise of the line and of the transient's estimate.

    Raises:
        DataError: If the record holds one period only, or fewer bins than the window needs.

    Source:
        Pintelon, Schoukens, Vandersteen and Barbe (2010), Mechanical Systems and Signal Processing 24(3) (robust
        method).
    """
    periods, n_sample = record.inputs.shape[3:5]
    half_width = options.local_order + 1 if options.local_half_width_lines is None else options.local_half_width_lines
    _check(periods, n_sample, half_width, options.local_order)
    long, bins = record.as_one_period(), lines * periods
    window = _silent_bins(bins, periods, half_width, periods * n_sample // 2)
    smooth = _Smooth((window - bins[:, None]) / (half_width * periods), options.local_order)
    both = np.concatenate([bins[:, None], window], axis=1)
    inputs, input_scatter = smooth.split(line_amplitudes(long.inputs[0, :, :, 0], both.ravel()))
    # Angles turn into accelerations before the fit: a ramp's spectrum is then a polynomial.
    motion = line_amplitudes(long.outputs[0, :, :, 0], both.ravel())
    factor = output_factor(long, both.ravel(), accelerations=accelerations)
    outputs, output_scatter = smooth.split(motion * factor)
    reference = None if record.reference is None else line_amplitudes(record.reference[0], lines)
    return Blocks(
        lines=lines,
        inputs=inputs,
        outputs=outputs,
        reference=None if reference is None else np.moveaxis(reference, 1, -1),
        input_scatter=input_scatter,
        output_scatter=output_scatter,
        scatter_freedom=2 * half_width - options.local_order - 1,
    )


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
