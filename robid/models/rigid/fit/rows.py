"""Rows of the regression: positions and torques filtered alike, and the regressor along the motion by blocks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from robid.arrays import BoolArray, FloatArray, check_shape
from robid.models.rigid.fit.options import PreprocessingOptions
from robid.signals.filters import Decimator, central_differences, low_pass, low_pass_gain, low_pass_reach

_BUDGET_BYTES = 256 << 20


class Regressor(Protocol):
    """An inverse dynamics that is linear in its parameters."""

    @property
    def names(self) -> Sequence[str]:
        """Name of each parameter."""

    @property
    def kinds(self) -> Sequence[str]:
        """Kind of each parameter."""

    @property
    def units(self) -> Sequence[str]:
        """Unit of each parameter."""

    def columns(
        self,
        position: FloatArray,
        velocity: FloatArray,
        acceleration: FloatArray,
        *,
        torque: FloatArray | None = None,
        friction_speed: FloatArray | None = None,
        loaded: bool = True,
    ) -> FloatArray:
        """Returns one column a parameter (n_sample, n_joint, n_param) along a motion.

        Of (n_sample, n_joint) each are positions [rad, or m], speeds, accelerations, torques that friction grows with,
        where it does [N m, or N], and speeds that give friction its sign, `velocity` by default.
        """


@dataclass(frozen=True)
class Rows:
    """A block of rows, one for each joint at each kept sample."""

    columns: FloatArray  # (n_row, n_joint, n_param): Regressor, in the torque's unit over the parameters'
    torque: FloatArray  # (n_row, n_joint): what it explains [N m, or N]
    used: BoolArray  # (n_row, n_joint): which rows count
    # (n_row, n_joint, n_param): regressor along a motion without noise; None where there is none.
    instruments: FloatArray | None = None

    @property
    def n_byte(self) -> int:
        """Memory that the block takes."""
        arrays = (self.columns, self.torque, self.used, self.instruments)
        return sum(array.nbytes for array in arrays if array is not None)


class RowSource(Protocol):
    """Blocks of rows in the order of time, each made when it is asked for; a tuple of blocks is one."""

    def __len__(self) -> int:
        """Number of blocks."""

    def __getitem__(self, index: int, /) -> Rows:
        """Makes one block."""

    def __iter__(self) -> Iterator[Rows]:
        """Makes all blocks, one after the other."""


class Remembered:
    """A source that keeps what fits its budget, so that only the other blocks are made again in each pass."""

    def __init__(self, source: RowSource, budget_bytes: int = _BUDGET_BYTES) -> None:
        self._source = source
        self._budget = budget_bytes
        self._kept: dict[int, Rows] = {}

    def __len__(self) -> int:
        return len(self._source)

    def __getitem__(self, index: int, /) -> Rows:
        if index in self._kept:
            return self._kept[index]
        rows = self._source[index]
        if rows.n_byte <= self._budget:
            self._budget -= rows.n_byte
            self._kept[index] = rows
        return rows

    def __iter__(self) -> Iterator[Rows]:
        return (self[index] for index in range(len(self)))


_MARGIN = 4  # reaches after which a filter's beginning is forgotten to rounding


@dataclass(frozen=True)
class Motion:
    """One uninterrupted record and what is to be done with it; its samples are those of the caller, not copies."""

    sampling_period_s: float
    position: FloatArray  # (n_sample, n_joint): measured positions [rad, or m]
    torque: FloatArray  # (n_sample, n_joint): motor torques [N m, or N]
    options: PreprocessingOptions  # the filters
    instrument: FloatArray | None  # (n_sample, n_joint): positions of a simulation without noise, or None
    slow: FloatArray  # (n_joint,): speeds below which rows are dropped [rad/s, or m/s]; 0 drops none
    held: bool  # whether each torque is a command held until the next sample; its mean about a sample is then taken
    load_dependent: bool  # whether friction grows with the torque
    loaded: bool  # whether a payload with parameters of its own is there
    rest: BoolArray | None = None  # (n_sample, n_joint): where motors stand still; None where rows there count

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
        # A command that is held from t to t + T has, about t, half of the one before.
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
    dry: bool = False,
) -> Motion:
    """Checks a record and finds the speeds that are too slow, and where motors stand still if friction is `dry`.

    Of (n_sample, n_joint) each are measured positions [rad, or m], motor torques [N m, or N], commands held until the
    next sample where `held`, and, for instrumental variables, positions of a simulation without noise.

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
    is_dropping = dry and options.drop_rest
    if not (options.drop_deviations or is_dropping):
        return motion
    inner = slice(motion.reach, n_sample - motion.reach)
    removed = position[inner] - motion.smooth(position, inner.start, inner.stop)
    if options.drop_deviations:
        slow = np.maximum(slow, options.drop_deviations * speed_noise(removed, sampling_period_s, options))
    return replace(motion, slow=slow, rest=_resting(position, removed, sampling_period_s) if is_dropping else None)


_REST_S, _REST_SAMPLES = 0.25, 16  # shortest standstill, in seconds and in samples
_WITHIN = 6.0  # deviations of the positions' noise: all of it
_LEAST_MOVING = 0.1  # of the samples, below which a motor's standstill says nothing of its friction in motion


def _resting(position: FloatArray, removed: FloatArray, sampling_period_s: float) -> BoolArray | None:
    """Where each motor's positions (n_sample, n_joint) stay within their noise for some time; None if nowhere.

    The median of what the low pass `removed` of them tells that noise, whatever motion is in it here and there.
    """
    n_sample = len(position)
    width = min(max(_REST_SAMPLES, round(_REST_S / sampling_period_s)), n_sample)
    noise = np.median(np.abs(removed), axis=0) / 0.6745  # of a normal distribution, the deviation
    span = maximum_filter1d(position, width, axis=0) - minimum_filter1d(position, width, axis=0)
    # A window at rest is at rest in all of its samples.
    rest = maximum_filter1d((span <= _WITHIN * noise).astype(np.uint8), width, axis=0, origin=-(1 - width % 2)) > 0
    rest &= (~rest).mean(axis=0) > _LEAST_MOVING
    return np.asarray(rest) if rest.any() else None


def speed_noise(removed: FloatArray, sampling_period_s: float, options: PreprocessingOptions) -> FloatArray:
    """Estimates the deviation (n_joint,) of the filtered speed's noise [rad/s, or m/s].

    What the low pass took from the positions (n_sample, n_joint) is white noise for its greater part.
    """
    angle, gain = low_pass_gain(sampling_period_s, options.cut_hz, options.position_order)
    # White noise of positions passes the filter and the central difference, i sin(angle) / T; what the filter removed,
    # 1 - gain, tells its size.
    kept = np.mean((gain * np.sin(angle) / sampling_period_s) ** 2)
    return np.asarray(np.std(removed, axis=0) * np.sqrt(kept / np.mean((1 - gain) ** 2)))


_BLOCK_SAMPLES = 8192
_BLOCK_REACHES = 8


class Reading:
    """Rows of motions, filtered and decimated block by block.

    No row lies across two motions; a block has at least some reaches of the filter.
    """

    def __init__(
        self, motions: Sequence[Motion], regressor: Regressor, decimator: Decimator, block_samples: int = _BLOCK_SAMPLES
    ) -> None:
        self._regressor = regressor
        self._decimator = decimator
        n_row = max(1, max(block_samples, _BLOCK_REACHES * decimator.reach) // decimator.factor)
        self._blocks: list[tuple[Motion, int, int]] = []
        for motion in motions:
            ends = motion.reach + 1
            kept = decimator.kept(len(motion.position) - 2 * ends) + ends
            for first in range(0, len(kept), n_row):
                last = kept[min(first + n_row, len(kept)) - 1]
                self._blocks.append((motion, int(kept[first]) - decimator.reach, int(last) + decimator.reach + 1))

    def __len__(self) -> int:
        return len(self._blocks)

    def __getitem__(self, index: int, /) -> Rows:
        motion, first, end = self._blocks[index]
        measured = _differentiated(motion, motion.position, first, end)
        simulated = None if motion.instrument is None else _differentiated(motion, motion.instrument, first, end)
        deciding = (simulated or measured)[1]
        load = motion.smooth(motion.torque, first, end) if motion.load_dependent else None

        def columns(path: tuple[FloatArray, FloatArray, FloatArray]) -> FloatArray:
            whole = self._regressor.columns(*path, torque=load, friction_speed=deciding, loaded=motion.loaded)
            return self._decimator(whole)

        return Rows(
            columns(measured),
            self._decimator(motion.centred_torque(first, end)),
            self._counting(motion, deciding, first),
            None if simulated is None else columns(simulated),
        )

    def __iter__(self) -> Iterator[Rows]:
        return (self[index] for index in range(len(self)))

    def _counting(self, motion: Motion, speed: FloatArray, first: int) -> BoolArray:
        """Which kept samples have none that is slow, or at rest, nearer than the next kept one."""
        kept = self._decimator.kept(len(speed))
        ok = np.ones((len(kept), speed.shape[1]), dtype=bool)
        # A kept row is a mean over the decimator's reach; one slow sample near its centre would bring another friction
        # into it.
        nearest = min(self._decimator.factor, self._decimator.reach)
        window = kept[:, None] + np.arange(-nearest, nearest + 1)
        if np.any(motion.slow > 0):
            ok &= np.all(np.abs(speed[window]) >= motion.slow, axis=1)
        if motion.rest is not None:
            ok &= ~np.any(motion.rest[first + window], axis=1)
        return ok


def _differentiated(
    motion: Motion, position: FloatArray, first: int, end: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    # Filter first, then differentiate: both commute, and the differences of what is smooth have no noise to speak of.
    around = motion.smooth(position, first - 1, end + 1)
    return around[1:-1], *central_differences(around, motion.sampling_period_s)
