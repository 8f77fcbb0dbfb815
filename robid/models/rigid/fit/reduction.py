"""One pass over the rows: the triangular factor of each joint's rows, all that least squares need of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, FloatArray, IntArray
from robid.models.rigid.fit.rows import Rows, RowSource


@dataclass(frozen=True)
class Reduction:
    """Rows of each joint reduced by QR.

    Attributes:
        factors (n_joint, n_param + 1, n_param + 1): Factor F of each joint, `F' F = [W y]' [W y]`.
        n_row (n_joint,): Rows that went into it.
    """

    factors: FloatArray
    n_row: IntArray

    @property
    def n_param(self) -> int:
        """Number of parameters."""
        return int(self.factors.shape[2]) - 1

    def weighted(self, weights: FloatArray) -> FloatArray:
        """Returns the triangular factor of all rows, each joint's multiplied by the root of its weight (n_joint,)."""
        stacked = (np.sqrt(weights)[:, None, None] * self.factors).reshape(-1, self.n_param + 1)
        return np.asarray(np.linalg.qr(stacked, mode="r"))

    def cost(self, parameters: FloatArray) -> FloatArray:
        """Returns the sum (n_joint,) of squared residuals of each joint."""
        residual = self.factors @ np.append(-parameters, 1.0)
        return np.asarray(np.sum(residual**2, axis=1))


def reduce_rows(source: RowSource) -> Reduction:
    """Reduces the rows of a pass.

    Raises:
        ValueError: If no rows come.
    """
    running = _Running()
    for rows in source:
        running.add(np.concatenate([rows.columns, rows.torque[..., None]], axis=2), rows.used)
    return running.result()


def reduce_weighted(
    source: RowSource, parameters: FloatArray, weigh: Callable[[FloatArray], FloatArray]
) -> tuple[Reduction, FloatArray]:
    """Reduces rows with weights that follow from their residuals, in one pass.

    Args:
        source: The rows.
        parameters (n_param,): Where the residuals are taken.
        weigh: Weights of residuals (n_row, n_joint).

    Returns:
        The weighted rows' reduction, and all residuals (n_row, n_joint), NaN where a row is not used.
    """
    running, kept = _Running(), []
    for rows in source:
        residual = _residual(rows, parameters)
        joined = np.concatenate([rows.columns, rows.torque[..., None]], axis=2)
        joined *= np.sqrt(weigh(residual))[..., None]
        running.add(joined, rows.used)
        kept.append(residual)
    return running.result(), np.concatenate(kept)


def residuals(source: RowSource, parameters: FloatArray) -> FloatArray:
    """Returns the residual (n_row, n_joint) of every row in one pass; NaN where a row is not used."""
    return np.concatenate([_residual(rows, parameters) for rows in source])


class _Running:
    """Triangular factors that grow by blocks."""

    def __init__(self) -> None:
        self._factors: list[FloatArray] = []
        self._count: list[int] = []

    def add(self, joined: FloatArray, used: BoolArray) -> None:
        """Adds rows (n_row, n_joint, n_param + 1), those that are used (n_row, n_joint)."""
        if not self._factors:
            self._factors = [np.zeros((0, joined.shape[2]))] * joined.shape[1]
            self._count = [0] * joined.shape[1]
        for joint, factor in enumerate(self._factors):
            chosen = joined[used[:, joint], joint]
            self._factors[joint] = _stack(factor, chosen)
            self._count[joint] += len(chosen)

    def result(self) -> Reduction:
        """Returns what the blocks came to."""
        if not sum(self._count):
            raise ValueError("There are no rows to fit: the record is shorter than its filters, or too slow.")
        factors = [np.pad(f, ((0, f.shape[1] - f.shape[0]), (0, 0))) for f in self._factors]
        return Reduction(np.stack(factors), np.array(self._count))


def _stack(factor: FloatArray, rows: FloatArray) -> FloatArray:
    """Reduces rows below a factor; the columns of a joint that are all zero, half of a chain's, cost nothing."""
    active = np.any(factor, axis=0) | np.any(rows, axis=0)
    reduced = np.linalg.qr(np.vstack([factor[:, active], rows[:, active]]), mode="r")
    whole = np.zeros((len(reduced), rows.shape[1]))
    whole[:, active] = reduced
    return whole


def _residual(rows: Rows, parameters: FloatArray) -> FloatArray:
    return np.where(rows.used, rows.torque - rows.columns @ parameters, np.nan)
