"""Rows of the inverse dynamics, filtered and decimated block by block."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.models.rigid.fit.preprocessing import Motion
from robid.models.rigid.fit.rows import Regressor, Rows
from robid.signals.filters import Decimator, central_differences

_BLOCK_SAMPLES = 8192
_BLOCK_REACHES = 8


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
            self._fast(deciding, motion.slow),
            None if simulated is None else columns(simulated),
        )

    def __iter__(self) -> Iterator[Rows]:
        return (self[index] for index in range(len(self)))

    def _fast(self, speed: FloatArray, slow: FloatArray) -> BoolArray:
        """Which kept samples have no slow one nearer than the next kept one."""
        kept = self._decimator.kept(len(speed))
        ok = np.ones((len(kept), speed.shape[1]), dtype=bool)
        if not np.any(slow > 0):
            return ok
        nearest = min(self._decimator.factor, self._decimator.reach)
        window = kept[:, None] + np.arange(-nearest, nearest + 1)
        return np.asarray(np.all(np.abs(speed[window]) >= slow, axis=1))


def _differentiated(
    motion: Motion, position: FloatArray, first: int, end: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Returns low-passed positions, speeds and accelerations of some samples."""
    around = motion.smooth(position, first - 1, end + 1)
    return around[1:-1], *central_differences(around, motion.sampling_period_s)
