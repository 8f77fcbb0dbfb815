"""What every estimator reads: rows of an inverse-dynamics model, in blocks that pass again and again."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from robid.arrays import BoolArray, FloatArray

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

        Args:
            position (n_sample, n_joint): Positions [rad, or m].
            velocity (n_sample, n_joint): Speeds.
            acceleration (n_sample, n_joint): Accelerations.
            torque (n_sample, n_joint): Torques that friction grows with, where it does [N m, or N].
            friction_speed (n_sample, n_joint): Speeds that give friction its sign; `velocity` by default.
            loaded: Whether a payload with parameters of its own is there.
        """


@dataclass(frozen=True)
class Rows:
    """A block of rows, one for each joint at each kept sample.

    Attributes:
        columns (n_row, n_joint, n_param): Regressor, in the torque's unit over the parameters'.
        torque (n_row, n_joint): What it explains [N m, or N].
        used (n_row, n_joint): Which rows count.
        instruments (n_row, n_joint, n_param): Regressor along a motion without noise; None where there is none.
    """

    columns: FloatArray
    torque: FloatArray
    used: BoolArray
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


def rows_of(columns: FloatArray, torque: FloatArray, instruments: FloatArray | None = None) -> RowSource:
    """Makes a source of rows that are whole in memory, for small problems.

    Args:
        columns (n_row, n_joint, n_param): Regressor.
        torque (n_row, n_joint): Torques.
        instruments (n_row, n_joint, n_param): Instruments, if any.
    """
    return (Rows(columns, torque, np.ones(torque.shape, dtype=bool), instruments),)


class Remembered:
    """A source that keeps what fits its budget, so that only the other blocks are made again in each pass.

    Args:
        source: Where the rows come from.
        budget_bytes: What the kept blocks may take.
    """

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
