"""Stepped sines: one frequency after the other, whole cycles of each."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray, IntArray


def whole_cycles(frequency: FloatArray, n_sample: int) -> IntArray:
    """Shares a length among frequencies: about the same time for each, at least one cycle.

    Args:
        frequency (n_step,): Rising frequencies [cycles per sample].
        n_sample: Length.

    Returns:
        Cycles of each frequency; together they take at most `n_sample`, and less than a cycle of the highest
        frequency is left.

    Raises:
        ValueError: If one cycle of each takes longer.
    """

    def cycles(dwell: float) -> IntArray:
        return np.asarray(np.maximum(np.floor(frequency * dwell), 1).astype(int))

    def length(count: IntArray) -> float:
        return float(np.sum(count / frequency))

    if length(cycles(0.0)) > n_sample:
        message = f"one cycle of each frequency takes {length(cycles(0.0)):.0f} samples, more than {n_sample}"
        raise ValueError(message)
    low, high = 0.0, float(n_sample)
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if length(cycles(middle)) <= n_sample else (low, middle)
    count = cycles(low)
    for step in range(len(frequency)):
        count[step] += int((n_sample - length(count)) * frequency[step])
    return count


def stepped_sine(frequency: FloatArray, n_sample: int) -> FloatArray:
    """Returns a sine of unit amplitude that passes through the frequencies without a jump.

    Args:
        frequency (n_step,): Rising frequencies [cycles per sample]; all are lowered by one common factor so that
            their whole cycles fill the length exactly.
        n_sample: Length.

    Raises:
        ValueError: If one cycle of each takes longer.
    """
    count = whole_cycles(frequency, n_sample)
    duration = count / frequency
    ends = np.concatenate([[0.0], np.cumsum(duration)]) * (n_sample / duration.sum())
    turns = np.concatenate([[0], np.cumsum(count)])
    return np.asarray(np.sin(2 * np.pi * np.interp(np.arange(n_sample), ends, turns)))
