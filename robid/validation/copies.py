"""Whether new data hold samples that the fit has seen: the same recording, scaled, cut or begun elsewhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.signal import detrend

from robid.arrays import FloatArray
from robid.signals.record import Record

_OF_NOISE = 0.05
"""Share of the noise's energy below which two stretches share their noise: independent ones differ by twice it."""

_ROUNDED = 1e-8
"""Share of the energy below which two stretches are the same but for rounding."""

_BLOCKS = 24
"""Stretches of a new recording that are looked for, evenly spread."""

_SHORTEST = 32
"""Shortest stretch that says anything [samples]."""

_SHOT_PARTS = 4
"""Parts of a recording without periods that are looked for one by one."""


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


def find_copy(old: Record, new: Record) -> Copy | None:
    """Looks for stretches of a new record in an old one, whatever the scale of each channel.

    Two recordings of the same motion differ by the noise of both. Where what they differ by is far below what
    successive periods differ by, or below rounding, in every channel that moves, they are one recording.

    Args:
        old: Record of one configuration that the fit has seen.
        new: Record of one configuration.

    Returns:
        The first stretch that is found; None where there is none, or where the channels differ.
    """
    if (old.input_names, old.output_names) != (new.input_names, new.output_names):
        return None
    before, after = _stream(old), _stream(new)
    limit = np.maximum(_OF_NOISE * _noise_share(old), _ROUNDED)
    # Noise tells recordings apart, so what has most of it is searched.
    channel = int(np.argmax(np.where(_moves(before), limit, -1.0)))
    count = _stretch(old, new)
    if count < _SHORTEST or count > before.shape[2]:
        return None
    searches = {place: _Search(before[place][:, channel], count) for place in np.ndindex(*before.shape[:2])}
    for place in np.ndindex(*after.shape[:2]):
        for first in _starts(after.shape[2], count):
            block = after[place][first : first + count]
            for source, search in searches.items():
                at = search.best(block[:, channel])
                if _same(before[source][at : at + count], block, limit):
                    return Copy(place[0], place[1], first, source[0], source[1], at, count)
    return None


class _Search:
    """Finds where a signal is most like a block of some length, with the signal's transform kept."""

    def __init__(self, signal: FloatArray, count: int) -> None:
        flat = signal - signal.mean()
        self._size, self._count = next_fast_len(len(flat), real=True), count
        self._spectrum = rfft(flat, self._size)
        total, square = (np.concatenate([[0.0], np.cumsum(values)]) for values in (flat, flat**2))
        energy = square[count:] - square[:-count] - (total[count:] - total[:-count]) ** 2 / count
        self._energy = np.maximum(energy, 1e-9 * energy.max(initial=0.0) + np.finfo(float).tiny)

    def best(self, block: FloatArray) -> int:
        """First sample of the stretch that correlates most with a block, either sign."""
        product = irfft(self._spectrum * np.conj(rfft(block - block.mean(), self._size)), self._size)
        return int(np.argmax(product[: len(self._energy)] ** 2 / self._energy))


def _stream(record: Record) -> FloatArray:
    """All samples of all channels (n_real, n_exp, n_time, n_channel)."""
    both = np.concatenate([record.inputs[0], record.outputs[0]], axis=-1)
    return np.asarray(both.reshape(*both.shape[:2], -1, both.shape[-1]))


def _moves(stream: FloatArray) -> FloatArray:
    return np.asarray(np.ptp(stream, axis=(0, 1, 2)) > 0)


def _noise_share(record: Record) -> FloatArray:
    """Share of each channel's energy (n_channel,) that differs between successive periods; 0 with a single one.

    The two that differ least count: a transient of the first periods comes back in every recording, as no noise does.
    """
    both = detrend(np.concatenate([record.inputs[0], record.outputs[0]], axis=-1), axis=3)
    if both.shape[2] < 2:
        return np.zeros(both.shape[-1])
    scatter = 0.5 * (np.diff(both, axis=2) ** 2).mean(axis=(0, 1, 3)).min(axis=0)
    return np.asarray(scatter / np.maximum((both**2).mean(axis=(0, 1, 2, 3)), np.finfo(float).tiny))


def _stretch(old: Record, new: Record) -> int:
    """Samples of the stretches to compare: a period, or a part of a recording that has none."""
    lengths = [one.inputs.shape[4] // (_SHOT_PARTS if one.is_one_shot else 1) for one in (old, new)]
    return int(min(lengths))


def _starts(n_time: int, count: int) -> list[int]:
    """First samples of the stretches of a new recording."""
    every = np.arange(0, n_time - count + 1, count)
    chosen = np.unique(np.linspace(0, len(every) - 1, min(_BLOCKS, len(every))).round().astype(int))
    return [int(first) for first in every[chosen]]


def _same(one: FloatArray, other: FloatArray, limit: FloatArray) -> bool:
    """Whether two stretches (n_sample, n_channel) are multiples of each other in every channel that moves."""
    one, other = one - one.mean(axis=0), other - other.mean(axis=0)
    energy, other_energy = (one**2).sum(axis=0), (other**2).sum(axis=0)
    moving = (energy > 0) & (other_energy > 0)
    if not moving.any() or np.any((energy > 0) != (other_energy > 0)):
        return False
    scale = (one * other).sum(axis=0)[moving] / energy[moving]
    left = ((other[:, moving] - scale * one[:, moving]) ** 2).sum(axis=0) / other_energy[moving]
    return bool(np.all(left <= limit[moving]))
