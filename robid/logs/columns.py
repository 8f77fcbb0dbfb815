"""Reads a log's channels and checks each for itself."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robid.arrays import BoolArray
from robid.errors import DataError
from robid.logs.formats.load import load_variables
from robid.logs.formats.variables import LARGEST, Origin, Variables, find_variable, measurable, series_of, tell_format
from robid.logs.mapping import Columns, LogMapping, Stream
from robid.logs.repeats import at_own_rate
from robid.logs.streams import (
    NoSumError,
    UnknownNameError,
    apart_without_time,
    is_of_other_topic,
    is_table,
    jump_notes,
    may_be_sum,
    may_be_time,
    on_time_of_log,
    own_times,
    parse_sum,
    signed,
    time_before,
    times_of_groups,
    topic_of,
    topic_time,
    unwrapped,
)
from robid.logs.timing import going_on
from robid.signals.log_channels import LogChannel, OutputChannel
from robid.signals.log_options import TIME_UNITS
from robid.signals.record import Record

_SHOWN = 8  # fewest samples of a variable that is offered as a channel, and a quarter of the names that a message lists
# A mark of missing values: ranges of all others by which it lies beyond them, share of the samples, and how many
# numbers there are of others at least; a command of few levels has fewer
_FAR, _MOST_MARKED, _MOVING = 10.0, 0.05, 20
_DAY_NS = 86_400 * 10**9
_SMALL = 1 << 27  # MAT files up to this size are read whole to suggest a name [bytes]
# Ranges of all others by which a lone sample must lie beyond them to be refused; no sensor resolves as much
_ABSURD = 1e6


@dataclass
class Read:
    """What was read of the logs of a recording."""

    streams: list[Stream]  # The variables of the channels
    stamps: NDArray[Any] | None  # (n_sample,) The log's own time, in its unit; None where it has none that can be read
    problems: list[DataError]  # What is wrong with any of them
    notes: list[str]  # What to say about them
    beside: NDArray[Any] | None = None  # The time stamps of a time that is a channel itself; None where it has none
    origin: Origin | None = None  # The moment from which the log's own time counts; None where it is not known


def read_columns(mapping: LogMapping) -> Read:
    """Reads every variable that the mapping names from its log, with every problem on the way.

    The values themselves are looked at by `check_values`.
    """
    found = Read([], None, [], [])
    channels = {channel.column: channel for channel in mapping.channels}
    named: dict[Path, list[str]] = {}
    for column, (path, variable) in mapping.variables.items():
        named.setdefault(path, []).append(variable)
        if column in channels:
            named[path] += own_times(mapping, channels[column], path, variable)
    times = apart_without_time(mapping)
    if mapping.time is not None:
        named.setdefault(mapping.file, []).append(f"{mapping.time.variable}.time")
    named[mapping.file] = [*named.get(mapping.file, []), *times]
    logs = {path: load_variables(path, mapping.format, names, mapping.dialect) for path, names in named.items()}
    untimed: list[DataError] = []
    if mapping.time is not None and (time := mapping.time.variable) not in channels:
        found.beside = logs[mapping.file].get(f"{time}.time")
        found.stamps, untimed = read_column(mapping, logs[mapping.file], time, time)
        found.origin = logs[mapping.file].origin(time)
    for column, channel in channels.items():
        _read_channel(mapping, channel, logs[mapping.variables[column][0]], found)
    found.problems += untimed
    times, variables = _times_before(mapping, logs[mapping.file]) if not times else (times, logs[mapping.file])
    untold = _untold_clocks(mapping, variables, times)
    if untold:
        return replace(found, streams=[], problems=[*found.problems, *untold])
    return _in_order(mapping, found)


def _in_order(mapping: LogMapping, found: Read) -> Read:
    """The same in the order of time, where a log was written newest first or its time begins again; see `repeats`."""
    found = _going_on(mapping, found)

    def turned(stamps: NDArray[Any] | None) -> bool:
        if stamps is None or len(stamps) < 2 or not np.all(np.isfinite(stamps)):
            return False
        return bool(np.all(stamps[1:] < stamps[:-1]))  # unsigned ones have no differences below zero

    own = turned(found.stamps)
    streams, told = [], dict.fromkeys([mapping.file.name] * own)
    for one in found.streams:
        alike = own and one.stamps is None and found.stamps is not None and len(one.values) == len(found.stamps)
        if not (alike or turned(one.stamps)):
            streams.append(one)
            continue
        streams.append(replace(one, values=one.values[::-1], stamps=None if one.stamps is None else one.stamps[::-1]))
        told |= dict.fromkeys([mapping.variables[one.column][0].name])
    notes = [f"{name}: its rows stand newest first; they were put in the order of time." for name in told]
    stamps = found.stamps[::-1] if own and found.stamps is not None else found.stamps
    streams, slow = at_own_rate(mapping, streams, stamps)
    return replace(found, streams=streams, stamps=stamps, notes=[*found.notes, *notes, *slow])


def _going_on(mapping: LogMapping, found: Read) -> Read:
    """The same with times that go on where a counter or a time of day began again."""
    told: dict[str, None] = {}

    def whole(name: str, stamps: NDArray[Any] | None) -> NDArray[Any] | None:
        made, size = (stamps, 0.0) if stamps is None else going_on(stamps)
        told.update(
            {} if not size else {f"{mapping.file.name}: the time `{name}` begins again after {size:.10g}": None}
        )
        return made

    streams = [replace(one, stamps=whole(one.clock, one.stamps)) for one in found.streams]
    stamps = whole("" if mapping.time is None else mapping.time.variable, found.stamps)
    notes = [f"{one}; its samples were taken to go on." for one in told]
    return replace(found, streams=streams, stamps=stamps, notes=[*found.notes, *notes])


def _read_channel(mapping: LogMapping, channel: LogChannel, variables: Variables, found: Read) -> None:
    """Reads the variable of a channel, or those of which it is the sum, each with its own stamps and without jumps."""
    column = channel.column
    path, _ = mapping.variables[column]
    try:
        weights, variables = _weights(mapping, channel, path, variables)
    except NoSumError as e:
        remedy = "Write a weighted sum of variables, as `a + b` or `0.5*a - 2*b`; names in quotes stand as they are."
        if isinstance(e, UnknownNameError):
            remedy = _which_name(e.name, variables.sizes)
        found.problems.append(
            DataError(f"D037 {str(e)[0].upper()}{str(e)[1:]}.", where=mapping.place(column), remedy=remedy)
        )
        return
    held = getattr(channel, "hold", "zoh") == "zoh" and not isinstance(channel, OutputChannel)
    for name, weight in weights.items():
        values, problems = read_column(mapping, variables, column, name)
        found.problems += problems
        if values is None:
            continue
        stamps, clock, problems = _own_stamps(mapping, channel, path, name, variables)
        later_s = _seconds_later(found.origin, variables.origin(clock) if clock else None)
        if stamps is not None and not later_s and found.beside is not None and np.array_equal(stamps, found.beside):
            stamps, clock = None, ""  # sample by sample they belong together with those of the log's own time
        elif stamps is not None:
            times = on_time_of_log(stamps, found.beside, found.stamps) if clock == f"{name}.time" else None
            stamps = _in_unit_of_time(mapping, stamps, variables.units.get(clock, "")) if times is None else times
        if stamps is not None and later_s and mapping.time is not None:
            stamps = stamps + later_s / mapping.time.to_seconds
        found.problems += problems
        if channel.unwraps and not channel.problems() and values.dtype.kind in "fiu":
            finite = values[np.isfinite(values)].astype(float)
            wrap = channel.wrap(float(np.ptp(finite)) if len(finite) else 0.0)
            values, jumps = (unwrapped if channel.goes_on else signed)(values, wrap)
            found.notes += jump_notes(channel, name, wrap, jumps)
        found.streams.append(Stream(column, name, weight, values, stamps, clock, held))


def _weights(
    mapping: LogMapping, channel: LogChannel, path: Path, variables: Variables
) -> tuple[dict[str, float], Variables]:
    """The variables of a channel with their weights, and the log with them.

    Raises:
        NoSumError: If it is a sum that cannot be read.
    """
    name = channel.variable
    try:
        find_variable(variables, name)
    except DataError:
        return {name: 1.0}, variables
    except KeyError:
        if not may_be_sum(name):
            return {name: 1.0}, variables
    else:
        return {name: 1.0}, variables
    known = [*variables.sizes, *variables.unreadable]
    try:
        weights = parse_sum(name, known).weights
    except UnknownNameError:
        if not any(one in name for one in known):
            return {name: 1.0}, variables  # nothing in it is the log's: it is a name that is wrong
        raise
    wanted = [*weights, *(time for one in weights for time in own_times(mapping, channel, path, one))]
    return weights, _loaded(mapping, path, wanted)


def _own_stamps(
    mapping: LogMapping, channel: LogChannel, path: Path, name: str, variables: Variables
) -> tuple[NDArray[Any] | None, str, list[DataError]]:
    """The time stamps that a variable has of its own, and which variable holds them."""
    for time in own_times(mapping, channel, path, name):
        if channel.time is not None:
            stamps, problems = read_column(mapping, variables, channel.column, time)
            return stamps, time, problems
        try:
            stamps = np.asarray(find_variable(variables, time))
        except (KeyError, DataError):
            continue
        if may_be_time(time, stamps):
            return stamps, time, []
    behind = _behind_other_time(mapping, path, name, variables)
    if behind:
        stamps, problems = read_column(mapping, _loaded(mapping, path, [behind]), channel.column, behind)
        rises = stamps is not None and np.all(np.isfinite(stamps)) and np.all(np.diff(stamps) >= 0)
        return (stamps, behind, problems) if rises else (None, "", [])
    if is_of_other_topic(mapping, path, name):
        what = (
            f"D038 Its messages have no `{topic_time(mapping)}`, by which they could be brought to the clock of the "
            "others."
        )
        remedy = f'Set time to {{variable: "{topic_of(name)}.log_time"}}.'
        return None, "", [DataError(what, where=f"{path}: variable `{name}`", remedy=remedy)]
    return None, "", []


def _loaded(mapping: LogMapping, path: Path, names: Sequence[str]) -> Variables:
    return load_variables(path, mapping.format, names, mapping.dialect)


def _behind_other_time(mapping: LogMapping, path: Path, name: str, variables: Variables) -> str:
    """The time of the group of a table's columns that a variable stands in, where the log's own is another one's."""
    if mapping.time is None or path != mapping.file or not is_table(path, mapping.format):
        return ""
    names = list(variables.sizes)
    found = time_before(names, name)
    return found if found != mapping.time.variable and mapping.time.variable in times_of_groups(names) else ""


def _seconds_later(first: Origin | None, other: Origin | None) -> float:
    """How much later another time's moment zero is than the log's own; 0 where the two cannot be compared [s]."""
    if first is None or other is None or first[0] != other[0]:
        return 0.0
    apart_ns = other[1] - first[1]
    if first[0] == "midnight":
        apart_ns = (apart_ns + _DAY_NS // 2) % _DAY_NS - _DAY_NS // 2  # recordings of one test may pass it
    return 1e-9 * apart_ns


def _in_unit_of_time(mapping: LogMapping, stamps: NDArray[Any], unit: str) -> NDArray[Any]:
    """Time stamps in the unit of the log's own time, where the log states theirs."""
    if mapping.time is None or unit not in TIME_UNITS or TIME_UNITS[unit] == mapping.time.to_seconds:
        return stamps
    return np.asarray(stamps * (TIME_UNITS[unit] / mapping.time.to_seconds))


def _times_before(mapping: LogMapping, variables: Variables) -> tuple[list[str], Variables]:
    """The times of the groups of a table's columns that channels stand in, where the log's own is not stated."""
    if mapping.time is not None or not is_table(mapping.file, mapping.format):
        return [], variables
    own = [variable for path, variable in mapping.variables.values() if path == mapping.file]
    found = [time_before(list(variables.sizes), name) for name in own]
    times = [one for one in dict.fromkeys(found) if one]
    return (times, _loaded(mapping, mapping.file, times)) if len(times) > 1 else ([], variables)


def _untold_clocks(mapping: LogMapping, variables: Variables, times: Sequence[str]) -> list[DataError]:
    """Refuses a log without `time` whose channels were sampled by clocks of their own."""
    stamps = {}
    for time in times:
        with suppress(KeyError, DataError):
            stamps[time] = np.asarray(find_variable(variables, time))
    first, *others = stamps or [""]
    other = next((one for one in others if not np.array_equal(stamps[one], stamps[first])), "")
    if not other:
        return []
    what = f"D039 Its channels have clocks of their own, as `{first}` and `{other}` show."
    remedy = f'Set time to {{variable: "{first}"}}: all channels are then brought to one clock.'
    return [DataError(what, where=str(mapping.file), remedy=remedy)]


def read_column(
    mapping: LogMapping, variables: Variables, column: str, variable: str
) -> tuple[NDArray[Any] | None, list[DataError]]:
    """Returns a variable of a column as real numbers, or why it is none."""
    where = f"{mapping.variables[column][0]}: variable `{variable}`"
    try:
        raw = np.asarray(find_variable(variables, variable))
    except KeyError:
        remedy = _which_name(variable, _every_size(mapping, column, variables))
        return None, [DataError("D040 The log has no such variable.", where=where, remedy=remedy)]
    except DataError as error:
        return None, [DataError(error.what, where=where, remedy=error.remedy)]
    if raw.dtype.kind not in "fiu":
        remedy = "Save it as a real numeric column."
        return None, [DataError(f"D041 It contains {raw.dtype} values, not real numbers.", where=where, remedy=remedy)]
    if raw.size != max(raw.shape, default=0) or raw.size < 2:
        what = f"D042 It has shape {raw.shape}, not one column."
        return None, [DataError(what, where=where, remedy=_which_series(variable, raw))]
    return raw.ravel(), []


def _which_name(name: str, sizes: Mapping[str, int]) -> str:
    """Names the variables that may have been meant, and those that there are."""
    close = difflib.get_close_matches(name, sizes, n=3, cutoff=0.5)
    columns = [key for key, size in sizes.items() if size > _SHOWN]
    guess = f"Did you mean {' or '.join(f'`{key}`' for key in close)}?" if close else "Correct the name."
    return f"{guess} The log contains {', '.join(columns[: 4 * _SHOWN])}."


def _which_series(variable: str, matrix: NDArray[Any]) -> str:
    series = series_of(matrix.shape) if matrix.size else []
    if matrix.ndim < 2 or len(series) < 2 or max(matrix.shape) <= _SHOWN:
        return "Save one column per channel."
    return f"Name one of them, `{variable}{series[0]}` to `{variable}{series[-1]}`."


def check_values(mapping: LogMapping, columns: Columns, first: int = 0, remedy: str = "") -> list[DataError]:
    """Finds columns with values that are none, and channels that never change.

    A channel that never changes cannot have been excited; in one shot its joint may have stood still, and of several
    commands one may be given after the other. Of the time its own checks tell.

    Args:
        mapping: The log mapping.
        columns: The samples of each column that are used.
        first: The sample of the log that is their first.
        remedy: What to do about missing values; to cut the log unless told.
    """
    problems = []
    time = None if mapping.time is None else mapping.time.variable
    for name, column in columns.items():
        where = mapping.place(name)
        none = ~np.isfinite(column)
        wild = none if none.any() else ~measurable(column)
        lone = _absurd_sample(column) if name != time and wild.sum() <= 1 and not none.any() else None
        bad = np.flatnonzero(wild & (lone is None))
        if len(bad):
            at, kind = first + bad[0], "NaN or infinite" if none.any() else f"beyond {LARGEST:g}"
            what = f"D043 {len(bad)} of {len(column)} values are {kind}, the first at sample {at}."
            cut = remedy or "Record again, or cut the log to whole periods without them."
            problems.append(DataError(what, where=f"{where}, sample {at}", remedy=cut))
        elif name != time and np.ptp(column) == 0 and not (mapping.one_shot or mapping.takes_turns):
            check = "Check that the channel was connected and that the variable is the right one."
            problems.append(DataError(f"D044 It is constant ({column[0]:g}).", where=where, remedy=check))
        elif lone is not None:
            what = (
                f"D045 It is {column[lone]:g} for one sample, more than {_ABSURD:g} times the range of all others away."
            )
            read = f"{remedy.removesuffix('.') or 'Record again'}, or copy the log again: it may be damaged."
            problems.append(DataError(what, where=f"{where}, sample {first + lone}", remedy=read))
        elif name != time and (marks := _marks_of_missing(column)).any():
            problems.append(_marked(where, column, marks, first))
    return problems


def _marked(where: str, column: NDArray[Any], marks: BoolArray, first: int) -> DataError:
    at = int(np.flatnonzero(marks)[0])
    what = (
        f"D655 It is exactly {column[at]:g} for {np.count_nonzero(marks)} samples, more than {_FAR:g} times the range"
        " of all others away, as where a recorder marks missing values."
    )
    remedy = "Write NaN or leave these cells empty, or cut the log to a part without them."
    return DataError(what, where=f"{where}, sample {first + at}", remedy=remedy)


def _marks_of_missing(column: NDArray[Any]) -> BoolArray:
    """Which samples (n_sample,) are one number far beyond all others, which move: none of them measures anything."""
    values = column.astype(float)
    for extreme in (values.min(), values.max()):
        marked = values == extreme
        others = values[~marked]
        if not 1 < np.count_nonzero(marked) <= _MOST_MARKED * len(values) or len(np.unique(others)) < _MOVING:
            continue
        beyond = max(float(extreme - others.max()), float(others.min() - extreme))
        if beyond > _FAR * float(np.ptp(others)):
            return np.asarray(marked)
    return np.zeros(len(values), bool)


def _absurd_sample(column: NDArray[Any]) -> int | None:
    """The sample, not at an end, that lies beyond all others by so many times their range that nothing measures it.

    Where others do not change at all, the range tells nothing.
    """
    values = column.astype(float)
    for at in (int(np.argmax(values)), int(np.argmin(values))):
        others = np.delete(values, at)
        low, high = float(others.min()), float(others.max())
        beyond = max(float(values[at]) - high, low - float(values[at]))
        if 0 < at < len(values) - 1 and high > low and beyond / _ABSURD > high - low:
            return at
    return None


def _every_size(mapping: LogMapping, name: str, variables: Variables) -> Mapping[str, int]:
    """Sizes of all variables of a log; only small MAT files are read again for those inside other structures."""
    path, _ = mapping.variables[name]
    if (mapping.format or tell_format(path)) != "mat" or path.stat().st_size > _SMALL:
        return variables.sizes
    return load_variables(path, mapping.format).sizes


def check_motion(mapping: LogMapping, columns: Columns) -> list[DataError]:
    """Refuses a log of commands given one after the other in which nothing moves: no input, or no output."""
    groups: tuple[tuple[str, Sequence[LogChannel]], ...] = (("input", mapping.inputs), ("output", mapping.outputs))
    remedy = "Check that the channels were connected and that their variables are the right ones."
    return [
        DataError(f"D046 No {kind} changes.", where=str(mapping.file), remedy=remedy)
        for kind, channels in groups
        if all(one.column in columns and np.ptp(columns[one.column]) == 0 for one in channels)
    ]


def check_turns(record: Record, where: str) -> None:
    """Refuses the joined record of a block in which a channel moves in no experiment.

    Raises:
        DataError: If there is one.
    """
    sides = ((record.inputs, record.input_names), (record.outputs, record.output_names))
    still = [
        name
        for x, names in sides
        for name, size in zip(names, np.ptp(x, axis=(0, 1, 2, 3, 4)), strict=True)
        if not size
    ]
    if still:
        remedy = "Add an experiment that moves them, or leave these channels out."
        raise DataError(f"D047 No experiment moves {', '.join(still)}.", where=where, remedy=remedy)


def check_lengths(mapping: LogMapping, columns: Columns) -> list[DataError]:
    """Compares the channels' lengths; the most frequent one counts as right."""
    lengths = [len(column) for column in columns.values()]
    usual = max(lengths, key=lengths.count, default=0)
    return [
        DataError(
            f"D048 It has {len(column)} samples, the other channels have {usual}.",
            where=mapping.place(name),
            remedy="Export all channels over the same time span and at the same rate, or state the `time` of each"
            " channel that has one of its own.",
        )
        for name, column in columns.items()
        if len(column) != usual
    ]
