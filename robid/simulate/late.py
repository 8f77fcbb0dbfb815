"""Signals that come late, by parts of a sample too."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray, IntArray

_EXACT = 1e-9  # of a sample


class Late:
    """Shows values of many simulations as they were some time before, each channel with its own lag.

    Args:
        late_s (n_channel,): How late each one is [s].
        period_s: Sampling period [s].
    """

    def __init__(self, late_s: FloatArray, period_s: float) -> None:
        self._period_s = period_s
        self._age, self._share = samples_of(late_s, period_s)
        self.lags = bool(self._age.any() or self._share.any())
        self._seen: list[tuple[FloatArray, FloatArray]] = []

    def begin(self, value: FloatArray, rate: FloatArray) -> None:
        """Begins with values and rates (n_sim, n_channel) of now, as if the rates had always been these."""
        ages = range(1, int(self._age.max(initial=0)) + 3)
        self._seen = [(value - age * self._period_s * rate, rate) for age in ages]

    def read(self, value: FloatArray, rate: FloatArray) -> FloatArray:
        """Returns late values (n_sim, n_channel), between samples by the cubic through values and rates of both.

        Once a sample.

        Args:
            value (n_sim, n_channel): Values of now.
            rate (n_sim, n_channel): Their rates [1/s].
        """
        self._seen = [(value, rate), *self._seen[:-1]]
        (after, fast), (before, slow) = (
            [of_each([seen[part] for seen in self._seen], self._age + more) for part in (0, 1)] for more in (0, 1)
        )
        # Hermite's cubic on the unit interval; `at` runs from the earlier sample to the later one.
        at = 1 - self._share
        way, rise, fall = at**2 * (3 - 2 * at), at * (1 - at) ** 2, at**2 * (at - 1)
        return np.asarray(before + way * (after - before) + self._period_s * (rise * slow + fall * fast))


def samples_of(late_s: FloatArray, period_s: float) -> tuple[IntArray, FloatArray]:
    """Returns whole samples and the part of one (n_channel,) by which channels are late (n_channel,) [s]."""
    samples = np.asarray(late_s, float) / period_s
    whole = np.floor(samples + _EXACT).astype(int)
    part = samples - whole
    return whole, np.where(part > _EXACT, part, 0.0)


def of_each(values: list[FloatArray], age: IntArray) -> FloatArray:
    """Returns values (n_sim, n_channel) of samples, latest first, each channel's of an age (n_channel,) in samples."""
    return np.stack([values[old][:, channel] for channel, old in enumerate(age.tolist())], axis=1)
