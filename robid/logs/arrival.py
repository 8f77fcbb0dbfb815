"""Whether time stamps say when samples were taken or when they arrived: by which of both their signals are smoother."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.logs.pace import JITTER, measure_pace

BUNCHED = 0.05
"""Time step, in usual ones, below which stamps are no instants of sampling: interpolation between them blows up."""

_FEWEST = 100  # samples beside uneven steps that tell
_SMOOTHER = 2.0  # times that a signal has to be smoother
_KEPT = 0.95  # share of the samples that tell: the others may be damaged
_BLOCKS = 40  # blocks of a log of which the earliest arrivals are compared
_LEAST = 10  # samples of a block
# Steps by which the earliest arrivals may wander about a straight line; a lost sample moves all that follow by one
_LEVEL = 0.5


@dataclass(frozen=True)
class Arrivals:
    """Stamps that say when samples arrived, which were taken at even steps."""

    times: FloatArray  # (n_sample,) When they were taken, at the delay of the earliest arrivals
    late: float  # How much later a stamp is at most
    smoother: float  # Times that the clearest signal is smoother at even steps; NaN where none tells
    signal: int  # Which one that is


def find_arrivals(times: FloatArray, signals: Sequence[FloatArray], *, suspected: bool = False) -> Arrivals | None:
    """Tells whether stamps that are uneven are those of arrival.

    Each sample is predicted by a cubic through its four neighbours, once by their stamps and once at even steps. What
    is off is compared in units of what noise of a sample would do to it, so that noise alone favours neither.

    Args:
        times (n_sample,): The stamps.
        signals (n_sample,): Signals that have them; values that are missing are passed over.
        suspected: Whether other stamps of the log are those of arrival: signals then need not tell it, only not
            contradict it.

    Returns:
        The times of even steps, with gaps where steps say so; None where stamps are even or rounded, where lost samples
        cannot be told from late ones, or where signals are smoother by the stamps, contradict each other or do not
        tell.
    """
    line = _even_times(times) if len(times) >= _FEWEST and np.all(np.isfinite(times)) else None
    if line is None:
        return None
    even, step = line
    uneven = np.abs(np.diff(times - even)) > JITTER * step
    telling = np.convolve(uneven, np.ones(4), mode="valid") > 0  # of samples that have two neighbours on each side
    if np.count_nonzero(telling) < _FEWEST:
        return None
    found = np.array([_smoother(times, even, np.asarray(one, float), telling) for one in signals])
    known = np.flatnonzero(np.isfinite(found))
    clearest = int(np.nanargmax(found)) if len(known) else 0
    told = len(known) and found[clearest] >= _SMOOTHER
    if (len(known) and found[known].min() < 1 / _SMOOTHER) or not (told or suspected):
        return None
    smoother = float(found[clearest]) if told else np.nan
    return Arrivals(even, float((times - even).max()), smoother, clearest)


def _even_times(times: FloatArray) -> tuple[FloatArray, float] | None:
    """Even times of samples (n_sample,) at the delay of the earliest arrivals, and their step; None where none fit."""
    steps = np.diff(times)
    usual = float(np.median(steps))
    if steps.min() < 0 or usual == 0 or 4 * np.count_nonzero(np.abs(steps / usual - 1) > JITTER) < _FEWEST:
        return None
    pace = measure_pace(times)
    if pace is not None and pace.rounding:
        return None
    index = np.arange(float(len(times)))
    line = _earliest(times, index)
    if line is None and pace is not None and len(pace.gaps):  # samples were lost where its steps say so
        index[1:] += np.cumsum(np.bincount(pace.gaps, np.round(steps[pace.gaps] / pace.step - 1), len(steps)))
        line = _earliest(times, index)
    return None if line is None else (line[0] + line[1] * index, line[1])


def _earliest(times: FloatArray, index: FloatArray) -> tuple[float, float] | None:
    """Start and slope of the line of the earliest arrivals of numbered samples (n_sample,); None where these wander."""
    slope, start = (float(one) for one in np.polyfit(index, times, 1))
    late = times - start - slope * index
    earliest = np.array([block.min() for block in np.array_split(late, min(_BLOCKS, len(late) // _LEAST))])
    return None if np.ptp(earliest) > _LEVEL * slope else (start + float(np.median(earliest)), slope)


def bunched(times: FloatArray, step: float, first: int = 0) -> str:
    """Says that stamps (n_sample,) lie too close together for interpolation; empty where they do not.

    `step` is the usual one, in seconds as they are; `first` is the sample of the log that is the first of these.
    """
    steps = np.diff(times)
    closest = int(np.argmin(steps)) if len(steps) else 0
    if not len(steps) or steps[closest] >= BUNCHED * step:
        return ""
    return (
        f"D680 Its time stamps come in bursts: after sample {first + closest} by {steps[closest]:.2g} s, where"
        f" {step:.6g} s is usual. They say when samples arrived, and interpolation between them would blow up."
    )


def _smoother(times: FloatArray, even: FloatArray, values: FloatArray, telling: BoolArray) -> float:
    """Times that a signal is smoother at even steps than by its stamps; NaN where it does not move or tell."""
    by_stamps, evenly = (_unpredicted(at, values)[telling] for at in (times, even))
    both = np.isfinite(by_stamps) & np.isfinite(evenly)
    if np.count_nonzero(both) < _FEWEST:
        return np.nan
    stamped, spread = (float(np.sort(one[both])[: int(_KEPT * both.sum())].mean()) for one in (by_stamps, evenly))
    return stamped / spread if spread > 0 and stamped > 0 else np.nan


def _unpredicted(times: FloatArray, values: FloatArray) -> FloatArray:
    """What a cubic through its four neighbours leaves of a sample (n_sample - 4,), over what noise of one would."""
    count = len(times) - 4
    at = times[2 : 2 + count]
    places = [times[shift : shift + count] for shift in (0, 1, 3, 4)]
    left, noise = values[2 : 2 + count].copy(), np.ones(count)
    with np.errstate(divide="ignore", invalid="ignore"):
        for shift, own in zip((0, 1, 3, 4), places, strict=True):
            others = [other for other in places if other is not own]
            weight = np.prod([(at - other) / (own - other) for other in others], axis=0)
            left -= weight * values[shift : shift + count]
            noise += weight**2
        return np.asarray(np.abs(left) / np.sqrt(noise))
