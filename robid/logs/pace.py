"""The pace of time stamps: step, gaps and what rounding hides, of stamps as fine or as coarse as loggers write them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from robid.arrays import BoolArray, FloatArray, IntArray

GAP = 1.5
"""Time step, in usual ones, from which samples are missing."""

JITTER = 0.05
"""Largest deviation of a time step from the usual one, relative, that still counts as regular."""

_SCATTERED = 5.0  # standard deviations of the steps, of a clock that jitters, within which a longer one is no gap
_EVEN = 0.5  # deviation of a step, relative, up to which it counts as a usual one
_USUAL = 0.95  # share of usual steps from which the others are gaps
_FINE = 0.02  # rounding, in usual steps, below which it is none
_WHOLE = 0.02  # distance of a step from whole roundings that the number format leaves, in roundings
# Odd steps from which, evenly spread, they may be those of a clock beside the rounding; fewer are gaps or repeats
_FEW = 3
_EQUAL = 1e-4  # difference of two steps, in usual ones, up to which they are equal: floating point leaves it
_LOOKED = 1_000_000  # steps by which the rounding is told
_FAR = 100.0  # steps, in usual ones, from which they are gaps and tell no rounding
_AGREE = 0.6  # share of the windows that have to agree on a step where samples may be lost within the others
_LONGEST = 64  # changes of the stamp over which a jump is averaged
_BLOCKS = 2000  # blocks of which only the extremes are kept to fit a line


@dataclass(frozen=True)
class Pace:
    """How stamps advance."""

    step: float  # Step of the samples, gaps left out, in the stamps' unit
    unsure: float  # Relative error that it may have for what the rounding hides and the stamps wander
    rounding: float  # What the stamps are rounded to; 0 where that is far below a step
    # (n_sample,) Time of each sample since the first: by the stamps, or where they are rounded the even times beneath
    # them
    times: FloatArray
    gaps: IntArray  # (n_gap,) Samples after which others are missing
    first: float = 0.0  # Time of the first sample since its stamp, where stamps are cut off and not rounded up
    loose: float = 0.0  # How far off that may be for what the rounding hides

    @property
    def is_coarse(self) -> bool:
        """Whether several samples share a stamp."""
        return self.rounding > self.step


def longest_piece(gaps: IntArray, count: int) -> tuple[int, int]:
    """Returns first sample of the longest part between gaps, each behind one of these, and the one after its last."""
    edges = np.concatenate([[0], gaps + 1, [count]])
    longest = int(np.argmax(np.diff(edges)))
    return int(edges[longest]), int(edges[longest + 1])


def measure_pace(stamps: FloatArray, stated: float | None = None) -> Pace | None:
    """Measures how stamps advance.

    Where stamps are rounded, evenly spaced samples lie beneath them on a line that is never further off than the
    rounding, or, where several samples share a stamp, than one sample at each change of it: that line's slope is the
    step, known the better the longer the log. Lost samples show as jumps beside it.

    Args:
        stamps (n_sample,): The stamps, from anywhere on.
        stated: The step as it was stated, which is kept where the stamps cannot tell it from theirs.

    Returns:
        The pace; None where they go back, never change, or repeat at single places as no rounding makes them.
    """
    stamps = stamps - stamps[0]
    steps = np.diff(stamps)
    if len(steps) < 2 or steps.min() < 0 or not stamps[-1] > 0:
        return None
    rounding = _rounding(steps)
    usual = float(np.median(steps))
    odd = np.abs(steps - usual) > _EVEN * usual
    if usual > 0 and np.mean(odd) <= 1 - _USUAL and not _is_beside(steps, odd, rounding, stated):
        return None if np.any(steps == 0) else _fine(stamps, steps, usual, rounding, stated)
    return _coarse(stamps, steps, rounding, stated)


def _is_beside(steps: FloatArray, odd: BoolArray, rounding: float, stated: float | None) -> bool:
    """Whether the few odd steps are those of a rounded clock that is slightly beside its rounding, as was stated.

    Samples that are lost as evenly would look the same.
    """
    if stated is None or np.count_nonzero(odd) < _FEW or not rounding:
        return False
    at = np.arange(float(len(steps) + 1))
    line = _narrowest(at, np.concatenate([[0.0], np.cumsum(steps)]))
    return bool(line.far(stated) <= _width(stated, rounding))


def _rounding(steps: FloatArray) -> float:
    """What stamps are rounded to, told by their steps, which are all multiples of it; 0 where nothing tells it."""
    scale = float(np.median(steps[steps > 0]))
    different = np.unique(np.round(np.concatenate([[0.0], steps[:_LOOKED]]) / scale, 6))
    different = different[different < _FAR]
    apart = np.diff(different)
    # What floating point leaves of equal steps is no distance between different ones.
    apart = apart[apart > _EQUAL]
    if not len(apart):
        return 0.0
    least = float(apart.min())
    whole = np.abs(different / least - np.round(different / least)) < _WHOLE
    return least * scale if np.all(whole) and least * scale > _FINE * float(np.mean(steps)) else 0.0


def _fine(stamps: FloatArray, steps: FloatArray, usual: float, rounding: float, stated: float | None) -> Pace:
    """The pace of stamps with a usual step: longer ones are gaps."""
    # The scatter by its median, which gaps do not widen: of stamps that jitter the longest steps are no gaps, and
    # without them the mean step would be too short.
    scatter = 0.0 if rounding else 1.4826 * float(np.median(np.abs(steps - usual)))
    gaps = np.flatnonzero(steps > max(GAP * usual, usual + _SCATTERED * scatter))
    inside = np.delete(steps, gaps)
    step = float(inside.mean())
    unsure = float(np.abs(inside - step).max()) / (step * len(inside))
    if rounding and np.ptp(inside) > _FINE * step:
        at = np.arange(float(len(stamps)))
        missing = np.zeros(len(steps))
        missing[gaps] = np.round(steps[gaps] / step - 1)
        at[1:] += np.cumsum(missing)
        line = _narrowest(at, stamps)
        if line.width <= _width(line.slope, rounding):
            return _on_line(at, line, rounding, gaps, stated)
    return Pace(step, unsure, 0.0, stamps, gaps)


def _coarse(stamps: FloatArray, steps: FloatArray, rounding: float, stated: float | None) -> Pace | None:
    """The pace of stamps that repeat, that are rounded to about a step, or that wander by as much."""
    changes = np.flatnonzero(steps > 0) + 1
    repeats = len(changes) < len(steps)
    # How long the first stamp had been there before the log began is not known.
    places = changes if repeats else np.arange(len(stamps))
    at, values = places.astype(float), stamps[places]
    if len(at) < 2:
        return Pace(float(stamps[-1]) / len(steps), 1.0, float(stamps[-1]), stamps, np.zeros(0, int))
    wide = rounding or float(np.median(np.diff(values)))
    line = _narrowest(at, values)
    lost = [] if line.width <= _width(line.slope, wide) else _losses(at, values, wide)
    for place, count in lost:
        at[place:] += count
    line = _narrowest(at, values) if lost else line
    whole, gaps = _numbered(places, len(stamps), lost, repeats=repeats)
    pace = _on_line(whole, line, wide, gaps, stated)
    explained = repeats or (rounding and line.width <= _width(line.slope, rounding))
    return pace if explained else replace(pace, rounding=0.0, times=stamps, first=0.0, loose=0.0)


def _numbered(
    places: IntArray, n_sample: int, lost: list[tuple[int, int]], *, repeats: bool
) -> tuple[FloatArray, IntArray]:
    """Numbers of the samples with those that are missing, and the samples after which some are.

    Between two changes of the stamp they may lie anywhere: some are told at both ends, so that no part between gaps
    holds them.

    `places` (n_change,) are the samples at which the stamp changes, `lost` the change before each loss and its size.
    """
    whole, gaps = np.arange(float(n_sample)), set()
    for place, count in lost:
        first, last = int(places[place - 1]), int(places[place]) - 1
        before = count / 2 if repeats and count > 1 and first < last else 0.0
        whole[first + 1 :] += before
        whole[last + 1 :] += count - before
        gaps |= {first, last} if before else {last}
    return whole, np.array(sorted(gaps), int)


def _losses(at: FloatArray, values: FloatArray, rounding: float) -> list[tuple[int, int]]:
    step, span = _agreed(at, values, rounding)
    beside = values - step * at
    length = int(np.clip(span // 2, 1, _LONGEST))
    sums = np.concatenate([[0.0], np.cumsum(beside)])
    place = np.arange(1, len(at))
    low, high = np.maximum(place - length, 0), np.minimum(place + length, len(at))
    jump = (sums[high] - sums[place]) / (high - place) - (sums[place] - sums[low]) / (place - low)
    short = np.minimum(high - place, place - low)
    hidden = _width(step, rounding) * np.minimum(1.05, 2 / np.sqrt(short)) + 0.1 * step
    wander = 4.5 * 1.4826 * float(np.median(np.abs(jump - np.median(jump))))
    found = np.flatnonzero(jump > np.maximum(np.maximum(hidden, wander), 0.6 * step))
    lost: list[tuple[int, int]] = []
    for group in np.split(found, np.flatnonzero(np.diff(found) > 1) + 1):
        if not len(group):
            continue
        best = int(group[np.argmax(jump[group])])
        near = np.arange(max(best - length // 2, 0), min(best + length // 2 + 1, len(jump)))
        exact = int(near[np.argmax(np.diff(beside)[near])])
        count = round(float(jump[best]) / step)
        if count > 0:
            lost.append((exact + 1, count))
    return lost


def _agreed(at: FloatArray, values: FloatArray, rounding: float) -> tuple[float, int]:
    """The step on which most windows agree, and the changes that the longest such windows hold."""
    step, span, noise = 0.0, 1, 0.0
    lag = 1
    while lag <= max(len(at) // 4, 1):
        rise, count = values[lag:] - values[:-lag], at[lag:] - at[:-lag]
        candidate = float(np.median(rise / count))
        off = np.abs(rise - candidate * count)
        if lag == 1:
            noise = 3 * 1.4826 * float(np.median(off))
        if lag > 1 and np.mean(off <= 1.2 * _width(candidate, rounding) + noise) < _AGREE:
            break
        step, span = candidate, lag
        lag *= 2
    return step, span


@dataclass(frozen=True)
class _Line:
    """The line beside which points lie in the narrowest band."""

    slope: float  # Its slope
    width: float  # The band's width
    # The band's edges beside the line through the first sample, for any slope
    beside: Callable[[float], tuple[float, float]]

    def far(self, slope: float) -> float:
        """The width of the band for another slope."""
        low, high = self.beside(slope)
        return high - low


def _width(step: float, rounding: float) -> float:
    """How far off their line rounded stamps are where they change, a margin for the number format added."""
    return min(step, rounding) * (1 + 1e-3)


def _narrowest(at: FloatArray, values: FloatArray) -> _Line:
    """Fits the line beside which all points lie in the narrowest band: the band's width is convex in its slope."""
    start = float((values[-1] - values[0]) / (at[-1] - at[0]))
    points, heights = _extremes(at, values, start)

    def edges(slope: float) -> tuple[float, float]:
        apart = heights - slope * points
        return float(apart.min()), float(apart.max())

    def width(slope: float) -> float:
        low, high = edges(slope)
        return high - low

    reach = 2 * max(width(start), abs(start) * 1e-12) / float(at[-1] - at[0])
    low, high = start - reach, start + reach
    golden = (np.sqrt(5) - 1) / 2
    for _ in range(80):
        first, second = high - golden * (high - low), low + golden * (high - low)
        if width(first) <= width(second):
            high = second
        else:
            low = first
    slope = (low + high) / 2
    if width(start) <= width(slope) * (1 + 1e-9):
        slope = start
    return _Line(slope, width(slope), edges)


def _extremes(at: FloatArray, values: FloatArray, slope: float) -> tuple[FloatArray, FloatArray]:
    """Of many points, those that lie highest and lowest beside a line in each of many blocks."""
    if len(at) <= 4 * _BLOCKS:
        return at, values
    beside = values - slope * at
    edges = np.linspace(0, len(at), _BLOCKS + 1).astype(int)
    kept = {0, len(at) - 1}
    for first, stop in pairwise(edges.tolist()):
        kept |= {first + int(np.argmin(beside[first:stop])), first + int(np.argmax(beside[first:stop]))}
    chosen = sorted(kept)
    return at[chosen], values[chosen]


def _on_line(whole: FloatArray, line: _Line, rounding: float, gaps: IntArray, stated: float | None) -> Pace:
    """The pace of samples that lie evenly beneath rounded stamps, `whole` their numbers with those that are missing."""
    allowed = max(_width(line.slope, rounding), 1.1 * line.width)
    low, high = _still_within(line, allowed, -1), _still_within(line, allowed, 1)
    unsure = max(high / line.slope - 1, 1 - low / line.slope)
    step = stated if stated is not None and low <= stated <= high else roundest(low, high)
    # A sample that changes a stamp is no earlier than it, and later by less than the band is wide.
    lowest, highest = line.beside(step)
    room = max(_width(step, rounding), highest - lowest)
    first, loose = (lowest + highest + room) / 2, (room - (highest - lowest)) / 2
    return Pace(step, unsure, rounding, np.asarray(step * (whole - whole[0])), gaps, first, loose)


def _still_within(line: _Line, allowed: float, way: int) -> float:
    """The slope furthest to one side with which the points stay within a band."""
    reach = line.slope * 1e-12
    while line.far(line.slope + way * reach) <= allowed and reach < line.slope:
        reach *= 2
    inside, outside = 0.0, reach
    for _ in range(40):
        middle = (inside + outside) / 2
        if line.far(line.slope + way * middle) <= allowed:
            inside = middle
        else:
            outside = middle
    return line.slope + way * inside


def roundest(low: float, high: float) -> float:
    """The number from one to another with the fewest digits, itself or its reciprocal."""
    middle = (low + high) / 2
    for digits in range(1, 12):
        for candidate in (float(f"{middle:.{digits}g}"), 1 / float(f"{1 / middle:.{digits}g}")):
            if low <= candidate <= high:
                return candidate
    return middle
