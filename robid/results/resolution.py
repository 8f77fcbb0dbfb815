"""How finely the samples of a record are stored: the steps of a converter, of an encoder or of an export's digits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray

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
