"""What can be wrong with a signal by itself: missing values, no change, flat tops; and how fine it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, FloatArray, IntArray

_LOOKED = 1 << 18
"""Samples by which the resolution is told."""

_FEW = 3
"""Different values up to which a signal hardly changes."""

_SWITCHES = 0.02
"""Share of samples at which a signal of a few values changes, from which it is no flag: binary noise, a relay."""

_SATURATED = 1e-3
"""Share of samples in flat tops from which a signal saturates."""

_SHORTEST_TOP = 3
"""Samples of a flat top, at least."""

_STEEP = 0.25
"""How steeply a flat top is reached, relative to a usual step of the signal: slow turning points look flat, too."""

_COARSE = 0.05
"""Share of unchanged samples from which a signal is coarse."""

_WHOLE = 0.1
"""Distance of a step from whole resolutions that rounding leaves."""

_MOST = 0.98
"""Share of the steps that are whole resolutions where there is one."""

_ENOUGH = 10
"""Distances of several steps that must be there to tell them from chance."""

_FORMAT = 2.0**-25
"""Resolution, relative to the largest value, below which it is the number format's."""


@dataclass(frozen=True)
class Quality:
    """What is to be said of a signal by itself.

    Attributes:
        lowest: Its lowest value.
        highest: Its highest value.
        rms: RMS about its mean.
        missing: Values that are NaN or infinite.
        first_missing: The first of them.
        longest_missing: How many of them follow each other at most.
        values: Different values, where they are few; else None.
        switches: Whether it changes often, though between a few values.
        saturated: Share of samples in flat tops at its extremes.
        resolution: Step between values, None where there is none.
        turns: Jumps by what looks like a full turn, in which an angle wraps.
    """

    lowest: float
    highest: float
    rms: float
    missing: int
    first_missing: int
    longest_missing: int
    values: int | None
    switches: bool
    saturated: float
    resolution: float | None
    turns: int

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
    """Returns the step of which the distances of all values are multiples, None where there is none.

    Args:
        different (n_value,): The different values, ascending.
        values (n_sample,): The samples.
    """
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
