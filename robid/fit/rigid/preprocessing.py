"""From sampled positions and torques to the rows of the inverse dynamics."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from robid.arrays import BoolArray, FloatArray, check_shape
from robid.fit.rigid.rows import Regressor, Rows
from robid.signals.filters import Decimator, central_differences, design_decimator, low_pass, low_pass_reach

_BLOCK_SAMPLES = 8192
_BLOCK_REACHES = 8


@dataclass(frozen=True)
class PreprocessingOptions:
    """Filters of an inverse-dynamics fit.

    Attributes:
        position_cut_hz: Cut-off of the positions' low pass.
        position_order: Order of one of its two passes.
        decimation: Samples per kept sample; 0 keeps twice the cut-off's rate.
        drop_deviations: Rows about speeds below so many deviations of the speed's noise are dropped; 0 keeps all.
    """

    position_cut_hz: float = field(metadata={"description": "Cut-off of the positions' low pass.", "gt": 0})
    position_order: int = field(default=4, metadata={"description": "Order of one of its two passes.", "ge": 1})
    decimation: int = field(
        default=0, metadata={"description": "Samples per kept sample; 0 keeps twice the cut-off's rate.", "ge": 0}
    )
    drop_deviations: float = field(
        default=0.0,
        metadata={"description": "Deviations of the speed's noise below which rows are dropped; 0 keeps all.", "ge": 0},
    )

    def decimator(self, sampling_period_s: float) -> Decimator:
        """Designs the filter that torques and columns pass."""
        twice = round(1 / (2 * self.position_cut_hz * sampling_period_s))
        return design_decimator(self.decimation or max(1, twice))


@dataclass(frozen=True)
class Motion:
    """One uninterrupted record, filtered and trimmed.

    Attributes:
        sampling_period_s: Sampling period [s].
        position (n_sample, n_joint): Low-passed positions [rad, or m].
        torque (n_sample, n_joint): Torques [N m, or N].
        instrument (n_sample, n_joint): Low-passed positions of a simulation without noise, or None.
        slow (n_joint,): Speeds below which rows are dropped [rad/s, or m/s]; 0 drops none.
    """

    sampling_period_s: float
    position: FloatArray
    torque: FloatArray
    instrument: FloatArray | None
    slow: FloatArray


def prepare(
    position: FloatArray,
    torque: FloatArray,
    sampling_period_s: float,
    options: PreprocessingOptions,
    *,
    instrument: FloatArray | None = None,
    held: bool = False,
) -> Motion:
    """Filters the positions of a record and trims what its ends reach.

    Args:
        position (n_sample, n_joint): Measured positions [rad, or m].
        torque (n_sample, n_joint): Motor torques [N m, or N].
        sampling_period_s: Sampling period [s].
        options: The filters.
        instrument (n_sample, n_joint): Positions of a simulation without noise, for instrumental variables.
        held: Whether each torque is a command held until the next sample; its mean about a sample is then taken.

    Raises:
        ValueError: If the record is too short for its filters.
    """
    n_sample, n_joint = position.shape
    check_shape("torque", torque, "n_sample n_joint", n_sample=n_sample, n_joint=n_joint)
    reach = low_pass_reach(sampling_period_s, options.position_cut_hz, options.position_order)
    if n_sample <= 2 * reach + 2:
        message = f"The record has {n_sample} samples, but the ends of its filter alone reach into {2 * reach}."
        raise ValueError(message)
    inner = slice(reach, n_sample - reach)

    def filtered(angle: FloatArray) -> FloatArray:
        return low_pass(angle, sampling_period_s, options.position_cut_hz, options.position_order)[inner]

    smooth = filtered(position)
    centred = 0.5 * (torque + np.roll(torque, 1, axis=0)) if held else torque
    slow = options.drop_deviations * speed_noise(position[inner] - smooth, sampling_period_s, options)
    return Motion(sampling_period_s, smooth, centred[inner], None if instrument is None else filtered(instrument), slow)


def speed_noise(removed: FloatArray, sampling_period_s: float, options: PreprocessingOptions) -> FloatArray:
    """Estimates the deviation (n_joint,) of the filtered speed's noise [rad/s, or m/s].

    Args:
        removed (n_sample, n_joint): What the low pass took from the positions, white noise for its greater part.
        sampling_period_s: Sampling period [s].
        options: The filters.
    """
    from scipy.signal import butter, sosfreqz

    sections = butter(options.position_order, options.position_cut_hz, fs=1 / sampling_period_s, output="sos")
    angle, response = sosfreqz(sections, 8192)
    gain = np.abs(response) ** 2
    kept = np.mean((gain * np.sin(angle) / sampling_period_s) ** 2)
    return np.asarray(np.std(removed, axis=0) * np.sqrt(kept / np.mean((1 - gain) ** 2)))


class Reading:
    """Rows of motions, filtered and decimated block by block.

    Args:
        motions: The records; no row lies across two.
        regressor: The inverse dynamics.
        decimator: What torque and columns pass.
        block_samples: Samples of a block, for memory; a block has at least some reaches of the filter.
    """

    def __init__(
        self,
        motions: Sequence[Motion],
        regressor: Regressor,
        decimator: Decimator,
        block_samples: int = _BLOCK_SAMPLES,
    ) -> None:
        self._regressor = regressor
        self._decimator = decimator
        n_row = max(1, max(block_samples, _BLOCK_REACHES * decimator.reach) // decimator.factor)
        self._blocks: list[tuple[Motion, int, int]] = []
        for motion in motions:
            kept = decimator.kept(len(motion.position) - 2) + 1
            for first in range(0, len(kept), n_row):
                last = kept[min(first + n_row, len(kept)) - 1]
                self._blocks.append((motion, int(kept[first]) - decimator.reach, int(last) + decimator.reach + 1))

    def __len__(self) -> int:
        return len(self._blocks)

    def __getitem__(self, index: int, /) -> Rows:
        motion, first, end = self._blocks[index]
        velocity = self._speed(motion.position, motion, first, end)
        instruments, deciding = None, velocity
        if motion.instrument is not None:
            deciding = self._speed(motion.instrument, motion, first, end)
            instruments = self._decimator(self._columns(motion.instrument, motion, first, end, deciding))
        columns = self._decimator(self._columns(motion.position, motion, first, end, deciding))
        torque = self._decimator(motion.torque[first:end])
        return Rows(columns, torque, self._fast(deciding, motion.slow), instruments)

    def __iter__(self) -> Iterator[Rows]:
        return (self[index] for index in range(len(self)))

    def _speed(self, position: FloatArray, motion: Motion, first: int, end: int) -> FloatArray:
        return central_differences(position[first - 1 : end + 1], motion.sampling_period_s)[0]

    def _columns(
        self, position: FloatArray, motion: Motion, first: int, end: int, friction_speed: FloatArray
    ) -> FloatArray:
        around = position[first - 1 : end + 1]
        velocity, acceleration = central_differences(around, motion.sampling_period_s)
        return self._regressor.columns(around[1:-1], velocity, acceleration, friction_speed)

    def _fast(self, speed: FloatArray, slow: FloatArray) -> BoolArray:
        """Which kept samples have no slow one within a kept sample's distance."""
        kept = self._decimator.kept(len(speed))
        ok = np.ones((len(kept), speed.shape[1]), dtype=bool)
        if not np.any(slow > 0):
            return ok
        near = np.arange(-self._decimator.factor, self._decimator.factor + 1)
        window = np.clip(kept[:, None] + near, 0, len(speed) - 1)
        return np.asarray(np.all(np.abs(speed[window]) >= slow, axis=1))
