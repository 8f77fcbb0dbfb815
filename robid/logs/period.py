"""The period of a log, measured from its repetition, and the lines that carry its excitation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.signal import detrend

from robid.arrays import ComplexArray, FloatArray, IntArray

_UNLIKE = 0.6
"""Mismatch between a signal and its shifted copy above which they have little in common; 1 is unrelated."""

_REPEATS = 0.4
"""Mismatch below which a signal counts as repeating."""

_PHASE_LIMIT_RAD = 0.5
"""Largest drift of the highest excited line's phase over all periods that still counts as a whole period."""

_SIGMAS = 4.0
"""Standard deviations by which a measured period must differ before it is believed against the stated one."""

_REACH = 6.0
"""Samples within which one pass of the refinement searches."""

_SHORTEST = 8
"""Shortest period that is looked for [samples]."""


@dataclass(frozen=True)
class Repetition:
    """How a signal repeats.

    Attributes:
        samples: Length of the period, a fraction included; None when nothing repeats.
        std_samples: Its standard deviation.
        multiple: How often that period fits the one that was asked about: 1 unless it holds several.
        reachable: Whether the signal is long enough to compare the asked period with its repetition.
    """

    samples: float | None
    std_samples: float
    multiple: int
    reachable: bool

    def agrees(self, stated: int) -> bool:
        """Whether the measured period is the stated one, as far as it can be told."""
        return self.samples is not None and abs(self.samples - stated) < max(0.5, _SIGMAS * self.std_samples)

    def drifts(self, periods: int, lines: IntArray) -> bool:
        """Whether a period that is no whole number of samples spoils the average over the periods."""
        if self.samples is None:
            return False
        fraction = abs(self.samples - round(self.samples))
        phase = fraction * (periods - 1) * 2 * np.pi * float(lines.max()) / self.samples
        return phase > _PHASE_LIMIT_RAD and fraction > _SIGMAS * self.std_samples


def measure_repetition(signal: FloatArray, stated: int, lines: IntArray) -> Repetition:
    """Measures the period of a signal, near the stated one first and then anywhere.

    The mismatch of the signal with its shifted copy finds the period roughly; the phases of successive periods
    then give it to a fraction of a sample, which shows a period off by one even where it looks plausible.

    Args:
        signal (n_sample,): The signal.
        stated: The period that it is said to have [samples].
        lines (n_lines,): Lines of that period that are said to be excited.
    """
    flat = _limit_band(np.asarray(detrend(signal)), lines.min() / stated, lines.max() / stated)
    mismatch = _mismatch(flat)
    outside = np.flatnonzero(mismatch > _UNLIKE)
    reachable = stated < len(mismatch)
    nothing = Repetition(None, 0.0, 1, reachable)
    if not len(outside):
        return nothing
    lobe = max(int(outside[0]), _SHORTEST)
    beyond = mismatch[lobe:]
    # Where the stated period is out of reach, only a clear shorter repetition speaks against it.
    if beyond.min() > (_REPEATS if reachable else _REPEATS / 4):
        return nothing
    good = 2 * beyond.min() + 0.02
    first = lobe + int(np.flatnonzero(beyond <= good)[0])
    shortest = first + int(np.argmin(mismatch[first : first + lobe + 1]))
    low = max(stated - lobe, lobe)
    near = mismatch[low : stated + lobe + 1]
    is_near = reachable and len(near) > 0 and near.min() <= good
    band = lines / stated if is_near else None
    samples, deviation = _refine(flat, low + int(np.argmin(near)) if is_near else shortest, band)
    multiple = max(round(samples / shortest), 1)
    fits = abs(samples - multiple * shortest) <= 2 * multiple
    return Repetition(samples, deviation, multiple if fits else 1, reachable)


def line_power(periods: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Power of the averaged period at each line, and the power that noise contributes to it."""
    spectrum = rfft(periods - periods.mean(axis=1, keepdims=True), axis=1)
    mean = spectrum.mean(axis=0)
    spread = np.sum(np.abs(spectrum - mean) ** 2, axis=0)
    return np.abs(mean) ** 2, np.asarray(spread / max(len(periods) - 1, 1) / len(periods))


def _mismatch(signal: FloatArray) -> FloatArray:
    """Squared difference between a signal and its copy, over their energy, for shifts up to 3/4 of its length."""
    n_sample = len(signal)
    length = next_fast_len(2 * n_sample, real=True)
    correlation = irfft(np.abs(rfft(signal, length)) ** 2, length)[:n_sample]
    energy = np.concatenate([[0.0], np.cumsum(signal**2)])
    shifts = np.arange(3 * n_sample // 4)
    both = energy[n_sample - shifts] + energy[-1] - energy[shifts]
    return np.asarray(1 - 2 * correlation[shifts] / np.maximum(both, np.finfo(float).tiny))


def _limit_band(signal: FloatArray, low: float, high: float) -> FloatArray:
    """Keeps half the lowest to twice the highest stated frequency, unless little of the energy is there."""
    spectrum = rfft(signal)
    frequency = np.arange(len(spectrum)) / len(signal)
    kept = np.where((frequency >= low / 2) & (frequency <= 2 * high), spectrum, 0)
    enough = np.sum(np.abs(kept) ** 2) > 0.1 * np.sum(np.abs(spectrum) ** 2)
    return np.asarray(irfft(kept, len(signal))) if enough else signal


def _refine(signal: FloatArray, start: int, band: FloatArray | None) -> tuple[float, float]:
    """Period and its standard deviation to a fraction of a sample, from the phases between successive periods.

    Args:
        signal (n_sample,): The signal.
        start: Period to begin with [samples].
        band (n_lines,): Excited frequencies in cycles per sample, or None for all.
    """
    samples, deviation = float(start), np.inf
    for _ in range(5):
        whole = max(round(samples), _SHORTEST)
        frequency, cross = _cross_spectrum(signal, whole)
        if band is not None:
            kept = np.unique(np.round(band * (len(signal) - whole if whole * 2 > len(signal) else whole)).astype(int))
            frequency, cross = frequency[kept], cross[kept]
        shift, deviation = _peak_shift(2 * np.pi * frequency, cross)
        samples = whole - shift
        if abs(shift) <= 0.5:
            break
    return samples, deviation


def _cross_spectrum(signal: FloatArray, period: int) -> tuple[FloatArray, ComplexArray]:
    """Frequencies (cycles per sample) and the cross spectrum between each period and the next, summed."""
    size = min(period, len(signal) - period)
    total = np.zeros(size // 2 + 1, complex)
    for start in range(0, len(signal) - period - size + 1, period):
        first, second = signal[start : start + size], signal[start + period : start + period + size]
        total += np.conj(rfft(first)) * rfft(second)
    return np.arange(len(total)) / size, total


def _peak_shift(omega: FloatArray, cross: ComplexArray) -> tuple[float, float]:
    """Delay (in samples, within the reach) at which two signals agree best, with its standard deviation."""
    best, step = 0.0, _REACH / 24
    for _ in range(4):
        shifts = best + step * np.arange(-24, 25)
        best = float(shifts[np.argmax(np.real(np.exp(-1j * np.outer(shifts, omega)) @ cross))])
        step /= 10
    aligned = cross * np.exp(-1j * omega * best)
    curvature = float(np.sum(omega**2 * aligned.real))
    spread = float(np.sqrt(np.sum((omega * aligned.imag) ** 2)))
    return best, spread / curvature if curvature > 0 else np.inf
