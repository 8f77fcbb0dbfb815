"""Rows of a log that stand out of order or twice, as networks deliver them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robid.arrays import IntArray
from robid.logs.pace import measure_pace
from robid.logs.timing import since_first

_FAR = 100  # rows by which one may stand out of its place: farther away another recording begins
_MOST = 0.05  # share of the rows up to which some are repeated or out of place


def rows_in_order(stamps: NDArray[Any], signals: Sequence[NDArray[Any]]) -> IntArray | None:
    """Returns which rows to keep, in the order of their time, where some stand out of order or are repeated.

    A row is repeated where its time and all of its signals are those of another one.

    Args:
        stamps (n_row,): Their time.
        signals (n_row,): What they hold besides.

    Returns:
        The rows (n_kept,); None where all are in order, or where it is no matter of single rows.
    """
    if len(stamps) < 2 or not np.all(np.isfinite(stamps)) or not np.any(stamps[1:] <= stamps[:-1]):
        return None
    if measure_pace(since_first(stamps)) is not None:
        return None  # rounded ones may repeat
    order = np.argsort(stamps, kind="stable")
    moved = order - np.arange(len(order))
    if np.abs(moved).max() > _FAR:
        return None
    repeated = np.concatenate([[False], np.diff(stamps[order]) == 0])
    at = np.flatnonzero(repeated)
    if not all(_are_equal(one[order[at]], one[order[at - 1]]) for one in signals):
        return None
    kept = order[~repeated]
    # Of rows that stand too late those between are moved by one each.
    displaced = np.count_nonzero(np.diff(order) != 1)
    if len(at) + displaced / 2 > _MOST * len(order):
        return None
    paced = measure_pace(since_first(stamps[kept])) is not None
    return kept if paced else None


def _are_equal(first: NDArray[Any], second: NDArray[Any]) -> bool:
    return bool(np.array_equal(first, second, equal_nan=first.dtype.kind == "f"))
