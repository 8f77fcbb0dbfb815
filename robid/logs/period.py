"""The period of a log, measured from its repetition, and the lines that carry its excitation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.interpolate import make_interp_spline
from scipy.signal import detrend

from robid.arrays import FloatArray, IntArray

_UNLIKE = 0.6
"""Mismatch between a signal and its shifted copy above which they have little in common; 1 is unrelated."""

_REPEATS = (0.1, 0.4)
"""Mismatch below which a signal counts as repeating where one or two shifts by its period show it.

With more of them it may be mostly noise, as long as it stands out of chance.
"""

_OVERLAP = 0.55
"""Shift, in lengths of the signal, up to which a single one shows another period than the stated one."""

_CHANCE = 8.0
"""Standard deviations of a chance correlation that stand out."""

_ALIKE = 0.005
"""Mismatch above twice the smallest one from which a shift is no period."""

_PHASE_LIMIT_RAD = 0.5
"""Largest drift of the highest excited line's phase over all periods that still counts as a whole period."""

_SIGMAS = 4.0
"""Standard deviations by which a measured period must differ before it is believed against the stated one."""

_NEAR = 0.01
"""Relative distance of a stated period from several real ones up to which these are meant."""

_DRIFT_LINES = 2
"""Lines that are not told from slow drift."""

_DEGREE = 7
"""Degree of the spline that is compared with its shifted copy."""

_STEPS = 4
"""Steps of the least squares, which begin within a fraction of a sample."""

_SHORTEST = 8
"""Shortest period that is looked for [samples]."""


@dataclass(frozen=True)
class Repetition:
    """How a signal repeats.

    Attributes:
        samples: Length of the shortest period, a fraction included; None when nothing repeats.
        std_samples: Its standard deviation.
        reachable: Whether the signal is long enough to compare the asked period with its repetition.
    """

    samples: float | None
    std_samples: float
    reachable: bool

    def multiple(self, stated: int) -> int:
        """How many of its periods the stated one is nearest to."""
        return 1 if self.samples is None else max(round(stated / self.samples), 1)

    def agrees(self, stated: int, lines: IntArray) -> bool:
        """Whether the stated period holds whole periods, and the stated lines are lines of these."""
        if self.samples is None:
            return not self.reachable
        count = self.multiple(stated)
        whole = abs(count * self.samples - stated) < max(0.5, _SIGMAS * count * self.std_samples)
        return bool(whole and not np.any(lines % count))

    def proposed(self, stated: int, lines: IntArray) -> int:
        """The whole period to propose: as many periods as were meant, if the stated lines fit them, else one."""
        if self.samples is None:
            return stated
        count = self.multiple(stated)
        meant = abs(count * self.samples / stated - 1) < _NEAR and not np.any(lines % count)
        return round((count if meant else 1) * self.samples)

    def drifts(self, periods: int, stated: int, lines: IntArray) -> bool:
        """Whether a period that is no whole number of samples spoils the average over the periods."""
        if self.samples is None:
            return False
        count = self.multiple(stated)
        fraction = abs(count * self.samples - stated)
        phase = fraction * (periods - 1) * 2 * np.pi * float(lines.max()) / stated
        return bool(phase > _PHASE_LIMIT_RAD and fraction > _SIGMAS * count * self.std_samples)


def measure_repetition(signal: FloatArray, stated: int, lines: IntArray) -> Repetition:
    """Measures the shortest period of a signal, whatever was stated.

    Shifts at which the signal is most like itself are its periods; the farther of them give the period to a fraction
    of a sample.

    Args:
        signal (n_sample,): The signal.
        stated: The period that it is said to have [samples].
        lines (n_lines,): Lines of that period that are said to be excited.
    """
    # Slow drift is told from the excitation only where the first lines are left out.
    low = lines.min() / stated if lines.min() > _DRIFT_LINES else 0.0
    level = np.asarray(detrend(signal))
    flat = limit_band(level, low, lines.max() / stated)
    mismatch = _mismatch(flat)
    reachable = stated < len(mismatch)
    outside = np.flatnonzero(mismatch > _UNLIKE)
    # Correlation that chance may give to so many independent samples.
    chance = min(_CHANCE / np.sqrt(max(2 * lines.max() / stated * len(flat), 1.0)), 1.0)
    limit = max(1 - chance, _REPEATS[0])
    found = _minima(mismatch, max(int(outside[0]), _SHORTEST), limit) if len(outside) else []
    nothing = Repetition(None, 0.0, reachable)
    if not found:
        return nothing
    least = min(each.mismatch for each in found)
    good = [each for each in found if each.mismatch <= least + min(least, chance) + _ALIKE]
    period, count = _follow(good)
    if count <= len(_REPEATS) and least > _REPEATS[count - 1 if reachable else 0]:
        return nothing
    # Slow wandering is like itself, too, where little of it is left to compare.
    if count == 1 and period > _OVERLAP * len(flat) and abs(period / stated - 1) > _NEAR:
        return nothing
    return Repetition(*_refine(level, period, count), reachable)


@dataclass(frozen=True)
class _Minimum:
    """A shift at which a signal is like itself [samples], and its mismatch there."""

    shift: float
    mismatch: float


def _minima(mismatch: FloatArray, first: int, highest: float) -> list[_Minimum]:
    """Minima beyond a first shift and below a highest mismatch, by the parabolas through three points."""
    before, here, after = mismatch[first - 1 : -2], mismatch[first:-1], mismatch[first + 1 :]
    at = np.flatnonzero((here < before) & (here <= after) & (here < highest))
    bend = (before + after - 2 * here)[at]
    lean = ((before - after) / 2)[at]
    shifts, depths = first + at + lean / bend, here[at] - lean**2 / (2 * bend)
    return [_Minimum(*each) for each in zip(shifts.tolist(), np.maximum(depths, 0.0).tolist(), strict=True)]


def _follow(good: list[_Minimum]) -> tuple[float, int]:
    """Period by the shortest of these shifts and its multiples among them, and how many follow each other."""
    period, count = good[0].shift, 1
    for each in good[1:]:
        # Shifts beside a multiple are the signal's own waves.
        if abs(each.shift - (count + 1) * period) < max(_NEAR * period, 1.0):
            count += 1
            period = each.shift / count
    return period, count


def _refine(signal: FloatArray, period: float, count: int) -> tuple[float, float]:
    """Period and its standard deviation, by least squares between the signal and its copy some periods later."""
    index = np.arange(float(len(signal)))
    curve = make_interp_spline(index, signal, k=_DEGREE)
    shift, step = period * count, 0.0
    inside = index[: max(int(len(signal) - shift) - 1, _SHORTEST)]
    # At the samples noise and its slope have nothing in common, nor have the slopes of two periods' noise.
    slope = curve.derivative()
    steep = slope(inside)
    square = float(steep @ slope(inside + shift))
    if square <= 0:
        return period, 1.0
    for _ in range(_STEPS):
        apart = curve(inside + shift) - signal[: len(inside)]
        step = float(np.clip((apart - apart.mean()) @ steep / square, -0.5, 0.5))
        shift -= step
    spread = float(np.sqrt(np.sum(((apart - apart.mean()) * steep) ** 2)) / square)
    return shift / count, max(spread, abs(step)) / count


def measure_share(periods: FloatArray, lines: IntArray) -> tuple[float, IntArray]:
    """Returns the stated lines' share of the averaged period's energy, and the lines that really carry it.

    Args:
        periods (n_period, n_sample): The signal.
        lines (n_lines,): Stated lines.
    """
    mean, _ = line_power(periods)
    mean[0] = 0
    carrying = np.flatnonzero(mean > 1e-2 * np.sort(mean)[-max(len(lines) // 2, 1)])
    return float(mean[lines].sum() / mean.sum()), carrying


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


def limit_band(signal: FloatArray, low: float, high: float) -> FloatArray:
    """Keeps half the lowest to twice the highest stated frequency, unless little of the energy is there."""
    spectrum = rfft(signal)
    frequency = np.arange(len(spectrum)) / len(signal)
    kept = np.where((frequency >= low / 2) & (frequency <= 2 * high), spectrum, 0)
    enough = np.sum(np.abs(kept) ** 2) > 0.1 * np.sum(np.abs(spectrum) ** 2)
    return np.asarray(irfft(kept, len(signal))) if enough else signal
