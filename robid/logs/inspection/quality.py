"""What a signal is by itself: missing values, no change, flat tops, how fine it is, where it wraps; and to draw it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np
from scipy.fft import rfft
from scipy.signal.windows import hann

from robid.arrays import BoolArray, FloatArray, IntArray, Meaning
from robid.logs.period import line_power

_LOOKED = 1 << 18  # samples by which the resolution is told
_FEW = 3  # different values up to which a signal hardly changes
# Share of samples at which a signal of a few values changes, from which it is no flag: binary noise, a relay
_SWITCHES = 0.02
_SATURATED = 1e-3  # share of samples in flat tops from which a signal saturates
_SHORTEST_TOP = 3  # samples of a flat top, at least
# How steeply a flat top is reached, relative to a usual step of the signal: slow turning points look flat, too
_STEEP = 0.25
_COARSE = 0.05  # share of unchanged samples from which a signal is coarse
_WHOLE = 0.1  # distance of a step from whole resolutions that rounding leaves
_MOST = 0.98  # share of the steps that are whole resolutions where there is one
_ENOUGH = 10  # distances of several steps that must be there to tell them from chance
_FORMAT = 2.0**-25  # resolution, relative to the largest value, below which it is the number format's


@dataclass(frozen=True)
class Quality:
    """What is to be said of a signal by itself."""

    lowest: Annotated[float, Meaning("Its lowest value, in its unit.")]
    highest: Annotated[float, Meaning("Its highest value.")]
    rms: Annotated[float, Meaning("RMS about its mean.")]
    missing: Annotated[int, Meaning("Values that are NaN or infinite.")]
    first_missing: Annotated[int, Meaning("Index, from 0, of the first of them.")]
    longest_missing: Annotated[int, Meaning("How many of them follow each other at most.")]
    values: Annotated[int | None, Meaning("Different values, where they are few.")]
    switches: Annotated[bool, Meaning("Whether it changes often, though between a few values.")]
    saturated: Annotated[float, Meaning("Share of samples in flat tops at its extremes.")]
    resolution: Annotated[float | None, Meaning("Step between values.")]
    turns: Annotated[int, Meaning("Jumps by what looks like a full turn, in which an angle wraps.")]

    @property
    def is_dead(self) -> bool:
        """Whether it never changes."""
        return self.lowest == self.highest

    @property
    def is_still(self) -> bool:
        """Whether it hardly changes: it has a few values only, and seldom another one."""
        return self.values is not None and not self.switches


def judge(values: FloatArray) -> Quality:
    """Judges a signal (n_sample,) by itself."""
    finite = np.isfinite(values)
    kept = values[finite]
    if not kept.size:
        return Quality(np.nan, np.nan, np.nan, len(values), 0, len(values), 0, False, 0.0, None, 0)
    low, high = float(kept.min()), float(kept.max())
    different = np.unique(kept[:_LOOKED])
    few = len(different) if len(different) <= _FEW else None
    return Quality(
        low,
        high,
        float(kept.std()),
        missing=int(np.count_nonzero(~finite)),
        first_missing=int(np.argmin(finite)),
        longest_missing=longest_run(~finite),
        values=few,
        switches=bool(few) and float(np.mean(np.diff(kept) != 0)) > _SWITCHES,
        saturated=0.0 if few else _flat_share(kept),
        resolution=None if few else resolution(different, kept[:_LOOKED]),
        turns=_turns(kept, high - low),
    )


def longest_run(marked: BoolArray) -> int:
    """Returns the length of the longest run of marked samples."""
    starts, stops = _runs(marked)
    return int((stops - starts).max(initial=0))


def _runs(marked: BoolArray) -> tuple[IntArray, IntArray]:
    """First samples of the runs of marked ones, and those after them."""
    edges = np.diff(np.concatenate([[False], marked, [False]]).astype(np.int8))
    return np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)


def _flat_share(values: FloatArray) -> float:
    """Share of samples in runs at the highest or lowest value that are reached in a steep step."""
    steps = np.abs(np.diff(values))
    usual = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0
    span = float(np.ptp(values))
    share, coarse = 0, _is_coarse(values)
    for extreme in (values.max(), values.min()):
        starts, stops = _runs(np.abs(values - extreme) <= 1e-9 * span)
        long = stops - starts >= _SHORTEST_TOP
        inner = long & (starts > 0) & (stops < len(values))
        steep = steps[np.maximum(starts - 1, 0)] > max(_STEEP * usual, 0.0)
        enough = inner & steep
        # A coarse signal reaches every turning point by one whole step.
        one_step = np.median(steps[starts[enough] - 1]) <= 1.5 * usual if enough.any() else True
        if enough.any() and not (one_step and coarse):
            share += int((stops - starts).sum())
    return share / len(values) if share / len(values) > _SATURATED else 0.0


def _is_coarse(values: FloatArray) -> bool:
    """Whether a signal often keeps its value from sample to sample, its extremes left out."""
    inner = (values > values.min()) & (values < values.max())
    pairs = inner[1:] & inner[:-1]
    return bool(pairs.any() and np.mean(np.diff(values)[pairs] == 0) > _COARSE)


def resolution(different: FloatArray, values: FloatArray) -> float | None:
    """Returns the step of which distances of samples (n_sample,) and of different values are multiples; else None."""
    apart = np.concatenate([np.diff(different), np.abs(np.diff(values[: 1 << 14]))])
    scale = float(np.abs(different).max())
    apart = apart[apart > _FORMAT * scale]
    if len(apart) < _FEW:
        return None
    least = float(np.quantile(apart, 0.001, method="lower"))
    near = apart[apart < 1.5 * least]
    for parts in (1, 2, 3, 4, 5):
        step = float(np.median(near)) / parts
        if step < _FORMAT * scale:
            return None
        for _ in range(3):  # the far multiples know the step best
            count = np.round(apart / step)
            inside = (np.abs(apart / step - count) < _WHOLE) & (count > 0)
            if not inside.any():
                break
            step = float(np.sum(apart[inside] * count[inside]) / np.sum(count[inside] ** 2.0))
        several = apart[apart > 1.5 * step]
        if len(several) < _ENOUGH:
            return None
        if np.mean(np.abs(several / step - np.round(several / step)) < _WHOLE) > _MOST:
            return _verified(different, step)
    return None


def _verified(different: FloatArray, step: float) -> float | None:
    """The step, known better by ever farther values; None where these are no multiples of it."""
    offsets = different - different[0]
    reach = 10 * step
    while reach < 10 * offsets[-1]:
        near = offsets[(offsets <= reach) & (offsets > 0)]
        count = np.round(near / step)
        if count.any():
            step = float(np.sum(near * count) / np.sum(count**2))
        reach *= 3
    whole = np.abs(offsets / step - np.round(offsets / step)) < _WHOLE
    return float(f"{step:.6g}") if np.mean(whole) > _MOST else None


def _turns(values: FloatArray, span: float) -> int:
    """Jumps by nearly all of the range, back and forth within a sample."""
    if span == 0:
        return 0
    steps = np.abs(np.diff(values))
    jumps = int(np.count_nonzero(steps > 0.9 * span))
    usual = float(np.quantile(steps, 0.95))
    return jumps if jumps and usual < 0.1 * span and jumps < len(values) // 20 else 0


_TURN = {"deg": 360.0, "rad": 2 * np.pi, "mrad": 2e3 * np.pi, "urad": 2e6 * np.pi, "turn": 1.0}
_TURN |= {"gon": 400.0, "arcmin": 21600.0, "arcsec": 1296000.0}
"""A turn in the units that a log may state."""

_UNSTATED = ("deg", "rad", "turn")
# Counts of a turn, but for powers of ten, that encoders have beside powers of two
_COUNTED = (1.0, 1.6, 1.8, 2.0, 2.5, 3.2, 3.6, 4.0, 5.0, 6.4, 7.2, 8.0)
_FASTEST = 0.25  # turns from sample to sample up to which a jump is told from a motion
_ODD = 0.1  # share of the jumps by which others may be there, as where samples are missing
_SMOOTH = 5.0  # how much more the speed may change at a jump, once that is taken out, than it does elsewhere at most


@dataclass(frozen=True)
class Wrap:
    """How a signal wraps: the range that it starts again after, the unit of which that is a turn, how often it does."""

    size: float
    unit: str
    count: int


def find_wrap(values: FloatArray, unit: str) -> Wrap | None:
    """Finds the range after which an angle or counter (n_sample,) starts again; None where it does not or is open."""
    kept = values[np.isfinite(values)]
    if len(kept) < 3 or np.ptp(kept) == 0:
        return None
    steps = np.diff(kept)
    span = float(np.ptp(kept))
    if np.abs(steps).max() < (1 - 2 * _FASTEST) * span:
        return None
    found = [(one, _roughness(steps, span, one.size)) for one in _candidates(unit, span, kept)]
    told = [(rough, one.size, one) for one, rough in found if rough is not None]
    if not told:
        return None
    # Of ranges that do, the one that leaves the smoothest motion; a power of two before its neighbours.
    _, _, best = min(told)
    return Wrap(best.size, best.unit, int(np.count_nonzero(np.abs(steps) > best.size / 2)))


def unwrapped(values: FloatArray, size: float) -> FloatArray:
    """Returns a signal (n_sample,) without its jumps by a range, NaN left where they are."""
    made = np.array(values, float)
    finite = np.isfinite(made)
    made[finite] = np.unwrap(made[finite], period=size)
    return made


def _candidates(unit: str, span: float, values: FloatArray) -> list[Wrap]:
    if unit in _TURN:
        return [Wrap(_TURN[unit], unit, 0)]
    if unit and unit != "counts":
        return []
    made = [] if unit else [Wrap(_TURN[one], one, 0) for one in _UNSTATED]
    if unit == "counts" or bool(np.all(values == np.round(values))):
        sizes = {2.0**power for power in range(7, 33)} | {
            part * 10.0**power for power in range(2, 9) for part in _COUNTED
        }
        known = [one.size for one in made]
        made += [Wrap(one, "counts", 0) for one in sorted(sizes) if span <= one < 1.5 * span + 2 and one not in known]
    return made


def _roughness(steps: FloatArray, span: float, size: float) -> float | None:
    """How much a speed changes at jumps by a range at most, once they are taken out; None where it is no such range."""
    if span > size * (1 + 1e-6):
        return None
    jumps = np.abs(steps) > size / 2
    rest = steps - size * np.round(steps / size)
    odd = np.abs(rest) > _FASTEST * size
    if np.count_nonzero(odd) > _ODD * np.count_nonzero(jumps) or not jumps.any():
        return None
    changes = np.abs(np.diff(rest))
    beside = jumps[1:] | jumps[:-1]
    plain = ~(beside | odd[1:] | odd[:-1])
    usual = float(changes[plain].max(initial=0.0)) if plain.any() else float(np.abs(rest).max())
    at_jumps = float(np.median(changes[beside]))
    return at_jumps if at_jumps <= _SMOOTH * max(usual, 1e-9 * size) else None


_POINTS = 1200


@dataclass(frozen=True)
class Spectra:
    """Amplitudes of a signal."""

    frequency_hz: FloatArray  # (n_freq,) Frequencies [Hz]
    amplitude: FloatArray  # (n_freq,) Amplitudes there
    noise: FloatArray  # (n_freq,) What the periods scatter; empty where nothing repeats


def thin_out(values: FloatArray) -> tuple[IntArray, FloatArray]:
    """Returns samples with their places: all of a short signal, lowest and highest of each part of a long one."""
    if len(values) <= 2 * _POINTS:
        return np.arange(len(values)), values
    width = len(values) // _POINTS
    parts = values[: width * _POINTS].reshape(_POINTS, width)
    filled = np.where(np.isfinite(parts), parts, 0.0)
    inside = np.sort(np.stack([filled.argmin(axis=1), filled.argmax(axis=1)], axis=1), axis=1)
    places = (width * np.arange(_POINTS)[:, None] + inside).ravel()
    return places, values[places]


def spectra_of_periods(blocks: FloatArray, step_s: float) -> Spectra:
    """Returns amplitudes of the mean of some periods (n_period, n_sample), and of what they scatter."""
    mean, noise = line_power(blocks)
    count = blocks.shape[1]
    frequency = np.arange(len(mean)) / (count * step_s)
    amplitude, scatter = 2 * np.sqrt(mean) / count, 2 * np.sqrt(noise) / count
    kept = _highest(amplitude[1:]) + 1
    return Spectra(frequency[kept], amplitude[kept], scatter[kept])


def spectra_of_all(values: FloatArray, step_s: float) -> Spectra:
    """Returns amplitudes of a signal (n_sample,) that does not repeat."""
    window = hann(len(values))
    amplitude = 2 * np.abs(rfft((values - values.mean()) * window)) / window.sum()
    frequency = np.arange(len(amplitude)) / (len(values) * step_s)
    kept = _highest(amplitude[1:]) + 1
    return Spectra(frequency[kept], amplitude[kept], np.zeros(0))


def _highest(amplitude: FloatArray) -> IntArray:
    """Places to draw: all of few, the highest of each of equal parts of a logarithmic axis of many."""
    if len(amplitude) <= 2 * _POINTS:
        return np.arange(len(amplitude))
    edges = np.unique(np.geomspace(1, len(amplitude), _POINTS + 1).astype(int))
    return np.array([start - 1 + int(np.argmax(amplitude[start - 1 : stop - 1])) for start, stop in pairwise(edges)])
