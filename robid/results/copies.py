"""Whether new data hold samples that the fit has seen: the same recording, scaled, cut or begun elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from robid.arrays import ComplexArray, FloatArray
from robid.results.stored import Stored, rounding
from robid.signals.record import Record

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
    """Samples that two records share; all indices from 0.

    Attributes:
        realization: Of the new record.
        experiment: Of the new record.
        first: First sample of the stretch, counted over the new record's periods.
        old_realization: Of the old record.
        old_experiment: Of the old record.
        old_first: First sample there.
        count: Samples of the stretch.
    """

    realization: int
    experiment: int
    first: int
    old_realization: int
    old_experiment: int
    old_first: int
    count: int


@dataclass(frozen=True)
class Excerpt:
    """Short windows of one channel of a new record, by which most others are told from it without reading it again.

    Attributes:
        names: Inputs and outputs of the record.
        stretch: Samples of the stretches that they stand for.
        channel: The channel, inputs first.
        windows: Each of them.
    """

    names: tuple[tuple[str, ...], tuple[str, ...]]
    stretch: int
    channel: int
    windows: tuple[_Window, ...]


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
    for window, source, at in _suspicions(before, excerpt):
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


def _suspicions(before: Stored, excerpt: Excerpt) -> Iterator[tuple[_Window, tuple[int, int], int]]:
    """Windows that come back in the old record, where, and from which sample on."""
    channel, length = excerpt.channel, min((len(one.samples) for one in excerpt.windows), default=0)
    if not 0 < length <= before.samples.shape[2]:
        return
    places = list(np.ndindex(*before.samples.shape[:2]))
    searches = [_Search(before.samples[place][:, channel], length) for place in places]
    noise = before.noise[channel : channel + 1]
    for window in excerpt.windows:
        spectrum = searches[0].spectrum(window.samples)
        for place, search in zip(places, searches, strict=True):
            for at in search.best(spectrum):
                here = before.samples[place][at : at + length, channel]
                steps = before.steps(here, channel)
                if _same(here[:, None], window.samples[:, None], steps[:, None], window.steps[:, None], noise):
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
    """Whether two stretches (n_sample, n_channel) are multiples of each other in every channel that moves.

    Args:
        one: Samples of the old record.
        other: Samples of the new one.
        steps: Steps at the old samples.
        other_steps: Steps at the new ones.
        noise (n_channel,): Share of noise.
    """
    energy, other_energy = (len(each) * each.var(axis=0) for each in (one, other))
    moving = (energy > 0) & (other_energy > 0)
    if not moving.any() or np.any((energy > 0) != (other_energy > 0)):
        return False
    scale, apart = _fitted(one, other, np.ones_like(one))
    limit = rounding(scale * one, other, np.abs(scale) * steps, other_steps)
    shared = (apart**2).sum(axis=0) <= _OF_NOISE * noise * other_energy
    # Coarse steps of large values would move the scale by more than fine ones of small values allow.
    apart = _fitted(one, other, 1 / np.maximum(limit, _LEAST * limit.max(axis=0)))[1]
    rounded = (np.abs(apart) <= limit).all(axis=0)
    return bool(np.all((rounded | shared)[moving]))


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
