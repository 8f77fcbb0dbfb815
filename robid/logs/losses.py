"""Samples that a log without time stamps lost, or holds twice: where its periods move apart by whole samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.signal import detrend

from robid.arrays import FloatArray, IntArray
from robid.logs.period import limit_band

_MOST = 50
"""Largest number of samples lost within one period that is looked for."""

_BLOCKS = 64
"""Blocks of a period, in each of which the lag is constant."""

_JUMP = 0.05
"""Share of what a constant lag leaves that a jump has to explain."""

_EXPLAINED = 0.5
"""Share of what periods that did not move leave below which a lag is believed, where it is."""

_UNLIKE = 0.2
"""Mismatch between the periods, with the jumps, above which the signal does not repeat."""


@dataclass(frozen=True)
class Loss:
    """Samples that are missing after one of a signal.

    Attributes:
        after: The sample, about.
        samples: How many are missing; negative where there are too many.
    """

    after: int
    samples: int


def find_losses(signal: FloatArray, period: int, lines: IntArray, measured: float | None) -> list[Loss]:
    """Finds where a periodic signal lost samples.

    The lag by which each sample is found again one period later is 0, and the number of lost samples while these lie
    between the two. Another clock makes it constant instead, a fraction of a sample included.

    Args:
        signal (n_sample,): The signal.
        period: Its period as it was stated [samples].
        lines (n_lines,): Lines of that period that are excited.
        measured: Its period as a constant one was measured, if it was [samples].

    Returns:
        Losses in the order of the signal; none where a constant period tells it as well.
    """
    most, block = min(_MOST, period // 4), max(period // _BLOCKS, 4)
    if most < 1 or len(signal) - period - 2 * most < 2 * block:
        return []
    low = lines.min() / period if lines.min() > 2 else 0.0
    flat = limit_band(np.asarray(detrend(signal)), low, lines.max() / period)
    first, count = most, (len(flat) - period - 2 * most) // block
    apart = _costs(flat, period, first, count, block, most)
    path = _follow_lag(apart)
    left = float(apart[np.arange(count), path].sum())
    lags = path - most
    moved, used = lags != 0, slice(first, first + count * block)
    if not moved.any() or moved.all():
        return []
    explained = float(apart[np.arange(count), path][moved].sum()) < _EXPLAINED * float(apart[moved, most].sum())
    energy = 2 * float((flat[used] ** 2).sum())
    if not explained or left >= _clock_cost(flat, measured, used) or left > _UNLIKE * energy:
        return []
    jumps = (np.flatnonzero(np.diff(lags)) + 1).tolist()
    return _merged([_loss(flat, period, first, block, lags, at) for at in jumps], block)


def _costs(flat: FloatArray, period: int, first: int, count: int, block: int, most: int) -> FloatArray:
    """Squared difference (n_block, n_lag) between each block and its copy one period later, for each lag."""
    here = flat[first : first + count * block]
    shifts = first + period - np.arange(-most, most + 1)
    return np.stack(
        [((flat[at : at + len(here)] - here) ** 2).reshape(count, block).sum(axis=1) for at in shifts], axis=1
    )


def _follow_lag(apart: FloatArray) -> IntArray:
    """Index of the lag (n_block,) in each block that leaves least, jumps counted (Viterbi)."""
    count, jump = len(apart), _JUMP * float(apart.sum(axis=0).min())
    total, came = apart[0].copy(), np.zeros(apart.shape, int)
    stay = np.arange(apart.shape[1])
    for at in range(1, count):
        best = int(np.argmin(total))
        came[at] = np.where(total <= total[best] + jump, stay, best)
        total = total[came[at]] + jump * (came[at] != stay) + apart[at]
    path = np.zeros(count, int)
    path[-1] = int(np.argmin(total))
    for at in range(count - 1, 0, -1):
        path[at - 1] = came[at, path[at]]
    return path


def _clock_cost(flat: FloatArray, measured: float | None, used: slice) -> float:
    """What a constant period, a fraction included, leaves of the same samples."""
    if measured is None:
        return float("inf")
    index = np.arange(used.start, min(used.stop, int(len(flat) - measured) - 1))
    if not len(index):
        return float("inf")
    curve = make_interp_spline(np.arange(float(len(flat))), flat, k=3)
    apart: FloatArray = np.asarray(curve(index + measured) - flat[index])
    return float(np.mean(apart**2) * (used.stop - used.start))


def _loss(flat: FloatArray, period: int, first: int, block: int, lags: IntArray, at: int) -> Loss:
    """The loss that a jump of the lag before a block shows, to a sample where the signal tells it."""
    near = np.arange(max(first, first + (at - 1) * block), first + (at + 1) * block)
    before, after = ((flat[near + period - lags[one]] - flat[near]) ** 2 for one in (at - 1, at))
    jump = near[0] + int(np.argmin(np.concatenate([[0.0], np.cumsum(before - after)])))
    # A loss enters one period ahead and leaves where it is.
    enters = abs(lags[at]) > abs(lags[at - 1])
    change = int(lags[at] - lags[at - 1])
    return Loss(int(jump) + period - 1, change) if enters else Loss(int(jump) - 1, -change)


def _merged(losses: list[Loss], block: int) -> list[Loss]:
    """Losses in order, those once that are seen both as they enter and as they leave."""
    kept: list[Loss] = []
    for one in sorted(losses, key=lambda loss: loss.after):
        if not kept or one.after - kept[-1].after > 2 * block:
            kept.append(one)
    return kept
