"""Which part of a log is used, and what to set for the longest one in which nothing is missing."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robid.arrays import BoolArray, FloatArray
from robid.errors import DataError
from robid.logs.bridging import longest_bridged
from robid.logs.formats.variables import measurable
from robid.logs.mapping import Columns, LogMapping, Stated, set_all
from robid.logs.pace import GAP, longest_piece
from robid.logs.timing import since_first

_ROUNDING = 1e-3  # time steps by which a limit may miss a sample and still holds it
_MARGIN = 0.4  # share of a time step by which the limits of a part may lie beyond it
_FEWEST = 8  # samples from which a piece is worth naming


def chosen_part(mapping: LogMapping, columns: Columns) -> slice:
    """Returns the samples from `from_s` to `to_s`, all of them where neither is stated.

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
    what = f"D111 It lasts {time[-1]:.6g} s: from {mapping.from_s:g} s to {end} it has {max(stop - start, 0)} samples."
    raise DataError(what, where=str(mapping.file), remedy=f"State from_s and to_s within 0 and {time[-1]:.6g}.")


def part_notes(mapping: LogMapping, columns: Columns, part: slice) -> list[str]:
    """Says which part of a log is used, where not all of it is; and that it ends before its stated limit."""
    if part == slice(None):
        return []
    last_s, until = float(_seconds(mapping, columns)[-1]), "its end"
    if mapping.to_s is not None:
        ends_before = last_s + mapping.sampling_period_s < mapping.to_s
        until = f"its end at {last_s:.6g} s, before {mapping.to_s:g} s" if ends_before else f"{mapping.to_s:g} s"
    return [f"{mapping.file.name}: used from {mapping.from_s:g} s to {until}, samples {part.start} to {part.stop - 1}."]


def followed_across(mapping: LogMapping, columns: Columns, part: slice) -> float:
    """Returns the longest step between rows in which nothing is missing that interpolation follows the channels across.

    [s]; 0 where nothing is missing, or no time says where.
    """
    time = _seconds(mapping, columns)
    rows = np.flatnonzero(_are_whole(columns, time)[part]) + (part.start or 0)
    steps = np.diff(time[rows])
    if mapping.time is None or len(rows) < _FEWEST or steps.min() <= 0:
        return 0.0
    usual = float(np.median(steps))
    if steps.max() <= GAP * usual:
        return 0.0
    channels = [np.asarray(one[rows], float) for name, one in columns.items() if name != mapping.time.variable]
    return longest_bridged(time[rows], channels, usual)


def without_missing(mapping: LogMapping, columns: Columns, followed_s: float) -> tuple[dict[str, NDArray[Any]], int]:
    """Leaves out rows in which values are missing where interpolation follows the channels across them.

    Returns:
        The columns, and how many rows were left out.
    """
    time = _seconds(mapping, columns)
    rows = _are_whole(columns, time)
    missing = len(rows) - int(np.count_nonzero(rows))
    if not followed_s or not missing or np.diff(time[rows]).max() > followed_s:
        return dict(columns), 0
    return {name: one[: len(rows)][rows] for name, one in columns.items()}, missing


def _are_whole(columns: Columns, time: FloatArray) -> BoolArray:
    """Which rows have a value in each column."""
    told = [measurable(column[: len(time)]) for column in columns.values() if column.dtype.kind == "f"]
    return np.asarray(np.logical_and.reduce([np.isfinite(time), *told]))


def whole_piece(
    mapping: LogMapping, columns: Columns, part: slice, stated: Stated | None = None, followed_s: float = 0.0
) -> str:
    """Says what to set for the longest part of a log, within one, that has no gap and no missing value.

    Steps up to one across which interpolation follows the channels are no gaps [s].

    Returns:
        The remedy, with the periods that it then holds; empty where no part is long enough, or nothing is missing.
    """
    time = _seconds(mapping, columns)
    first, stop, _ = part.indices(len(time))
    if stop - first < _FEWEST:
        return ""
    rows = np.flatnonzero(_are_whole(columns, time)[part]) + first
    gap = GAP * float(np.nanmedian(np.diff(time)))
    steps = np.diff(time[rows])
    low, high = longest_piece(np.flatnonzero(steps > max(gap, followed_s)), len(rows))
    if high - low <= _FEWEST:
        return ""
    begin, end = int(rows[low]), int(rows[high - 1])
    filled = bool(np.any(steps[low : high - 1] > gap))
    follow = {"resample": "time"} if filled and mapping.resample is None else {}
    if begin <= first and end >= stop - 1:
        return f"{set_all(follow)[:-1]}: interpolation fills the gaps." if follow else ""
    from_s, to_s = limits_of(time, begin, end)
    ends = {"from_s": f"{from_s:.12g}", "to_s": f"{to_s:.12g}", **follow}
    # Where references say where periods begin, these say how many there are.
    settings: dict[str, str] | None = ends
    if stated is not None and not mapping.references:
        settings = _with_periods(ends, end + 1 - begin, stated, from_start=begin <= first)
    if settings is None:
        return "Record again: no whole period lies where nothing is missing."
    which = "whose gaps interpolation fills" if filled else "in which nothing is missing"
    return f"{set_all(settings)[:-1]}: the longest part {which}."


def _with_periods(ends: dict[str, str], n_sample: int, stated: Stated, *, from_start: bool) -> dict[str, str] | None:
    """Adds how many periods a part of a log holds, where that differs from what was said; None if it holds none."""
    held = n_sample // stated.samples
    dropped = stated.dropped if from_start and held > stated.dropped else 0
    if held - dropped < 1:
        return None
    other = {"drop_periods": f"{dropped}"} if dropped != stated.dropped else {}
    fewer = {"periods": f"{held - dropped}"} if held - dropped < stated.periods else {}
    return ends | other | fewer


def limits_of(time: FloatArray, first: int, last: int) -> tuple[float, float]:
    """Returns numbers with few digits between which samples of a time (n_sample,) lie, from one to a later one [s]."""
    low = _between(time[first] - _MARGIN * (time[first + 1] - time[first]), time[first])
    return low, _between(time[last], time[last] + _MARGIN * (time[last] - time[last - 1]))


def _seconds(mapping: LogMapping, columns: Columns) -> FloatArray:
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
