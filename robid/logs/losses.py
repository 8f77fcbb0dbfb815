"""Samples that a log without time stamps lost, or holds twice: where its periods move apart by whole samples.

And which settings use only what lies before, between or after them.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.fft import rfft
from scipy.interpolate import make_interp_spline
from scipy.signal import fftconvolve, firwin

from robid.arrays import FloatArray, IntArray
from robid.errors import DataError
from robid.logs.mapping import Stated
from robid.logs.period import measure_repetition
from robid.logs.timing import Clock

_MOST = 50  # largest number of samples lost within one period that is looked for
_BLOCKS = 64  # blocks of a period, in each of which the lag is constant
_FEWEST = 4  # blocks that tell of a lag
_JUMP = 0.05  # share of what a constant lag leaves that a jump has to explain
_LIKELY = 12.0  # logarithm of the likelihood that a jump has to gain where what is left is noise
_LEAST = 1e-6  # noise that is taken to be in the difference of two periods at least, relative to the signal's energy
_EXPLAINED = 0.5  # share of what periods that did not move leave below which a lag is believed, where it is
# Standard deviations of what the blocks gain by a lag from which it is believed in noise: half of its own
_SIGMAS = 2.5
_UNLIKE = 0.2  # mismatch between the periods, with the jumps, above which the signal does not repeat
_ALL = 0.4  # twice the highest line, in cycles per sample, from which nothing is filtered
# Noise of a sample, for each one lost, by which a period has to leave more than another to be the wrong one
_STANDS_OUT = 10.0
# Half the length of the filter, in periods of the highest line: it is sharp enough for twice its frequency
_LENGTH = 0.8


@dataclass(frozen=True)
class Loss:
    """Samples that are missing after about one of a signal; a negative number where there are too many."""

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
        Losses in the order of the signal; none where a constant period tells them as well.
    """
    most, block = min(_MOST, period // 4), max(period // _BLOCKS, 4)
    if most < 1 or len(signal) - period - most < 2 * block:
        return []
    flat, cut = _smooth(signal, period, lines)
    count = (len(flat) - period) // block
    if count < _FEWEST:
        return []
    apart = _costs(flat, period, count, block, most)
    jump = _JUMP * float(apart.sum(axis=0).min())
    path = _follow_lag(apart, max(jump, _least_gain(flat, period, block, _follow_lag(apart, jump) - most)))
    lags, used = path - most, slice(0, count * block)
    if not lags.any() or not _believed(apart, path, most):
        return []
    left = float(apart[np.arange(count), path].sum())
    told = left < min(_clock_cost(flat, measured, used), _UNLIKE * 2 * float((flat[used] ** 2).sum()))
    jumps = (np.flatnonzero(np.diff(lags)) + 1).tolist() if told else []
    losses = [_loss(flat, period, block, lags, at) for at in jumps]
    if not losses and np.all(lags[1:-1] == lags[1]):
        return _lost_between(signal, period, lines, int(lags[1]))
    return _merged([Loss(one.after + cut, one.samples) for one in losses], block)


def _smooth(signal: FloatArray, period: int, lines: IntArray) -> tuple[FloatArray, int]:
    """The signal without drift and with less noise above its lines, and how many samples of it are cut at each end.

    A short filter keeps what repeats as it is, up to the ends.
    """
    # What one period is above the one before tells drift from slow lines.
    drift = float(np.mean(signal[period:] - signal[:-period])) / period
    level = signal - signal.mean() - drift * (np.arange(float(len(signal))) - (len(signal) - 1) / 2)
    high = float(lines.max()) / period
    half = min(round(_LENGTH / high), period // 8)
    if 2 * high >= _ALL or half < 1:
        return level, 0
    return np.asarray(fftconvolve(level, firwin(2 * half + 1, 2 * high, fs=1.0), mode="valid")), half


def _lost_between(signal: FloatArray, period: int, lines: IntArray, lag: int) -> list[Loss]:
    """The loss where the second of two periods begins, which looks like another period, but for the lines' own one."""
    real = period - lag
    if not real + period <= len(signal) < 3 * min(period, real):
        return []
    stated, other = (
        sum(_beside_lines(signal[first : first + length], lines) for first in (0, real)) for length in (period, real)
    )
    noise = stated / (2 * max(period - 2 * len(lines), 1)) + _LEAST * float(np.var(signal))
    return [Loss(period - 1, lag)] if other - stated > _STANDS_OUT * abs(lag) * noise else []


def _beside_lines(block: FloatArray, lines: IntArray) -> float:
    """Energy of a block beside lines of its length and its mean."""
    power = np.abs(rfft(block - block.mean())) ** 2
    return max(float(len(block) * np.var(block) - 2 * power[lines[2 * lines < len(block)]].sum() / len(block)), 0.0)


def _least_gain(flat: FloatArray, period: int, block: int, lags: IntArray) -> float:
    """What a jump of the lag has to gain of what lags leave, where the noise of neighbouring samples is alike."""
    here = np.arange(len(lags) * block)
    noise = flat[np.minimum(here + period - np.repeat(lags, block), len(flat) - 1)] - flat[here]
    power = np.abs(rfft(noise, 2 * len(noise))) ** 2
    # Samples for each independent one: the sum of the squared correlation.
    alike = float((power**2).mean()) / max(float(power.mean()) ** 2, float(np.finfo(float).tiny))
    return 2 * _LIKELY * alike * max(float((noise**2).mean()), _LEAST * float(np.mean(flat**2)))


def _believed(apart: FloatArray, path: IntArray, most: int) -> bool:
    """Whether lags explain most of what they should, or stand out of noise in many blocks."""
    moved = path != most
    here, stayed = apart[np.arange(len(path)), path][moved], apart[moved, most]
    gain = stayed - here
    return bool(here.sum() < _EXPLAINED * stayed.sum() or gain.sum() > _SIGMAS * np.sqrt(np.sum(gain**2)))


def _costs(values: FloatArray, period: int, count: int, block: int, most: int) -> FloatArray:
    """Squared difference (n_block, n_lag) between each block and its copy one period later, for each lag.

    Where the signal ends before, a lag costs hardly more than the best one.
    """
    here = values[: count * block]
    beyond = np.append(values, np.full(most, np.nan))
    costs = [
        ((beyond[period - lag : period - lag + len(here)] - here) ** 2).reshape(count, block).sum(axis=1)
        for lag in range(-most, most + 1)
    ]
    apart = np.stack(costs, axis=1)
    # A little more than that, so that a lag which can be seen is preferred.
    best = np.nanmin(apart, axis=1, keepdims=True) + block * _LEAST * float(np.mean(values**2))
    return np.asarray(np.where(np.isnan(apart), best, apart))


def _follow_lag(apart: FloatArray, jump: float) -> IntArray:
    """Index of the lag (n_block,) in each block that leaves least, jumps counted (Viterbi)."""
    count = len(apart)
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


def _loss(flat: FloatArray, period: int, block: int, lags: IntArray, at: int) -> Loss:
    """The loss that a jump of the lag before a block shows, to a sample where the signal tells it."""
    near = np.arange(max(at - 1, 0) * block, min((at + 1) * block, len(flat) - period))
    before, after = (
        (flat[np.minimum(near + period - lags[one], len(flat) - 1)] - flat[near]) ** 2 for one in (at - 1, at)
    )
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


_BESIDE = 32  # part of a period by which a gap of the time and a loss may be apart and be one


@dataclass(frozen=True)
class Part:
    """Which part of a log is looked at."""

    start: int = 0  # Its first sample in the log
    last: bool = False  # Whether the last periods are used, not the first ones after those dropped
    matched: bool = False  # Whether the periods are counted from there on, as they matched what was played

    def used(self, length: int, stated: Stated) -> tuple[int, int]:
        """First sample of the log that is used of a part of some length, and the one after the last."""
        wanted = stated.periods * stated.samples
        if self.last:
            return max(self.start + length - wanted, 0), self.start + length
        first = (self.start if self.matched else 0) + stated.dropped * stated.samples
        return first, first + wanted


def part_losses(steady: FloatArray, stated: Stated, part: Part) -> tuple[list[Loss], FloatArray]:
    """Losses of samples that touch what is used, by samples of the log; else the channel up to the first beside it."""
    found = measure_repetition(steady, stated.samples, stated.lines)
    measured = None if found.samples is None else found.samples * found.multiple(stated.samples)
    losses = [
        Loss(part.start + one.after, one.samples) for one in find_losses(steady, stated.samples, stated.lines, measured)
    ]
    first, stop = part.used(len(steady), stated)
    inside = [one for one in losses if first <= one.after < stop - 1]
    if inside or not losses:
        return losses if inside else [], steady
    end = min((one.after + 1 for one in losses if one.after >= stop - 1), default=part.start + len(steady))
    return [], steady[max(first - part.start, 0) : end - part.start]


def lost_samples(
    where: str, losses: list[Loss], length: int, stated: Stated, part: Part, clock: Clock | None
) -> list[DataError]:
    """Names the samples after which some are lost, unless the log's own time names them anyhow."""
    first, stop = part.used(length, stated)
    inside = [one for one in losses if first <= one.after < stop - 1]
    gaps = [] if clock is None else [gap for gap in clock.gaps.tolist() if (gap + 1 - first) % stated.samples]
    inside = [one for one in inside if not any(abs(gap - one.after) * _BESIDE < stated.samples for gap in gaps)]
    if not inside:
        return []
    told = ", ".join(
        f"{abs(one.samples)} sample{'' if abs(one.samples) == 1 else 's'}"
        f" {'missing' if one.samples > 0 else 'too many'} after about sample {one.after}"
        for one in inside
    )
    what = f"D093 Its periods are whole, but move apart on the way, as no other clock makes them: {told}."
    remedy = _remedy(losses, length, stated, part)
    return [DataError(what, where=f"{where}, about sample {inside[0].after}", remedy=remedy)]


def _remedy(losses: list[Loss], length: int, stated: Stated, part: Part) -> str:
    size, total = stated.samples, part.start + length
    origin = part.start if part.matched else 0
    edges = [origin, *(one.after + 1 for one in losses), total]
    choices: list[tuple[int, str]] = []
    for begin, end in pairwise(edges):
        dropped = max(-(-(begin - origin) // size), stated.dropped)
        periods = (end - origin) // size - dropped
        settings = [*(["take to first"] if part.last else [])]
        settings += [f"drop_periods to {dropped}"] if dropped != stated.dropped else []
        choices.append((periods, _sentence([*settings, f"periods to {periods}"])))
    # Counted from the end, what follows the last loss may hold one more.
    periods = min((total - edges[-2]) // size, total // size - stated.dropped)
    if not part.matched:
        choices.append((periods, _sentence([*([] if part.last else ["take to last"]), f"periods to {periods}"])))
    most, settings_told = max(choices, key=lambda choice: choice[0])
    if most < 1:
        return "Record again: no whole period lies between the losses."
    return f"{settings_told}: the longest part without a loss. Do not resample: that would spread the loss."


def _sentence(settings: list[str]) -> str:
    return f"Set {', '.join(settings[:-1])} and {settings[-1]}" if len(settings) > 1 else f"Set {settings[0]}"
