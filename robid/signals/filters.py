"""Filters without phase: low pass forward and backward, central differences, and decimation of kept samples only."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray, IntArray

_DECAYED = 1e-4  # of its peak, an impulse response that counts as over
_ANGLES = 8192
_LONGEST = 100_000_000  # samples
_MOST = 100_000  # samples per kept sample: a filter of a million taps
_BLOCK = 16  # kept samples of one matrix product: few, so that a block of samples stays in the cache


def low_pass(signal: FloatArray, sampling_period_s: float, cut_hz: float, order: int = 4) -> FloatArray:
    """Filters forward and backward with a Butterworth low pass.

    Args:
        signal (n_sample, ...): Samples.
        sampling_period_s: Sampling period [s].
        cut_hz: Where one pass has lost 3 dB, both passes 6 dB [Hz].
        order: Order of one pass.

    Returns:
        Filtered samples, of the same shape.

    Raises:
        ValueError: If the cut-off is not below half the sampling rate.
    """
    from scipy.signal import sosfiltfilt

    sections = _butterworth(sampling_period_s, cut_hz, order)
    filtered = np.empty(signal.shape)
    for index in np.ndindex(signal.shape[1:]):  # one at a time: what it needs beside them is as long as one
        filtered[:, *index] = sosfiltfilt(sections, signal[:, *index])
    return filtered


def low_pass_reach(sampling_period_s: float, cut_hz: float, order: int = 4) -> int:
    """Returns how many samples the ends of a record reach into what `low_pass` returns.

    Raises:
        ValueError: If that is more than any record has.
    """
    from scipy.signal import sosfilt

    length = 64 + int(8 * order / (sampling_period_s * cut_hz))
    if length > _LONGEST:
        raise ValueError(
            f"A low pass at {cut_hz:g} Hz reaches over more samples of {sampling_period_s:g} s than any record has."
        )
    impulse = np.zeros(length)
    impulse[0] = 1.0
    response = np.abs(sosfilt(_butterworth(sampling_period_s, cut_hz, order), impulse))
    return int(np.flatnonzero(response > _DECAYED * response.max())[-1]) + 1


def low_pass_gain(sampling_period_s: float, cut_hz: float, order: int = 4) -> tuple[FloatArray, FloatArray]:
    """Returns angles per sample (n_angle,) from 0 to pi [rad], and what `low_pass` leaves of an amplitude there."""
    from scipy.signal import sosfreqz

    angle, response = sosfreqz(_butterworth(sampling_period_s, cut_hz, order), _ANGLES)
    return np.asarray(angle), np.abs(response) ** 2


def _butterworth(sampling_period_s: float, cut_hz: float, order: int) -> FloatArray:
    from scipy.signal import butter

    nyquist_hz = 0.5 / sampling_period_s
    if not 0 < cut_hz < nyquist_hz:
        message = f"The cut-off must lie between 0 and {nyquist_hz:g} Hz, half the sampling rate, but is {cut_hz:g} Hz."
        raise ValueError(message)
    return np.asarray(butter(order, cut_hz, fs=1 / sampling_period_s, output="sos"))


def central_differences(position: FloatArray, sampling_period_s: float) -> tuple[FloatArray, FloatArray]:
    """Differentiates once and twice; each end loses one sample.

    Args:
        position (n_sample, ...): Positions.
        sampling_period_s: Sampling period [s].

    Returns:
        Velocity and acceleration (n_sample - 2, ...) at the inner samples.
    """
    velocity = (position[2:] - position[:-2]) / (2 * sampling_period_s)
    acceleration = (position[2:] - 2 * position[1:-1] + position[:-2]) / sampling_period_s**2
    return velocity, acceleration


@dataclass(frozen=True)
class Decimator:
    """A symmetric low pass that computes only the samples that are kept."""

    factor: int  # Samples per kept sample
    kernel: FloatArray  # (2 n + 1,) Impulse response

    @property
    def reach(self) -> int:
        """Samples that a kept one needs before it, and behind it."""
        return len(self.kernel) // 2

    def kept(self, n_sample: int) -> IntArray:
        """Returns the indices of the samples that are kept of so many: those with the whole kernel inside."""
        return np.arange(self.reach, n_sample - self.reach, self.factor)

    def __call__(self, samples: FloatArray) -> FloatArray:
        """Filters and decimates.

        Args:
            samples (n_sample, ...): Samples; fastest where they lie last in memory.

        Returns:
            Kept samples (n_kept, ...), with the same order in memory.
        """
        n_kept = len(self.kept(len(samples)))
        lines = np.ascontiguousarray(np.moveaxis(samples, 0, -1), dtype=float).reshape(-1, len(samples))
        result = np.empty((len(lines), n_kept))
        for first in range(0, n_kept, _BLOCK):
            band = _banded(self.kernel, self.factor, min(_BLOCK, n_kept - first))
            start = first * self.factor
            np.matmul(lines[:, start : start + band.shape[0]], band, out=result[:, first : first + band.shape[1]])
        return np.moveaxis(result.reshape(*samples.shape[1:], n_kept), -1, 0)

    def autocorrelation(self, n_lag: int) -> FloatArray:
        """Returns what white samples' kept ones are correlated, at lags 0 to `n_lag` of kept samples; 1 at lag 0."""
        whole = np.convolve(self.kernel, self.kernel)[len(self.kernel) - 1 :: self.factor]
        return np.asarray(np.pad(whole, (0, max(0, n_lag + 1 - len(whole))))[: n_lag + 1] / whole[0])


def _banded(kernel: FloatArray, factor: int, n_kept: int) -> FloatArray:
    """One column a kept sample: blocks of it turn the filter into matrix products."""
    band = np.zeros(((n_kept - 1) * factor + len(kernel), n_kept))
    for column in range(n_kept):
        band[column * factor : column * factor + len(kernel), column] = kernel
    return band


def design_decimator(factor: int, transition: float = 0.4, attenuation_db: float = 80.0) -> Decimator:
    """Designs a windowed sinc whose cut-off is half the kept samples' rate.

    Args:
        factor: Samples per kept sample; 1 keeps all as they are.
        transition: Width of the band about the cut-off in which it falls, relative to the cut-off.
        attenuation_db: Attenuation of what would be folded from beyond that band [dB].

    Raises:
        ValueError: If there are so many samples per kept sample that the filter is longer than any record.

    Source:
        Kaiser window: Oppenheim and Schafer, Discrete-Time Signal Processing.
    """
    if factor == 1:
        return Decimator(1, np.ones(1))
    if factor > _MOST:
        raise ValueError(f"A cut-off so low keeps one of {factor} samples, more than the {_MOST} that any record has.")
    from scipy.signal import firwin, kaiserord

    taps, shape = kaiserord(attenuation_db, transition / factor)
    kernel = firwin(2 * (taps // 2) + 1, 1 / factor, window=("kaiser", shape))
    return Decimator(factor, np.asarray(kernel))
