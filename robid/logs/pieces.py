"""Which part of a log is used, and the longest one in which nothing is missing."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.logs.mapping import LogMapping
from robid.logs.pace import GAP
from robid.logs.stated import Stated, set_all
from robid.logs.timing import since_first

_ROUNDING = 1e-3
"""Time steps by which a limit may miss a sample and still holds it."""

_MARGIN = 0.4
"""Share of a time step by which the limits of a part may lie beyond it."""

_FEWEST = 8
"""Samples from which a piece is worth naming."""


def chosen_part(mapping: LogMapping, columns: Mapping[str, NDArray[Any]]) -> slice:
    """Returns the samples from `from_s` to `to_s`, all of them where neither is stated.

    Args:
        mapping: The log mapping.
        columns: Columns of the log, as they were read.

    Raises:
        DataError: If hardly any sample lies there.
    """
    time = _seconds(mapping, columns) if mapping.is_cut else np.zeros(0)
    if not len(time):
        return slice(None)
    rounding = _ROUNDING * mapping.sampling_period_s
    stop = len(time) if mapping.to_s is None else int(np.searchsorted(time, mapping.to_s + rounding))
    start = int(np.searchsorted(time, mapping.from_s - rounding))
    if stop - start >= 2:
        return slice(start, stop)
    end = "its end" if mapping.to_s is None else f"{mapping.to_s:g} s"
    what = f"It lasts {time[-1]:.6g} s: from {mapping.from_s:g} s to {end} it has {max(stop - start, 0)} samples."
    raise DataError(what, where=str(mapping.file), remedy=f"State from_s and to_s within 0 and {time[-1]:.6g}.")


def whole_piece(
    mapping: LogMapping, columns: Mapping[str, NDArray[Any]], part: slice, stated: Stated | None = None
) -> str:
    """Says what to set for the longest part of a log, within one, that has no gap and no missing value.

    Args:
        mapping: The log mapping.
        columns: Columns of the log, as they were read.
        part: The samples among which it is looked for.
        stated: What was said of the period; None where nothing repeats.

    Returns:
        The remedy, with the periods that it then holds; empty where no part is long enough, or nothing is missing.
    """
    time = _seconds(mapping, columns)
    first, stop, _ = part.indices(len(time))
    if stop - first < _FEWEST:
        return ""
    steps = np.diff(time)
    told = [np.isfinite(column[: len(time)]) for column in columns.values() if column.dtype.kind == "f"]
    sound = np.logical_and.reduce([np.isfinite(time), *told])
    whole = np.concatenate([sound[1:] & sound[:-1] & ~(steps > GAP * np.nanmedian(steps)), [False]])
    whole[:first], whole[max(stop - 1, 0) :] = False, False
    edges = np.diff(np.concatenate([[0], whole.astype(np.int8), [0]]))
    starts, stops = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    if not len(starts):
        return ""
    longest = int(np.argmax(stops - starts))
    begin, end = int(starts[longest]), int(stops[longest])
    if end - begin < _FEWEST or (begin <= first and end >= stop - 1):
        return ""
    low, high = limits_of(time, begin, end)
    settings = {"from_s": f"{low:.12g}", "to_s": f"{high:.12g}"}
    # Where references say where periods begin, these say how many there are.
    if stated is not None and not mapping.references:
        held = (end + 1 - begin) // stated.samples
        dropped = stated.dropped if begin <= first and held > stated.dropped else 0
        if held - dropped < 1:
            return "Record again: no whole period lies where nothing is missing."
        if dropped != stated.dropped:
            settings["drop_periods"] = f"{dropped}"
        if held - dropped < stated.periods:
            settings["periods"] = f"{held - dropped}"
    return f"{set_all(settings)[:-1]}: the longest part in which nothing is missing."


def limits_of(time: FloatArray, first: int, last: int) -> tuple[float, float]:
    """Returns numbers with few digits between which, inclusive, the samples from one to another lie.

    Args:
        time (n_sample,): Time of each sample since the first [s].
        first: The first sample that is meant.
        last: The last one, after it.
    """
    low = _between(time[first] - _MARGIN * (time[first + 1] - time[first]), time[first])
    return low, _between(time[last], time[last] + _MARGIN * (time[last] - time[last - 1]))


def _seconds(mapping: LogMapping, columns: Mapping[str, NDArray[Any]]) -> FloatArray:
    """Time of each sample since the first one: the log's own, filled where it is missing, or by the sampling period."""
    count = min((len(column) for column in columns.values()), default=0)
    index = np.arange(count)
    if mapping.time is None or mapping.time.variable not in columns:
        return mapping.sampling_period_s * index
    stamps = columns[mapping.time.variable][:count]
    known = np.isfinite(stamps)
    if not known.any():
        return mapping.sampling_period_s * index
    return np.interp(index, index[known], since_first(stamps[known])) * mapping.time.to_seconds


def _between(low: float, high: float) -> float:
    """The number from one to another that has the fewest digits, not below zero."""
    low = max(low, 0.0)
    for digits in range(12):
        found: float = math.ceil(low * 10**digits) / 10**digits
        if found <= high:
            return found
    return high
