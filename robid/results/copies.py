"""Whether new data hold samples that the fit has seen: the same recording, scaled, cut, stored or begun otherwise."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.signal import detrend

from robid.arrays import BoolArray, ComplexArray, FloatArray
from robid.signals.record import Record

_MOST = 1 << 16
"""Samples that are looked at, evenly spread."""

_TWO_ROUNDINGS = 0.6
"""Share of the coarser step by which two roundings of one value may differ: half of it, and what a fit adds."""


@dataclass(frozen=True)
class Resolution:
    """Steps of a channel by the size of its values: a number of digits makes large values coarser."""

    size: FloatArray  # (n_step,) Largest size of a value up to which each step holds, in ascending order
    # (n_step,) Smallest distance of two different values of that size or larger; what chance makes of it where there is
    # none
    step: FloatArray

    def at(self, values: FloatArray) -> FloatArray:
        """The step at values of any shape."""
        if not len(self.size):
            return np.zeros(np.shape(values))
        return np.asarray(self.step[np.minimum(np.searchsorted(self.size, np.abs(values)), len(self.size) - 1)])


def measure_resolution(values: FloatArray) -> Resolution:
    """Measures the step of a channel from the gaps between its values.

    Args:
        values (n_sample,): All samples, offset included.
    """
    chosen = values[np.linspace(0, len(values) - 1, min(len(values), _MOST)).astype(int)]
    levels = np.unique(chosen)
    if len(levels) < 2:
        return Resolution(np.zeros(0), np.zeros(0))
    size = np.maximum(np.abs(levels[1:]), np.abs(levels[:-1]))
    order = np.argsort(size, kind="stable")
    step = np.minimum.accumulate(np.diff(levels)[order][::-1])[::-1]
    last = np.flatnonzero(np.append(step[1:] != step[:-1], True))
    return Resolution(size[order][last], step[last])


def rounding(one: FloatArray, other: FloatArray, steps: FloatArray, other_steps: FloatArray) -> FloatArray:
    """Largest difference that storing makes between samples which are the same.

    Args:
        one (..., n_channel): Samples as they are stored in a record, in single precision.
        other (..., n_channel): Those of the other record.
        steps (..., n_channel): Steps of the first at these.
        other_steps (..., n_channel): Steps of the other at these.
    """
    single = sum(np.spacing(np.abs(values).astype(np.float32)).astype(float) for values in (one, other))
    return np.asarray(_TWO_ROUNDINGS * np.maximum(steps, other_steps) + single)


_SHOT_PARTS = 4
"""Parts of a recording without periods that are looked for one by one."""

_STEADY = 3
"""Last periods that tell noise from what decays; at least half of all."""

_DECAYS = 0.5
"""Difference of the last two of them, over the first two's, below which they tell of no noise but of a transient."""


class Stored:
    """Samples of one configuration.

    Attributes:
        names: Its inputs and its outputs.
        samples (n_real, n_exp, n_time, n_channel): All samples of all channels, less the outputs' offset.
        stretch: Samples of the stretches to compare: a period, or a part of a recording that has none.
    """

    def __init__(self, record: Record) -> None:
        periods = np.concatenate([record.inputs[0], record.outputs[0]], axis=-1)
        self.names = (record.input_names, record.output_names)
        self.samples: FloatArray = periods.reshape(*periods.shape[:2], -1, periods.shape[-1])
        self.stretch = periods.shape[3] // (_SHOT_PARTS if record.is_one_shot else 1)
        self._periods = periods.shape[2]
        self._offset = np.concatenate([np.zeros(len(record.input_names)), record.output_offset[0]])
        self._resolutions: dict[int, Resolution] = {}

    def steps(self, samples: FloatArray, channel: int) -> FloatArray:
        """Steps of a channel at samples of it."""
        if channel not in self._resolutions:
            self._resolutions[channel] = measure_resolution(self.samples[..., channel].ravel() + self._offset[channel])
        return self._resolutions[channel].at(samples + self._offset[channel])

    @cached_property
    def noise(self) -> FloatArray:
        """Share of each channel's energy (n_channel,) that is noise; 0 where it cannot be told from a transient.

        What a transient or a pattern of several periods makes comes back in every recording, as no noise does: of all
        pairs of the last periods those that differ least count, and none where the differences still decay.
        """
        last = max(_STEADY, -(-self._periods // 2))
        if self._periods < last:
            return np.zeros(self.samples.shape[-1])
        shape = (*self.samples.shape[:2], self._periods, -1, self.samples.shape[-1])
        steady = np.asarray(detrend(self.samples.reshape(shape)[:, :, -last:], axis=3))
        pairs = [
            0.5 * ((steady[:, :, late] - steady[:, :, early]) ** 2).mean(axis=(0, 1, 2))
            for late in range(1, last)
            for early in range(late)
        ]
        first, final = (0.5 * ((steady[:, :, at] - steady[:, :, at + 1]) ** 2).mean(axis=(0, 1, 2)) for at in (0, -2))
        scatter = np.where(final < _DECAYS * first, 0.0, np.min(pairs, axis=0))
        return np.asarray(scatter / np.maximum((steady**2).mean(axis=(0, 1, 2, 3)), np.finfo(float).tiny))

    @property
    def telling(self) -> int:
        """The channel in which recordings differ most: by its noise, or where that is unknown by its roughness."""
        moves = np.ptp(self.samples, axis=(0, 1, 2)) > 0
        rough = (np.diff(self.samples, 2, axis=2) ** 2).mean(axis=(0, 1, 2)) / np.maximum(
            self.samples.var(axis=2).mean(axis=(0, 1)), np.finfo(float).tiny
        )
        measure = self.noise if np.any(self.noise[moves] > 0) else rough
        return int(np.argmax(np.where(moves, measure, -1.0)))


_OF_NOISE = 0.05
"""Share of the noise's energy below which two stretches share their noise: independent ones differ by twice it."""

_BLOCKS = 24
"""Stretches of each experiment of a new recording that are looked for, evenly spread."""

_EXCERPTS = 512
"""Stretches of a new recording that are looked for, a few of each experiment at least."""

_FEWEST = 4
_WINDOW = 128
"""Samples of each stretch that are kept and looked for first."""

_TRIED = 32
"""Places at which a window is most like the old recording that are compared with it."""

_LEAST = 1e-6
"""Least size of a difference, of the largest one, that counts for the scale."""

_SHORTEST = 32
"""Shortest stretch that says anything [samples]."""


@dataclass(frozen=True)
class Copy:
    """Samples that two records share; all indices from 0."""

    realization: int  # Of the new record
    experiment: int  # Of the new record
    first: int  # First sample of the stretch, counted over the new record's periods
    old_realization: int  # Of the old record
    old_experiment: int  # Of the old record
    old_first: int  # First sample there
    count: int  # Samples of the stretch


@dataclass(frozen=True)
class Excerpt:
    """Short windows of one channel of a new record, by which most others are told from it without reading it again."""

    names: tuple[tuple[str, ...], tuple[str, ...]]  # Inputs and outputs of the record
    stretch: int  # Samples of the stretches that they stand for
    channel: int  # The channel, inputs first
    windows: tuple[_Window, ...]  # Each of them


@dataclass(frozen=True)
class _Window:
    """Samples (n_sample,) of a channel, their steps, the experiment, their first one, and that of their stretch."""

    samples: FloatArray
    steps: FloatArray
    place: tuple[int, int]
    first: int
    stretch_first: int


def take_excerpt(record: Record) -> Excerpt:
    """Takes what is looked for first: of each stretch the window that moves most."""
    new = Stored(record)
    channel, windows = new.telling, []
    n_place = new.samples.shape[0] * new.samples.shape[1]
    for place in np.ndindex(*new.samples.shape[:2]):
        signal = new.samples[place][:, channel]
        for start in _starts(len(signal), new.stretch, min(_BLOCKS, max(_EXCERPTS // n_place, _FEWEST))):
            first = start + _liveliest(signal[start : start + new.stretch])
            samples = signal[first : first + min(_WINDOW, new.stretch)].copy()
            windows.append(_Window(samples, new.steps(samples, channel), (place[0], place[1]), first, start))
    return Excerpt(new.names, new.stretch, channel, tuple(windows))


def find_copy(old: Record, excerpt: Excerpt, read: Callable[[], Record]) -> Copy | None:
    """Looks for stretches of a new record in an old one, whatever the scale of each channel.

    Two recordings of the same motion differ by the noise of both. Where all channels that move differ by no more than
    rounding makes of the same samples, in steps of the coarser one, they are one recording; or where what they differ
    by is far below what successive periods differ by, as after an interpolation.

    Args:
        old: Record of one configuration that the fit has seen.
        excerpt: Windows of a record of one configuration, see `take_excerpt`.
        read: Reads that record again; called only where a window is found.

    Returns:
        The first stretch that is found; None where there is none, or where the channels differ.
    """
    before = Stored(old)
    if before.names != excerpt.names:
        return None
    count = min(before.stretch, excerpt.stretch)
    if not _SHORTEST <= count <= before.samples.shape[2]:
        return None
    after: Stored | None = None
    for window, source, at in _candidates(before, excerpt):
        after = after or Stored(read())
        found = _confirmed(before, after, window, source, at, count)
        if found is not None:
            return found
    return None


class _Search:
    """Finds where a signal is most like a window of some length, with the signal's transform kept."""

    def __init__(self, signal: FloatArray, count: int) -> None:
        flat = signal - signal.mean()
        self._size = next_fast_len(len(flat), real=True)
        self._spectrum = rfft(flat, self._size)
        total, square = (np.concatenate([[0.0], np.cumsum(values)]) for values in (flat, flat**2))
        energy = square[count:] - square[:-count] - (total[count:] - total[:-count]) ** 2 / count
        self._energy = np.maximum(energy, 1e-9 * energy.max(initial=0.0) + np.finfo(float).tiny)

    def spectrum(self, window: FloatArray) -> ComplexArray:
        """What `best` needs of a window; the same for all signals of one length."""
        return np.asarray(np.conj(rfft(window - window.mean(), self._size)))

    def best(self, window: ComplexArray) -> list[int]:
        """First samples of the stretches that correlate most with a window, either sign."""
        like = irfft(self._spectrum * window, self._size)[: len(self._energy)] ** 2 / self._energy
        most = min(_TRIED, len(like))
        return [int(at) for at in np.argpartition(like, len(like) - most)[-most:]]


def _candidates(before: Stored, excerpt: Excerpt) -> Iterator[tuple[_Window, tuple[int, int], int]]:
    """Windows that come back in the old record, where, and from which sample on."""
    channel, length = excerpt.channel, min((len(one.samples) for one in excerpt.windows), default=0)
    if not 0 < length <= before.samples.shape[2]:
        return
    places = list(np.ndindex(*before.samples.shape[:2]))
    searches = [_Search(before.samples[place][:, channel], length) for place in places]
    noise = before.noise[channel : channel + 1]
    for window in excerpt.windows:
        spectrum = searches[0].spectrum(window.samples)
        found = [(place, at) for place, search in zip(places, searches, strict=True) for at in search.best(spectrum)]
        # All places at once, each a column.
        here = np.stack([before.samples[place][at : at + length, channel] for place, at in found], axis=-1)
        steps = np.stack([before.steps(values, channel) for values in here.T], axis=-1)
        alike, _ = _alike(here, window.samples[:, None], steps, window.steps[:, None], noise)
        for place, at in (found[index] for index in np.flatnonzero(alike)):
            yield window, (place[0], place[1]), at


def _confirmed(
    before: Stored, after: Stored, window: _Window, source: tuple[int, int], at: int, count: int
) -> Copy | None:
    """The stretch around a window that came back, where all channels do."""
    ahead = at - window.first
    low = max(0, -ahead)
    high = min(after.samples.shape[2], before.samples.shape[2] - ahead) - count
    if high < low:
        return None
    first = int(np.clip(window.stretch_first, low, high))
    one = before.samples[source][first + ahead : first + ahead + count]
    other = after.samples[window.place][first : first + count]
    steps, other_steps = (
        np.stack([whose.steps(values, channel) for channel, values in enumerate(part.T)], axis=-1)
        for whose, part in ((before, one), (after, other))
    )
    noise = np.minimum(before.noise, after.noise)
    return (
        Copy(*window.place, first, *source, first + ahead, count)
        if _same(one, other, steps, other_steps, noise)
        else None
    )


def _same(one: FloatArray, other: FloatArray, steps: FloatArray, other_steps: FloatArray, noise: FloatArray) -> bool:
    """Whether two stretches (n_sample, n_channel) are multiples of each other in every channel that moves."""
    alike, still = _alike(one, other, steps, other_steps, noise)
    return bool(np.all(alike | still) and not still.all())


def _alike(
    one: FloatArray, other: FloatArray, steps: FloatArray, other_steps: FloatArray, noise: FloatArray
) -> tuple[BoolArray, BoolArray]:
    """Which channels (n_channel,) of two stretches move and are multiples of each other, and which move in neither.

    Args:
        one: Samples (n_sample, n_channel) of the old record.
        other: Samples of the new one, or (n_sample, 1).
        steps: Steps at the old samples.
        other_steps: Steps at the new ones.
        noise (n_channel,): Share of noise.
    """
    energy, other_energy = (len(each) * each.var(axis=0) for each in (one, other))
    moving, still = (energy > 0) & (other_energy > 0), (energy == 0) & (other_energy == 0)
    scale, apart = _fitted(one, other, np.ones_like(one))
    limit = rounding(scale * one, other, np.abs(scale) * steps, other_steps)
    shared = (apart**2).sum(axis=0) <= _OF_NOISE * noise * other_energy
    # Coarse steps of large values would move the scale by more than fine ones of small values allow.
    apart = _fitted(one, other, 1 / np.maximum(limit, _LEAST * limit.max(axis=0)))[1]
    rounded = (np.abs(apart) <= limit).all(axis=0)
    return moving & (rounded | shared), still


def _fitted(one: FloatArray, other: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Scale of each channel (n_channel,) that makes one stretch the other, and what is left (n_sample, n_channel)."""
    share = weight**2 / (weight**2).sum(axis=0)
    flat, other_flat = (each - (share * each).sum(axis=0) for each in (one, other))
    energy = (share * flat**2).sum(axis=0)
    scale = np.divide((share * flat * other_flat).sum(axis=0), energy, out=np.zeros_like(energy), where=energy > 0)
    return scale, other_flat - scale * flat


def _liveliest(stretch: FloatArray) -> int:
    """First sample of the window of a stretch in which it moves most."""
    length = min(_WINDOW, len(stretch))
    firsts = np.arange(0, len(stretch) - length + 1, max(length // 2, 1))
    return int(firsts[np.argmax([stretch[first : first + length].var() for first in firsts])])


def _starts(n_time: int, count: int, most: int) -> list[int]:
    """First samples of the stretches of a new recording."""
    every = np.arange(0, n_time - count + 1, max(count, 1))
    chosen = np.unique(np.linspace(0, len(every) - 1, min(most, len(every))).round().astype(int))
    return [int(first) for first in every[chosen]]
