"""Filters a record: what an inverse-dynamics fit needs of it, sample by sample."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray, check_shape
from robid.fit.rigid.options import PreprocessingOptions
from robid.signals.filters import low_pass, low_pass_gain, low_pass_reach


@dataclass(frozen=True)
class Motion:
    """One uninterrupted record, filtered and trimmed.

    Attributes:
        sampling_period_s: Sampling period [s].
        position (n_sample, n_joint): Low-passed positions [rad, or m].
        torque (n_sample, n_joint): Torques [N m, or N].
        instrument (n_sample, n_joint): Low-passed positions of a simulation without noise, or None.
        slow (n_joint,): Speeds below which rows are dropped [rad/s, or m/s]; 0 drops none.
        load (n_sample, n_joint): Low-passed torques for friction that grows with them; None where none does.
        loaded: Whether a payload with parameters of its own is there.
    """

    sampling_period_s: float
    position: FloatArray
    torque: FloatArray
    instrument: FloatArray | None
    slow: FloatArray
    load: FloatArray | None = None
    loaded: bool = True


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
    """Filters the positions of a record and trims what its ends reach.

    Args:
        position (n_sample, n_joint): Measured positions [rad, or m].
        torque (n_sample, n_joint): Motor torques [N m, or N].
        sampling_period_s: Sampling period [s].
        options: The filters.
        instrument (n_sample, n_joint): Positions of a simulation without noise, for instrumental variables.
        held: Whether each torque is a command held until the next sample; its mean about a sample is then taken.
        load_dependent: Whether friction grows with the torque.
        loaded: Whether a payload with parameters of its own is there.

    Raises:
        ValueError: If the record is too short for its filters.
    """
    n_sample, n_joint = position.shape
    check_shape("torque", torque, "n_sample n_joint", n_sample=n_sample, n_joint=n_joint)
    reach = low_pass_reach(sampling_period_s, options.cut_hz, options.position_order)
    if n_sample <= 2 * reach + 2:
        message = f"The record has {n_sample} samples, but the ends of its filter alone reach into {2 * reach}."
        raise ValueError(message)
    inner = slice(reach, n_sample - reach)

    def filtered(signal: FloatArray) -> FloatArray:
        return low_pass(signal, sampling_period_s, options.cut_hz, options.position_order)[inner]

    smooth = filtered(position)
    centred = 0.5 * (torque + np.roll(torque, 1, axis=0)) if held else torque
    slow: FloatArray = np.full(n_joint, options.drop_below_rad_s)
    if options.drop_deviations:
        noise = speed_noise(position[inner] - smooth, sampling_period_s, options)
        slow = np.maximum(slow, options.drop_deviations * noise)
    return Motion(
        sampling_period_s=sampling_period_s,
        position=smooth,
        torque=centred[inner],
        instrument=None if instrument is None else filtered(instrument),
        slow=slow,
        load=filtered(centred) if load_dependent else None,
        loaded=loaded,
    )


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
