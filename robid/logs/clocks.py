"""Brings channels that were sampled by clocks of their own to one: by their stamps, interpolated, or refused."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dst, idst
from scipy.interpolate import make_interp_spline

from robid.arrays import BoolArray, FloatArray, IntArray
from robid.errors import DataError
from robid.logs.arrival import bunched
from robid.logs.bridging import fill_gaps, interpolation_error
from robid.logs.mapping import LogMapping, Stream
from robid.logs.pace import GAP, Pace, measure_pace
from robid.logs.restamping import restamped
from robid.logs.timing import UNSURE, Clock

_DEGREE = 7  # degree of the interpolating spline
# Points per sample of evenly spaced ones on which the spline stands: what it adds then lies far above their band
_FINER = 4
_EVEN = 1e-5  # part of a step by which an instant may be beside a sample and be its
_JITTER = 5e-3  # steps by which evenly spaced samples may be off their line: numbers of seconds since 1970 are no finer
_MARGIN = 32  # samples at the ends of what does not repeat that are left out where it is interpolated
_WHOLE = 1e-4  # relative distance of a period from whole samples up to which it continues them
# Share of the places without a value, up to which time may be missing there where the rows are those of others
_OWN_ROWS = 0.1
_PLACES = 10  # places without a value from which rows are told to be those of others
_RATE = 1e-3  # relative difference of rates that are meant to be the same, or multiples
_LOOSE = 0.1  # part of a step by which rounded stamps may leave open where samples lie between those of others
_SAME = 1e-3  # part of a step by which stamps may differ and be the same


@dataclass(frozen=True)
class Log:
    """The columns of a log, all of one clock, and its own time where it has one that can be read."""

    columns: dict[str, NDArray[Any]]  # The columns, the time's in its unit
    notes: list[str] = field(default_factory=list)  # What to say about them
    # The variable with the longest sampling period of those that were brought to a shorter one; empty for none
    slow: str = ""
    slow_s: float = 0.0  # That sampling period [s]
    ends: str = ""  # What ends before the others, by more than a sample, and when; empty for nothing
    clock: Clock | None = None  # The log's own time

    @property
    def n_sample(self) -> int:
        """Samples of the shortest column."""
        return min((len(column) for column in self.columns.values()), default=0)


@dataclass(frozen=True, eq=False)
class _Timed:
    """A variable with the times of its samples [s], and how these advance."""

    stream: Stream
    pace: Pace
    times: FloatArray
    lost: int = 0  # Samples of it that were lost, and are interpolated


def on_one_clock(
    mapping: LogMapping, streams: Sequence[Stream], stamps: NDArray[Any] | None, period_s: float | None = None
) -> tuple[Log, list[DataError]]:
    """Brings the variables of a log's channels to one clock and adds up those that are sums.

    Where all share their samples nothing is done. Where a row of a table holds some of them only, each is read at its
    own rows. The clock is the first input's, or, where others are faster, as fast as these: a torque that is held is
    never moved between the instants at which it was set.

    `stamps` (n_sample,) are the log's own time, in its unit; what repeats does so with `period_s` [s].

    Returns:
        The columns, and what is wrong with any of them.
    """
    placed = [own_rows(one, stamps) for one in streams]
    told: list[str] = []
    if stamps is not None and mapping.time is not None:
        placed, stamps, told = restamped(mapping, placed, stamps)
    if stamps is None or mapping.time is None:
        interleaved = _interleaved(mapping, placed)
        columns, problems = _summed(mapping, [one for one in placed if one.column not in interleaved])
        return Log(columns), [*interleaved.values(), *problems]
    if all(one.stamps is None or np.array_equal(one.stamps, stamps) for one in placed):
        columns, problems = _summed(mapping, placed)
        return Log({**columns, mapping.time.variable: stamps}, told), problems
    problems = []
    timed: list[_Timed] = []
    for one in placed:
        clock, found = _timed(mapping, one, stamps)
        problems += found
        timed += [] if clock is None else [clock]
    if problems or not timed:
        return Log({}), problems
    joined, problems = _brought(mapping, timed, stamps, period_s)
    return replace(joined, notes=[*told, *joined.notes]), problems


def own_rows(stream: Stream, stamps: NDArray[Any] | None) -> Stream:
    """Returns a variable at its own rows, where the others are those of others: time goes on evenly without them."""
    own = stamps if stream.stamps is None else stream.stamps
    if own is None or len(own) != len(stream.values) or stream.values.dtype.kind != "f":
        return stream
    missing = ~np.isfinite(stream.values) | ~np.isfinite(own)
    kept = ~missing
    places = np.count_nonzero(np.diff(missing[np.argmax(kept) :].astype(np.int8)) > 0) if kept.any() else 0
    if places < 1 or np.count_nonzero(kept) < _PLACES:
        return stream
    pace = measure_pace(_apart(own[kept], own[kept][0]))
    if pace is None or len(pace.gaps) > _OWN_ROWS * places:
        return stream
    return replace(stream, values=stream.values[kept], stamps=own[kept], clock=stream.clock or "its own rows")


def _interleaved(mapping: LogMapping, streams: Sequence[Stream]) -> dict[str, DataError]:
    """Refuses columns of a table without `time` whose rows hold some of the channels each."""
    problems: dict[str, DataError] = {}
    for one in streams:
        if one.values.dtype.kind != "f":
            continue
        missing = ~np.isfinite(one.values)
        places = int(np.count_nonzero(np.diff(missing.astype(np.int8)) > 0))
        if places >= _PLACES and missing.mean() > 1 / _PLACES:
            what = (
                f"D031 {np.count_nonzero(missing)} of {len(missing)} rows hold no value of `{one.name}`, in {places}"
                " places: they are those of other channels, which have a clock of their own."
            )
            remedy = "State `time`, the variable of the time stamps: each channel is then read at its own rows."
            problems[one.column] = DataError(what, where=mapping.place(one.column), remedy=remedy)
    return problems


def _summed(mapping: LogMapping, streams: Sequence[Stream]) -> tuple[dict[str, NDArray[Any]], list[DataError]]:
    """The columns of variables that share their samples."""
    columns: dict[str, NDArray[Any]] = {}
    problems = []
    for one in streams:
        values = one.values if one.weight == 1 else one.weight * one.values.astype(float)
        if one.column not in columns:
            columns[one.column] = values
        elif len(columns[one.column]) == len(values):
            columns[one.column] = columns[one.column].astype(float) + values
        else:
            what = f"D032 `{one.name}` has {len(values)} samples, what it is added to has {len(columns[one.column])}."
            remedy = "Add variables that were sampled together, or state `time`, which brings them to one clock."
            problems.append(DataError(what, where=mapping.place(one.column), remedy=remedy))
    return columns, problems


def _apart(stamps: NDArray[Any], origin: Any) -> FloatArray:  # noqa: ANN401
    """Stamps since another one; nanoseconds since 1970 have more digits than a float holds."""
    if stamps.dtype.kind in "iu" and np.asarray(origin).dtype.kind in "iu":
        return np.asarray((stamps.astype(np.int64) - np.int64(origin)).astype(float))
    return np.asarray(stamps.astype(float) - float(origin))


def _timed(mapping: LogMapping, stream: Stream, stamps: NDArray[Any]) -> tuple[_Timed | None, list[DataError]]:
    """A variable with the times of its samples, or why they are not known."""
    where = f"{mapping.place(stream.column)}: clock `{stream.clock}`" if stream.clock else mapping.place(stream.column)
    own = stamps if stream.stamps is None else stream.stamps
    if mapping.time is None or len(own) != len(stream.values):
        what = f"D033 `{stream.name}` has {len(stream.values)} samples, and its time stamps are {len(own)}."
        return None, [DataError(what, where=where, remedy="Name the variable of its own time stamps as its `time`.")]
    known = np.isfinite(stream.values) & np.isfinite(own)
    since = _apart(own, stamps[np.isfinite(stamps)][0]) * mapping.time.to_seconds
    pace = measure_pace(since[known]) if np.count_nonzero(known) > 1 else None
    made = None if pace is None else _Timed(stream, pace, since[known][0] + pace.first + pace.times)
    if made is not None and not stream.held:
        made = _filled(made, stream.values[known])
    if pace is None or made is None or not (known.all() or (made.lost and not len(made.pace.gaps))):
        told = "do not advance" if known.all() else f"or its values are missing at {np.count_nonzero(~known)} samples"
        remedy = "Sort the log by time, drop repeated samples, and cut it to a part in which nothing is missing."
        if stream.clock.partition("[")[0].endswith(".header.stamp"):
            remedy = f"Set time.variable to {mapping.time.variable.partition('.')[0]}.log_time, when each was logged."
        return None, [DataError(f"D034 Its time stamps {told}.", where=where, remedy=remedy)]
    if pace.unsure > UNSURE or pace.loose > _LOOSE * pace.step:
        what = (
            f"D035 Its time stamps are rounded to {pace.rounding:.4g} s: they do not tell to better than"
            f" {max(pace.loose, pace.unsure * pace.step):.2g} s where its samples lie between those of other clocks."
        )
        remedy = "Log finer stamps, or take all channels from what was sampled together."
        return None, [DataError(what, where=where, remedy=remedy)]
    told = bunched(made.times, pace.step)
    if told and not stream.held:
        remedy = "Log the time at which samples are taken, or take all channels from what was logged together."
        return None, [DataError(told, where=where, remedy=remedy)]
    return made, []


def _filled(one: _Timed, values: NDArray[Any]) -> _Timed:
    """A variable, of those of its values (n_sample,) that are known, with samples in the gaps that these tell."""
    times, made, left = fill_gaps(one.times, values.astype(float), one.pace.step, one.pace.gaps)
    lost = len(times) - len(one.times)
    if not lost:
        return one
    return replace(
        one, stream=replace(one.stream, values=made), pace=replace(one.pace, gaps=left), times=times, lost=lost
    )


def _brought(
    mapping: LogMapping, timed: list[_Timed], stamps: NDArray[Any], period_s: float | None
) -> tuple[Log, list[DataError]]:
    """The columns at the instants of one clock."""
    first = mapping.inputs[0].column
    leading = next((one for one in timed if one.stream.column == first), timed[0])
    grid = _grid(leading, timed)
    step = float(np.median(np.diff(grid)))
    beyond = [_beyond(one, step, period_s) for one in timed]
    low = max(one.times[0] - further for one, further in zip(timed, beyond, strict=True))
    high = min(one.times[-1] + further for one, further in zip(timed, beyond, strict=True))
    grid = grid[(grid >= low - _SAME * step) & (grid <= high + _SAME * step)]
    for one in timed:
        grid = grid[_covered(one, grid, step, period_s)]
    if len(grid) <= _DEGREE:
        spans = "; ".join(f"`{one.stream.name}` from {one.times[0]:.6g} s to {one.times[-1]:.6g} s" for one in timed)
        what = f"D036 Its channels were hardly sampled at the same time: {spans}, by their own time stamps."
        remedy = "Check the variables and the unit of the time stamps, and that all count from one moment."
        return Log({}), [DataError(what, where=str(mapping.file), remedy=remedy)]
    columns: dict[str, NDArray[Any]] = {}
    notes: dict[str, str] = {}
    slowest = max((one for one in timed if not _is_held(one, step)), key=lambda one: one.pace.step, default=leading)
    for one in timed:
        values, error = _at(one, grid, step, period_s)
        columns[one.stream.column] = columns.get(one.stream.column, 0.0) + one.stream.weight * values
        if one.lost:
            told = f"{mapping.file.name}: `{one.stream.name}` lacks {one.lost} samples, which were interpolated."
            notes[f"{one.stream.name} lacks"] = told
        if one.times is not leading.times and not np.array_equal(one.times, leading.times):
            notes.setdefault(one.stream.clock or one.stream.name, _note(mapping, one, leading, error, step))
    if mapping.time is not None:
        origin = float(_apart(stamps[np.isfinite(stamps)][:1], stamps[0])[0]) if np.isfinite(stamps[0]) else 0.0
        columns[mapping.time.variable] = origin + grid / mapping.time.to_seconds
    joined = Log(columns, list(notes.values()), ends=_ends(mapping, timed))
    if slowest.pace.step > GAP * step:
        joined = replace(joined, slow=slowest.stream.name, slow_s=slowest.pace.step)
    return joined, []


def _ends(mapping: LogMapping, timed: Sequence[_Timed]) -> str:
    first, last = (choose(timed, key=lambda one: float(one.times[-1])) for choose in (min, max))
    if last.times[-1] - first.times[-1] <= GAP * max(first.pace.step, last.pace.step):
        return ""
    return f"{mapping.place(first.stream.column)} ends {last.times[-1] - first.times[-1]:.6g} s before others."


def _grid(leading: _Timed, timed: Sequence[_Timed]) -> FloatArray:
    """The instants to bring all to: those of the leading clock, with further ones between where others are faster."""
    fastest = min(timed, key=lambda one: one.pace.step)
    parts = round(leading.pace.step / fastest.pace.step)
    if parts == 1:
        return leading.times
    if abs(leading.pace.step / fastest.pace.step / parts - 1) > _RATE:
        return fastest.times
    step = leading.pace.step / parts
    before = min(max(int((leading.times[0] - fastest.times[0]) / step + _SAME), 0), parts - 1)
    count = int((leading.times[-1] - leading.times[0]) / step * (1 + 1e-9)) + parts
    return np.asarray(leading.times[0] + step * np.arange(-before, count))


def _is_held(one: _Timed, step: float) -> bool:
    """Whether a command stays between its samples, which are farther apart than the instants."""
    return one.stream.held and one.pace.step > GAP * step


def _pieces(one: _Timed) -> list[tuple[int, int]]:
    """First samples of the pieces between gaps, and those after them."""
    edges = np.concatenate([[0], one.pace.gaps + 1, [len(one.times)]])
    return list(pairwise(edges.tolist()))


def _before(one: _Timed, grid: FloatArray, step: float) -> IntArray:
    """The sample at or before each instant."""
    return np.clip(np.searchsorted(one.times, grid + _SAME * step, side="right") - 1, 0, len(one.times) - 1)


def _is_met(one: _Timed, grid: FloatArray, step: float) -> bool:
    before = _before(one, grid, step)
    return bool(np.all((np.abs(one.times[before] - grid) <= _EVEN * step) | np.isin(before, one.pace.gaps)))


def _covered(one: _Timed, grid: FloatArray, step: float, period_s: float | None) -> BoolArray:
    """Which instants lie within a piece of a variable, off its ends where what lies beyond these would have a say."""
    met = _is_held(one, step) or _is_met(one, grid, step)
    sound = np.zeros(len(grid), bool)
    for start, stop in _pieces(one):
        if stop - start <= _DEGREE:
            continue
        margin = 0.0 if met or stop - start < 10 * _MARGIN else _MARGIN * one.pace.step
        repeats, beyond = _repeats(one, period_s), _beyond(one, step, period_s)
        low = one.times[start] + (-beyond if repeats and start == 0 else margin)
        high = one.times[stop - 1] - (-beyond if repeats and stop == len(one.times) else margin)
        sound |= (grid >= low - _SAME * step) & (grid <= high + _SAME * step)
    return sound


def _repeats(one: _Timed, period_s: float | None) -> int:
    """Samples of a period, where it is whole ones; else 0."""
    count = 0 if period_s is None else round(period_s / one.pace.step)
    whole = count > 0 and abs(count * one.pace.step / (period_s or 1.0) - 1) < _WHOLE
    return count if whole and len(one.times) > count + _DEGREE else 0


def _beyond(one: _Timed, step: float, period_s: float | None) -> float:
    """How far beyond its ends a variable is known by its period [s]: to where its next sample would be."""
    return max(one.pace.step - step, 0.0) if _repeats(one, period_s) and not one.stream.held else 0.0


def _at(one: _Timed, grid: FloatArray, step: float, period_s: float | None) -> tuple[FloatArray, float]:
    """A variable at some instants, and the relative error of its interpolation."""
    values = one.stream.values.astype(float)
    before = _before(one, grid, step)
    if _is_held(one, step) or _is_met(one, grid, step):
        return values[before], 0.0
    made, error = np.zeros(len(grid)), 0.0
    for start, stop in _pieces(one):
        inside = (before >= start) & (before < stop)
        if not inside.any():
            continue
        count = _repeats(one, period_s) if stop - start == len(values) else 0
        made[inside], own = interpolated(one.times[start:stop], values[start:stop], grid[inside], count)
        error = max(error, own)
    return made, error


def interpolated(
    times: FloatArray, values: FloatArray, wanted: FloatArray, period: int = 0
) -> tuple[FloatArray, float]:
    """Returns samples at other instants, and the relative error that this makes.

    Evenly spaced ones are continued at both ends, by their period or else oddly, and written as sines, whose sum is the
    same at the samples and can be had at finer steps: the spline between these then sees nothing near half their rate.

    `times` (n_sample,) are those of `values`, `wanted` (n_wanted,) the instants; `period` in samples, 0 for none.
    """
    if np.ptp(values) == 0:
        return np.full(len(wanted), values[0]), 0.0
    index = np.arange(float(len(times)))
    line = np.polynomial.Polynomial.fit(index, times, 1).convert()
    origin, step = float(line.coef[0]), float(line.coef[1])
    at = (wanted - origin) / step
    if np.abs(times - line(index)).max() > _JITTER * step:
        curve = make_interp_spline((times - origin) / step, values, k=_DEGREE)
        return np.asarray(curve(at)), interpolation_error(values)
    if period:
        values, beyond = _continued(values, period)
        at += beyond
    slope = np.linspace(values[0], values[-1], len(values))
    waves = dst((values - slope)[1:-1], type=1)
    count = _FINER * (len(values) - 1)
    finer = _FINER * idst(np.pad(waves, (0, count - 1 - len(waves))), type=1)
    finer = np.concatenate([[0.0], finer, [0.0]]) + np.linspace(slope[0], slope[-1], count + 1)
    curve = make_interp_spline(np.arange(count + 1) / _FINER, finer, k=_DEGREE)
    return np.asarray(curve(at)), interpolation_error(finer)


def _continued(values: FloatArray, period: int) -> tuple[FloatArray, int]:
    """Samples with what their period puts before and after them, and how many before."""
    count = min(period, len(values) - period)
    drift = float(np.mean(values[period : period + count] - values[:count]))
    before, after = values[period - count : period] - drift, values[-period : len(values) - period + count] + drift
    return np.concatenate([before, values, after]), count


def _note(mapping: LogMapping, one: _Timed, leading: _Timed, error: float, step: float) -> str:
    near = np.clip(np.searchsorted(one.times, leading.times, side="right") - 1, 0, len(one.times) - 1)
    late = float(np.median(leading.times - one.times[near]))
    rate = f"every {one.pace.step:.6g} s" if abs(one.pace.step / leading.pace.step - 1) > _RATE else ""
    lag = f"{late:.4g} s before those of `{leading.stream.name}`"
    told = " and ".join(part for part in (rate, lag) if part)
    told = f"{mapping.file.name}: `{one.stream.name}` was sampled by a clock of its own, {told}"
    if _is_held(one, step):
        return f"{told}: it was constant from sample to sample."
    share = f"with errors of {100 * error:.2g} % of the channel at most"
    return f"{told}: it was interpolated at that one's instants, {share}."
