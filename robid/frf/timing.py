"""Faults of the time base, from how periods differ: a wrong period, dropped samples, jitter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, rfft

from robid.arrays import FloatArray
from robid.signals.record import Record

_WINDOWS = 16
_POINTS = 300
_SUSPICIOUS_SHIFT = 0.3
_SUSPICIOUS_SHARE = 0.3
_LEFT = 0.5  # Share of the difference between two periods that a shift may leave and still explain it
_UNUSUAL = 3.0  # Mean square difference of two periods over the usual one above which a channel tells of a fault
# The same where chance explains much: in a short part of a period, or a difference that is as large as usual.
_LEFT_OF_LITTLE = 0.1
_FLOOR = 1e-12


@dataclass(frozen=True)
class Shift:
    """One period that runs apart from the period before it."""

    realization: int
    experiment: int
    period: int  # Index of the later of the two periods
    lost: int  # Samples missing between the two; negative where there are too many
    sample: int  # Sample of that period (of the one before, if negative: counted back from its end) where it begins
    whole: bool  # Whether the whole period is shifted, so that the fault lies between the two
    unusual: bool  # Whether the periods differ there far more than periods usually do
    channels: tuple[int, ...]  # Channels that it explains: inputs first, then outputs


@dataclass(frozen=True)
class Differences:
    """Differences between successive periods of all channels beside their slopes."""

    difference: FloatArray  # (n_real, n_exp, n_pair, n_point, n_channel) Later minus earlier period, over the noise
    slope: FloatArray  # (n_real, n_exp, n_pair, n_point, n_channel) Change per sample of their mean, over the noise
    power: FloatArray  # (n_real, n_exp) Variance of the signals over that of the noise, summed over channels
    scale: FloatArray  # (n_channel,) The noise that they were divided by: RMS of the usual difference


@dataclass(frozen=True)
class Samples:
    """Samples of a period that are enough for statistics, and those around them for the slope."""

    count: int  # How many; 0 where the period is too short
    reach: int  # Distance of the samples around them
    before: slice  # `reach` samples earlier
    here: slice
    after: slice  # `reach` samples later


def sparse_samples(record: Record) -> Samples:
    """Chooses samples so far apart that the work is small beside a Fourier transform."""
    n_sample = record.inputs.shape[4]
    reach = max(int(n_sample / (8 * record.excited_lines.max())), 1)
    step = max(n_sample // _POINTS, 1)
    count = max((n_sample - 2 * reach) // step // _WINDOWS * _WINDOWS, 0)
    parts = (slice(start, start + step * count, step) for start in (0, reach, 2 * reach))
    return Samples(count, reach, *parts)


def period_differences(record: Record) -> Differences | None:
    """Compares successive periods of one configuration at some of their samples; None with a single period."""
    n_period = record.inputs.shape[3]
    chosen = sparse_samples(record)
    if n_period < 2 or not chosen.count:
        return None
    parts, slopes, powers = [], [], []
    for signal in (record.inputs[0], record.outputs[0]):
        early, late = signal[:, :, :-1], signal[:, :, 1:]
        difference = late[..., chosen.here, :] - early[..., chosen.here, :]
        parts.append(difference - difference.mean(axis=3, keepdims=True))
        slopes.append(sum(one[..., chosen.after, :] - one[..., chosen.before, :] for one in (early, late)))
        powers.append(signal[..., chosen.here, :].var(axis=(2, 3)))
    difference, slope, power = (np.concatenate(one, axis=-1) for one in (parts, slopes, powers))
    # The median over pairs of periods: faults are few, and shall not make themselves usual.
    usual = np.median((difference**2).mean(axis=3).reshape(-1, difference.shape[-1]), axis=0)
    scale = np.sqrt(np.maximum(usual, _FLOOR * np.maximum(power.mean(axis=(0, 1)), np.finfo(float).tiny)))
    return Differences(difference / scale, slope / (4 * chosen.reach * scale), (power / scale**2).sum(axis=-1), scale)


def find_shifts(record: Record, found: Differences) -> list[Shift]:
    """Finds periods that are shifted against the one before, from some sample on, up to some sample, or as a whole."""
    cross = _windowed(found.difference * found.slope)
    slope, energy = _windowed(found.slope**2), _windowed(found.difference**2)
    points = np.arange(1, _WINDOWS + 1) * (found.difference.shape[3] // _WINDOWS)
    wrecked = _SUSPICIOUS_SHARE * points * found.power[:, :, None, None]
    suspicious = np.zeros(cross.shape[:3], bool)
    for direction in (slice(None), slice(None, None, -1)):
        # Running sums from either end: d ~ s x' means a shift by s samples, a / b, from or up to there.
        a, b, d = (np.cumsum(one[..., direction], axis=-1) for one in (cross, slope, energy))
        shifted = (np.abs(a) > _SUSPICIOUS_SHIFT * b) & (a**2 > _SUSPICIOUS_SHARE * b * d)
        suspicious |= (shifted | (d > wrecked)).any(axis=-1)
    if not suspicious.any():
        return []
    located = (_locate(record, found.scale, *map(int, place)) for place in np.argwhere(suspicious))
    return [shift for shift in located if shift is not None]


def measure_jitter(found: Differences) -> tuple[float, float]:
    """Standard deviation of the sampling instants [samples] and its significance in standard deviations.

    A displaced instant moves all channels in proportion to their slopes. With `z = sum d x'` over the channels and
    `g = sum x'^2`, `z^2 / g` is a constant for noise that does not depend on the motion, and rises with `g` by the
    variance of the displacement; twice that of an instant, since two periods differ.
    """
    strength = (found.slope**2).sum(axis=-1)
    # z^2 / g as above; its regression on g has the variance of the displacement as its slope.
    ratio = (found.difference * found.slope).sum(axis=-1) ** 2 / np.maximum(strength, np.finfo(float).tiny)
    centred = strength - strength.mean()
    variance = float((centred**2).sum())
    if variance == 0:
        return 0.0, 0.0
    rate = float((centred * ratio).sum()) / variance
    # Windowed sums of the scores allow for neighbours that are correlated.
    rest = centred * (ratio - ratio.mean() - rate * centred)
    deviation = np.sqrt((_windowed(rest[..., None]) ** 2).sum()) / variance
    return float(np.sqrt(max(rate, 0.0) / 2)), float(rate / max(deviation, np.finfo(float).tiny))


def _windowed(values: FloatArray) -> FloatArray:
    """Sums (n_real, n_exp, n_pair, n_point, n_channel) over channels and within windows."""
    summed = values.sum(axis=-1)
    return np.asarray(summed.reshape(*summed.shape[:3], _WINDOWS, -1).sum(axis=-1))


@dataclass(frozen=True)
class _Guess:
    """A shift of the later period from a sample on (`after`), or of the earlier one up to it, and what it leaves."""

    left: float
    lost: int
    at: int
    after: bool


def _locate(record: Record, scale: FloatArray, realization: int, experiment: int, pair: int) -> Shift | None:
    """Shift of one period against the one before, if one explains their difference."""
    signals = (one[0, realization, experiment] for one in (record.inputs, record.outputs))
    periods = np.concatenate(list(signals), axis=-1) / scale
    early, late = periods[pair] - periods.mean(axis=(0, 1)), periods[pair + 1] - periods.mean(axis=(0, 1))
    power = ((late - early) ** 2).mean(axis=0)
    telling = power > min(_UNUSUAL, power.max() / 2)
    best = min(
        (
            guess
            for after in (True, False)
            for guess in _guesses(early[:, telling], late[:, telling], after=after)
            if guess.lost
        ),
        key=lambda guess: guess.left,
        default=None,
    )
    if best is None:
        return None
    part = slice(best.at, None) if best.after else slice(0, best.at)
    before, behind = (((late - early)[part] ** 2).sum(axis=0), _left(early, late, best)[part].sum(axis=0))
    n_sample = len(early)
    length = n_sample - best.at if best.after else best.at
    whole = length > n_sample - n_sample // _WINDOWS
    unusual = bool(before[telling].sum() > _UNUSUAL * length * np.count_nonzero(telling))
    limit = _LEFT if whole or (unusual and 4 * length >= n_sample) else _LEFT_OF_LITTLE
    if behind[telling].sum() >= limit * before[telling].sum():
        return None
    if _drifts(early[:, telling], late[:, telling], best, part, sparse_samples(record).reach):
        return None
    channels = tuple(np.flatnonzero(telling & (behind < _LEFT * before)).tolist())
    sample = best.at if best.after else best.at - n_sample
    return Shift(realization, experiment, pair + 1, best.lost, sample, whole, unusual, channels)


def _drifts(early: FloatArray, late: FloatArray, guess: _Guess, part: slice, reach: int) -> bool:
    """Whether the shift explains slow wandering only: nothing of the differences between nearby samples."""
    early, late = (one - np.roll(one, reach, axis=0) for one in (early, late))
    inside = slice(part.start + reach if guess.after else reach, part.stop)
    before, behind = ((late - early)[inside] ** 2).sum(), _left(early, late, guess)[inside].sum()
    return bool(behind >= _LEFT * before)


def _guesses(early: FloatArray, late: FloatArray, *, after: bool) -> list[_Guess]:
    """Shifts that suit the whole period or one of its ends, each with the sample that leaves least."""
    n_sample = len(early)
    plain = ((late - early) ** 2).sum(axis=1)
    guesses = []
    for part in (1, 4, _WINDOWS):
        length = n_sample // part
        segment = slice(n_sample - length, n_sample) if after else slice(0, length)
        lost = _best_shift(early, late, segment) if after else -_best_shift(late, early, segment)
        gain = plain - _left(early, late, _Guess(0.0, lost, 0, after)).sum(axis=1)
        before = np.concatenate([[0.0], np.cumsum(gain)])
        # What shifting from each sample on (or up to it) gains, all at once.
        worth = before[-1] - before if after else before
        at = int(np.argmax(worth))
        guesses.append(_Guess(float(plain.sum() - worth[at]), lost, at, after))
    return guesses


def _left(early: FloatArray, late: FloatArray, guess: _Guess) -> FloatArray:
    """Squared difference (n_sample, n_channel) after the shift; the sound period is taken as periodic."""
    if guess.after:
        return np.asarray((late - np.roll(early, -guess.lost, axis=0)) ** 2)
    return np.asarray((early - np.roll(late, guess.lost, axis=0)) ** 2)


def _best_shift(sound: FloatArray, other: FloatArray, segment: slice) -> int:
    """Samples by which a segment of a period is ahead of a sound one, which is taken as periodic."""
    n_sample = len(sound)
    piece, mask = np.zeros_like(other), np.zeros(n_sample)
    piece[segment], mask[segment] = other[segment], 1.0
    # sum (piece - sound shifted)^2 for all shifts at once by two circular correlations.
    matched = (np.conj(rfft(piece, axis=0)) * rfft(sound, axis=0)).sum(axis=1)
    energy = np.conj(rfft(mask)) * rfft((sound**2).sum(axis=1))
    ahead = int(np.argmin(irfft(energy - 2 * matched, n_sample)))
    return ahead if ahead <= n_sample // 2 else ahead - n_sample


def common_shift(shifts: list[Shift], pairs: int) -> int:
    """Samples by which most pairs of periods are shifted as a whole, all alike; 0 where they do not agree."""
    lost = {shift.lost for shift in shifts if shift.whole}
    agree = len(lost) == 1 and 2 * sum(shift.whole for shift in shifts) > pairs
    return lost.pop() if agree else 0
