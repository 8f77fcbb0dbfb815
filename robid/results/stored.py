"""A record's samples as they are compared with another's, and the resolution that they were stored with."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.signal import detrend

from robid.arrays import FloatArray
from robid.signals.record import Record

_MOST = 1 << 16
"""Samples that are looked at, evenly spread."""

_TWO_ROUNDINGS = 0.6
"""Share of the coarser step by which two roundings of one value may differ: half of it, and what a fit adds."""


@dataclass(frozen=True)
class Resolution:
    """Steps of a channel by the size of its values: a number of digits makes large values coarser.

    Attributes:
        size (n_step,): Largest size of a value up to which each step holds, in ascending order.
        step (n_step,): Smallest distance of two different values of that size or larger; what chance makes of it
            where there is none.
    """

    size: FloatArray
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
