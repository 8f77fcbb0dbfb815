"""The lines of a log that carry its excitation: those that were stated, or those that the data show."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter1d

from robid.arrays import FloatArray, IntArray
from robid.errors import DataError
from robid.logs.period import line_power

FEWEST = 4
"""Lines below which nothing is told of a response, unless fewer were stated."""

_SHOWN = 8
"""Runs of lines that a message lists."""

_WEAK = 1e-2
"""Power of a line, relative to the usual one of as many of the strongest lines, below which it carries nothing."""

_NOTHING = 1e-6
"""The same where nothing tells how large the noise is."""

_STANDS_OUT = 12.0
"""Power over that of the noise which chance reaches at one of 1e5 lines."""

_NEIGHBOURS = 9
"""Lines over which the power of the noise is averaged."""

_APART = 4.0
"""Distance of two kinds of lines over the scatter within them; the halves of a single kind are 3.5 apart at most."""

_LEAST_APART = 1.0
"""Decades of power between two kinds, at least."""

_FOUND = "Lines found to be excited"

_ROUNDING = 5e-10
"""Of the distance of two lines: what rounding leaves of a band's end that needs no digits beyond."""

_STEP = 0.1
"""Of the distance of two lines: as coarse as a band's ends are written at most."""


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

    Args:
        where: File and variable.
        blocks (n_period, n_sample): The input's periods; nothing is checked when there is none.
        lines (n_freq,): Lines that were said to be excited.
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
        f"Of the excited lines {format_lines(lines)} {int(carries.sum())} of {len(lines)} carry some of its energy,"
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
    what = f"{len(found)} of the {len(candidates)} lines of the band stand out of the noise; {needed} are needed."
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
