"""Channels that were sampled more slowly than their log has rows: each value stands in several rows.

Read row by row such a channel is late by half of the rows that a value stands in, and aliased.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robid.logs.formats.variables import measurable
from robid.logs.mapping import LogMapping, Stream
from robid.logs.pace import measure_pace
from robid.logs.timing import since_first

_CHANGES = 50  # changes of a value by which its rate is told
_MOVES = 0.6  # share of the rows of its own at which a channel changes, at least
_VARIED = 0.1  # deviation of its steps, relative, in the median: those of an encoder at constant speed are all alike


def rows_of_value(values: NDArray[Any]) -> tuple[int, int]:
    """Returns in how many rows each value (n_sample,) of a channel stands, and the first row of a new one.

    That is told where all of its changes are whole numbers of rows apart and most of these rows have one; else 1 and 0.
    """
    if values.dtype.kind not in "iuf" or len(values) < _CHANGES or not np.all(measurable(values)):
        return 1, 0
    steps = np.diff(values.astype(float))
    changes = np.flatnonzero(steps) + 1
    if len(changes) < _CHANGES:
        return 1, 0
    rows = int(np.gcd.reduce(np.diff(changes)))
    sizes = np.abs(steps[changes - 1])
    is_moving = len(changes) * rows >= _MOVES * (changes[-1] - changes[0])
    usual = float(np.median(sizes))
    is_varied = np.median(np.abs(sizes - usual)) > _VARIED * usual
    return (rows, int(changes[0] % rows)) if is_moving and is_varied else (1, 0)


def at_own_rate(
    mapping: LogMapping, streams: Sequence[Stream], stamps: NDArray[Any] | None
) -> tuple[list[Stream], list[str]]:
    """Returns measured channels with the first row of each value alone, where others of the log were sampled faster.

    A command that is constant over several rows is what the robot got, and stays. Without fine `stamps` (n_sample,) of
    the log nothing can be brought from one rate to another: it is said alone.

    Returns:
        The channels, and what to say about them.
    """
    rates = [rows_of_value(one.values) if one.stamps is None else (1, 0) for one in streams]
    # A command acts in every row; without one, channels that are slower together have nothing to be late for.
    measured = [rows for (rows, _), one in zip(rates, streams, strict=True) if not one.held]
    fastest = 1 if len(measured) < len(streams) else min(measured, default=1)
    pace = measure_pace(since_first(stamps)) if stamps is not None and np.all(np.isfinite(stamps)) else None
    made, notes = [], []
    for one, (rows, first) in zip(streams, rates, strict=True):
        if rows <= fastest or one.held:
            made.append(one)
            continue
        told = (
            f"{mapping.place(one.column)}: each value stands in {rows} rows, as it was sampled more slowly than others"
        )
        if stamps is None or pace is None or pace.rounding or len(stamps) != len(one.values):
            late = f"so that it is late by {(rows - 1) / 2:g} rows"
            notes.append(f"{told}, {late}; state a `time` with fine stamps to have it interpolated.")
            made.append(one)
            continue
        notes.append(f"{told}; only the first of them was taken.")
        values, own = one.values[first::rows], stamps[first::rows]
        made.append(replace(one, values=values, stamps=own, clock=f"every {rows} rows"))
    return made, notes
