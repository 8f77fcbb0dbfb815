"""The period of a log, measured from its repetition, and the lines that carry its excitation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.interpolate import make_interp_spline
from scipy.ndimage import uniform_filter1d
from scipy.signal import detrend

from robid.arrays import FloatArray, IntArray
from robid.errors import DataError

_UNLIKE = 0.6  # mismatch between a signal and its shifted copy above which they have little in common; 1 is unrelated
_REPEATS = (0.1, 0.4)
"""Mismatch below which a signal counts as repeating where one or two shifts by its period show it.

With more of them it may be mostly noise, as long as it stands out of chance.
"""

_OVERLAP = 0.55  # shift, in lengths of the signal, up to which a single one shows another period than the stated one
_CHANCE = 8.0  # standard deviations of a chance correlation that stand out
_ALIKE = 0.005  # mismatch above twice the smallest one from which a shift is no period
# Largest drift of the highest excited line's phase over all periods that still counts as a whole period
_PHASE_LIMIT_RAD = 0.5
_SIGMAS = 4.0  # standard deviations by which a measured period must differ before it is believed against the stated one
_NEAR = 0.01  # relative distance of a stated period from several real ones up to which these are meant
_DRIFT_LINES = 2  # lines that are not told from slow drift
_DEGREE = 7  # degree of the spline that is compared with its shifted copy
_STEPS = 4  # steps of the least squares, which begin within a fraction of a sample
_SHORTEST = 8  # shortest period that is looked for [samples]


@dataclass(frozen=True)
class Repetition:
    """How a signal repeats."""

    samples: float | None  # Length of the shortest period, a fraction included; None when nothing repeats
    std_samples: float  # Its standard deviation
    reachable: bool  # Whether the signal is long enough to compare the asked period with its repetition

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

    Shifts at which the signal is most like itself are its periods; the farther of them give the period to a fraction of
    a sample.

    `lines` (n_lines,) of the stated period [samples] are said to be excited in the signal (n_sample,).
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
    """Returns the share of lines (n_lines,) of the mean period's energy (n_period, n_sample), and which carry it."""
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


FEWEST = 4
"""Lines below which nothing is known of a response, unless fewer were stated."""

_SHOWN = 8  # runs of lines that a message lists
# Power of a line, relative to the usual one of as many of the strongest lines, below which it carries nothing
_WEAK = 1e-2
_NOTHING = 1e-6  # the same where nothing tells how large the noise is
_STANDS_OUT = 12.0  # power over that of the noise which chance reaches at one of 1e5 lines
_NEIGHBOURS = 9  # lines over which the power of the noise is averaged
# Distance of two kinds of lines over the scatter within them; the halves of a single kind are 3.5 apart at most
_APART = 4.0
_LEAST_APART = 1.0  # decades of power between two kinds, at least
_FOUND = "Lines found to be excited"
_ROUNDING = 5e-10  # of the distance of two lines: what rounding leaves of a band's end that needs no digits beyond
_STEP = 0.1  # of the distance of two lines: as coarse as a band's ends are written at most


def band_of(first: float, last: float, period_s: float) -> tuple[float, float]:
    """Returns a band that holds some lines and no others, its ends with few digits, rounded outwards.

    Args:
        first: Number of its first line, or a place between it and the one before.
        last: Number of its last line, or a place between it and the next.
        period_s: Period [s].

    Returns:
        Lowest and highest frequency [Hz].
    """
    decimals = -int(np.floor(np.log10(_STEP / period_s)))
    scale = 10.0**decimals
    # Less than what a choice of lines passes over, so that no line is lost to it.
    slack = _ROUNDING / period_s * scale
    low, high = np.floor(first / period_s * scale + slack), np.ceil(last / period_s * scale - slack)
    return round(float(low / scale), max(decimals, 0)), round(float(high / scale), max(decimals, 0))


def check_lines(where: str, blocks: FloatArray, lines: IntArray) -> list[DataError]:
    """Refuses stated lines of which hardly any carries the excitation; single weak ones are left to the estimate.

    `blocks` (n_period, n_sample) are the input's periods; nothing is checked where there is none.
    """
    if not len(blocks):
        return []
    mean, _ = line_power(blocks)
    mean[0] = 0
    strongest = np.sort(mean)[-len(lines) :]
    carries = mean[lines] > _WEAK * np.median(strongest)
    needed = min(FEWEST, len(lines))
    share = float(mean[lines].sum() / max(mean.sum(), np.finfo(float).tiny))
    if carries.sum() >= needed and (2 * carries.sum() >= len(lines) or share >= 0.5):
        return []
    carrying = np.flatnonzero(mean > _WEAK * np.median(np.sort(mean)[-max(len(lines) // 2, 1) :]))
    what = (
        f"D096 Of the excited lines {format_lines(lines)} {int(carries.sum())} of {len(lines)} carry some of its "
        "energy,"
        f" {100 * share:.1f} % in all; {needed} are needed at least, and half of them unless they have half of it."
    )
    remedy = (
        f"The energy is at lines {format_lines(carrying)}: correct the excitation's band, lines or period, or let"
        " `lines: found` look for them."
    )
    return [DataError(what, where=where, remedy=remedy)]


def find_lines(signals: list[FloatArray], candidates: IntArray) -> IntArray:
    """Finds the lines at which some input is excited.

    A line tells if its power stands out of what the periods scatter. Distortion that repeats does as well: where the
    lines fall into two kinds, strong and weak ones, the strong ones are meant.

    Args:
        signals: Periods (n_period, n_sample) of each input.
        candidates (n_line,): Lines among which they are.
    """
    found = [_telling(*line_power(periods), candidates) for periods in signals if np.ptp(periods) > 0]
    return np.unique(np.concatenate([*found, candidates[:0]]))


def _telling(mean: FloatArray, noise: FloatArray, candidates: IntArray) -> IntArray:
    """Candidates that stand out of the noise and are not the weaker of two kinds."""
    power = mean[candidates]
    level = uniform_filter1d(noise, _NEIGHBOURS)[candidates] if noise.any() else np.zeros(len(power))
    stands = power > np.maximum(_STANDS_OUT * level, _NOTHING * np.quantile(power, 0.95))
    if stands.sum() < FEWEST:
        return np.asarray(candidates[stands])
    size = np.log10(power[stands])
    strong = size > _split(size)
    # A few that are stronger, as one line of a slow motion, are no kind of their own.
    return np.asarray(candidates[stands][strong] if strong.sum() >= FEWEST else candidates[stands])


def _split(size: FloatArray) -> float:
    """What separates two kinds of values; below all of them where they are of one kind.

    Source:
        Otsu (1979), IEEE Transactions on Systems, Man, and Cybernetics 9(1).
    """
    ordered = np.sort(size)
    count = np.arange(1, len(ordered))
    total, square = np.cumsum(ordered), np.cumsum(ordered**2)
    low, high = total[:-1] / count, (total[-1] - total[:-1]) / count[::-1]
    within = square[-1] - count * low**2 - count[::-1] * high**2
    best = int(np.argmin(within))
    scatter = np.sqrt(max(within[best], 0.0) / len(ordered))
    if high[best] - low[best] <= max(_APART * scatter, _LEAST_APART):
        # A few strong lines hardly lower the scatter: what tells them is that nothing lies between.
        gap = np.diff(ordered) * (2 * count >= len(ordered))
        best = int(np.argmax(gap))
        if gap[best] <= _LEAST_APART:
            return -np.inf
    return float((ordered[best] + ordered[best + 1]) / 2)


def check_found(where: str, found: IntArray, candidates: IntArray) -> list[DataError]:
    """Refuses a log in whose band too few lines stand out."""
    needed = min(FEWEST, len(candidates))
    if len(found) >= needed:
        return []
    what = f"D097 {len(found)} of the {len(candidates)} lines of the band stand out of the noise; {needed} are needed."
    remedy = "Correct the band or the period, use more periods, or state the signal as `arbitrary`."
    return [DataError(what, where=where, remedy=remedy)]


def found_note(found: IntArray, count: int) -> str:
    """Says which lines of a band, of `count` in all, were found."""
    return f"{_FOUND}: {format_lines(found)}, {len(found)} of {count} of the band."


def is_found_note(note: str) -> bool:
    """Whether a note of a record says which lines were found."""
    return note.startswith(_FOUND)


def format_lines(lines: IntArray) -> str:
    """Writes rising lines as runs of equal steps: `11-250, 301-399 by 2`."""
    runs: list[list[int]] = []
    for line in map(int, lines):
        last = runs[-1] if runs else []
        if len(last) == 1 or (len(last) > 1 and line - last[-1] == last[1] - last[0]):
            last.append(line)
        else:
            runs.append([line])
    texts = []
    for run in runs[:_SHOWN]:
        step = run[1] - run[0] if len(run) > 1 else 1
        texts.append(str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" + (f" by {step}" if step > 1 else ""))
    return ", ".join(texts) + (", ..." if len(runs) > _SHOWN else "")
