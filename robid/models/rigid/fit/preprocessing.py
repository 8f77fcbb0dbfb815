"""A record and the filters that make it fit for inverse dynamics."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray, check_shape
from robid.models.rigid.fit.options import PreprocessingOptions
from robid.signals.filters import low_pass, low_pass_gain, low_pass_reach

_MARGIN = 4  # reaches after which a filter's beginning is forgotten to rounding


@dataclass(frozen=True)
class Motion:
    """One uninterrupted record and what is to be done with it; its samples are those of the caller, not copies.

    Attributes:
        sampling_period_s: Sampling period [s].
        position (n_sample, n_joint): Measured positions [rad, or m].
        torque (n_sample, n_joint): Motor torques [N m, or N].
        options: The filters.
        instrument (n_sample, n_joint): Positions of a simulation without noise, or None.
        slow (n_joint,): Speeds below which rows are dropped [rad/s, or m/s]; 0 drops none.
        held: Whether each torque is a command held until the next sample; its mean about a sample is then taken.
        load_dependent: Whether friction grows with the torque.
        loaded: Whether a payload with parameters of its own is there.
    """

    sampling_period_s: float
    position: FloatArray
    torque: FloatArray
    options: PreprocessingOptions
    instrument: FloatArray | None
    slow: FloatArray
    held: bool
    load_dependent: bool
    loaded: bool

    @property
    def reach(self) -> int:
        """Samples at either end that the low pass cannot filter."""
        options = self.options
        return low_pass_reach(self.sampling_period_s, options.cut_hz, options.position_order)

    def smooth(self, signal: FloatArray, first: int, end: int) -> FloatArray:
        """Low-passes the samples from `first` to before `end` of a signal (n_sample, n_joint) as if it were whole."""
        margin = _MARGIN * self.reach
        start = max(0, first - margin)
        options = self.options
        part = signal[start : end + margin]
        filtered = low_pass(part, self.sampling_period_s, options.cut_hz, options.position_order)
        return filtered[first - start : end - start]

    def centred_torque(self, first: int, end: int) -> FloatArray:
        """Returns the mean torques about the samples from `first`, the second one at least, to before `end`."""
        if not self.held:
            return self.torque[first:end]
        return np.asarray(0.5 * (self.torque[first:end] + self.torque[first - 1 : end - 1]))


def prepare(
    position: FloatArray,
    torque: FloatArray,
    sampling_period_s: float,
    options: PreprocessingOptions,
    *,
    instrument: FloatArray | None = None,
    held: bool = False,
    load_dependent: bool = False,
    loaded: bool = True,
) -> Motion:
    """Checks a record and finds the speeds that are too slow.

    Args:
        position (n_sample, n_joint): Measured positions [rad, or m].
        torque (n_sample, n_joint): Motor torques [N m, or N].
        sampling_period_s: Sampling period [s].
        options: The filters.
        instrument (n_sample, n_joint): Positions of a simulation without noise, for instrumental variables.
        held: Whether each torque is a command held until the next sample.
        load_dependent: Whether friction grows with the torque.
        loaded: Whether a payload with parameters of its own is there.

    Raises:
        ValueError: If the record is too short for its filters.
    """
    n_sample, n_joint = position.shape
    check_shape("torque", torque, "n_sample n_joint", n_sample=n_sample, n_joint=n_joint)
    if instrument is not None:
        check_shape("instrument", instrument, "n_sample n_joint", n_sample=n_sample, n_joint=n_joint)
    slow: FloatArray = np.full(n_joint, options.drop_below_rad_s)
    motion = Motion(sampling_period_s, position, torque, options, instrument, slow, held, load_dependent, loaded)
    if n_sample <= 2 * motion.reach + 2:
        message = f"The record has {n_sample} samples, but the ends of its filter alone reach into {2 * motion.reach}."
        raise ValueError(message)
    if options.drop_deviations:
        inner = slice(motion.reach, n_sample - motion.reach)
        removed = position[inner] - motion.smooth(position, inner.start, inner.stop)
        slow = np.maximum(slow, options.drop_deviations * speed_noise(removed, sampling_period_s, options))
    return replace(motion, slow=slow)


def speed_noise(removed: FloatArray, sampling_period_s: float, options: PreprocessingOptions) -> FloatArray:
    """Estimates the deviation (n_joint,) of the filtered speed's noise [rad/s, or m/s].

    Args:
        removed (n_sample, n_joint): What the low pass took from the positions, white noise for its greater part.
        sampling_period_s: Sampling period [s].
        options: The filters.
    """
    angle, gain = low_pass_gain(sampling_period_s, options.cut_hz, options.position_order)
    kept = np.mean((gain * np.sin(angle) / sampling_period_s) ** 2)
    return np.asarray(np.std(removed, axis=0) * np.sqrt(kept / np.mean((1 - gain) ** 2)))
