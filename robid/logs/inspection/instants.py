"""Samples of a log on the instants of one clock: rows newest first, times that begin again, signals with own clocks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from robid.arrays import FloatArray
from robid.logs.arrival import find_arrivals
from robid.logs.clocks import interpolated, on_one_clock, own_rows
from robid.logs.inspection.contents import Column, Contents
from robid.logs.inspection.names import DRIVING, MOVING, read_name, read_names, unit_of_name
from robid.logs.inspection.sampling import LEAST, LIKELY, is_ramp, rate_of_time
from robid.logs.inspection.vocabulary import tokens
from robid.logs.mapping import LogMapping, Stream
from robid.logs.order import rows_in_order
from robid.logs.repeats import rows_of_value
from robid.logs.streams import is_table, time_before, times_of_groups
from robid.logs.timing import going_on
from robid.signals.log_channels import InputChannel, OutputChannel
from robid.signals.log_options import TIME_UNITS, TimeChannel

_NAMES = ("time", "timestamp", "stamp", "t", "zeit", "sec", "seconds", "clock")
_TIMES = ("header.stamp", "log_time")


def newest_last(contents: Contents) -> Contents:
    """Returns a log in the order of its time: rows that were written newest first are turned around."""
    turned = {
        (one.file, one.group, len(one.values))
        for one in contents.columns
        if len(one.values) >= LEAST
        and np.all(np.diff(one.values) < 0)
        and rate_of_time(replace(one, values=one.values[::-1]), None) >= LIKELY
    }
    if not turned:
        return contents
    columns = (
        replace(one, values=one.values[::-1]) if (one.file, one.group, len(one.values)) in turned else one
        for one in contents.columns
    )
    return replace(contents, columns=tuple(columns), notes=(*contents.notes, "its rows stand newest first"))


def time_going_on(contents: Contents) -> Contents:
    """Returns a log whose times go on where a counter or a time of day began again."""
    columns, notes = [], [*contents.notes]
    for one in contents.columns:
        values, size = going_on(one.values) if len(one.values) >= LEAST else (one.values, 0.0)
        if size and rate_of_time(replace(one, values=values), None) >= LIKELY:
            notes.append(f"the time `{one.name}` begins again after {size:.10g}; its samples are taken to go on.")
            columns.append(replace(one, values=values))
        else:
            columns.append(one)
    return replace(contents, columns=tuple(columns), notes=tuple(notes))


def taken_evenly(contents: Contents, group: Sequence[Column], time: str, unit: str) -> Contents:
    """Returns a log with even times where the stamps of its signals say when these arrived.

    `group` are the signals of one length, `time` is the name of their time, in some unit.
    """
    clock = next(one for one in group if one.name == time)
    hints = read_names(group)
    moving = [one for one, hint in zip(group, hints, strict=True) if hint.role in (*DRIVING, *MOVING)]
    found = find_arrivals(clock.values - clock.values[0], [one.values for one in moving if one is not clock])
    if found is None:
        return contents
    told = (
        f"`{time}` says when samples arrived, up to {found.late * TIME_UNITS[unit]:.2g} s late: they are taken for even"
    )
    even = replace(clock, values=clock.values[0] + found.times)
    columns = tuple(even if one is clock else one for one in contents.columns)
    return replace(contents, columns=columns, notes=(*contents.notes, told))


def in_order(contents: Contents) -> Contents:
    """Returns a log whose single rows that stand out of the order of its time, or twice, are in their place once."""
    groups: dict[tuple[str | None, str, int], list[Column]] = {}
    for one in contents.columns:
        groups.setdefault((None if one.file is None else str(one.file), one.group, len(one.values)), []).append(one)
    placed: dict[int, Column] = {}
    notes = [*contents.notes]
    for members in groups.values():
        times = [one for one in members if len(one.values) >= LEAST and rate_of_time(one, None) >= LIKELY]
        if not times:
            continue
        rows = rows_in_order(times[0].values, [one.values for one in members])
        if rows is None:
            continue
        placed |= {id(one): replace(one, values=one.values[rows]) for one in members}
        repeated, late = len(times[0].values) - len(rows), np.count_nonzero(np.diff(rows) < 0)
        notes.append(f"{repeated} of its rows are repeated and {late} stand too late: each is put in its place once")
    columns = tuple(placed.get(id(one), one) for one in contents.columns)
    return replace(contents, columns=columns, notes=tuple(notes))


def on_common_instants(contents: Contents) -> Contents:
    """Returns a log whose signals have the samples of one clock, where they have several in its table or messages."""
    return _by_rows(contents) or _by_times(contents) or _by_topics(contents) or _by_rate(contents) or contents


def _by_rate(contents: Contents) -> Contents | None:
    """A log of which some signals were sampled more slowly than others, but commands; None where it is none."""
    length = max(len(one.values) for one in contents.columns)
    rates = {one.key: rows_of_value(one.values) for one in contents.columns if len(one.values) == length}
    fastest = min(
        (rates[one.key][0] for one in contents.columns if one.key in rates and not is_ramp(one.values)), default=1
    )
    slow = {
        one.key: rates[one.key][0]
        for one in contents.columns
        if rates.get(one.key, (fastest, 0))[0] > fastest and not read_name(one).commanded
    }
    if not slow:
        return None
    columns, rows = [], np.arange(float(length))
    for one in contents.columns:
        if one.key in slow:
            at = rows[rates[one.key][1] :: slow[one.key]]
            values, _ = interpolated(at, one.values[at.astype(int)], np.clip(rows, at[0], at[-1]))
            columns.append(replace(one, values=values))
        else:
            columns.append(one)
    notes = [f"each value of `{name}` stands in {count} rows: its first is taken" for name, count in slow.items()]
    return replace(contents, columns=tuple(columns), notes=(*contents.notes, *notes))


def _by_rows(contents: Contents) -> Contents | None:
    """A table whose rows hold some of the signals each; None where it is none."""
    length = max(len(one.values) for one in contents.columns)
    table = [one for one in contents.columns if len(one.values) == length and one.file is None and not one.group]
    whole = [one for one in table if np.isfinite(one.values).all()]
    times = [one for one in whole if np.all(np.diff(one.values) >= 0) and np.ptp(one.values) > 0]
    if len(table) < 3 or not times or len(whole) == len(table):
        return None
    # Name and unit say how surely a signal that rises is the time.
    named = [2 * (unit_of_name(one) in TIME_UNITS) + any(word in _NAMES for word in tokens(one.name)) for one in times]
    time = times[named.index(max(named))]
    placed = [own_rows(Stream(one.name, one.name, 1.0, one.values), time.values) for one in table]
    apart = {one.name: one for one in placed if one.stamps is not None}
    if not apart:
        return None
    base = max(apart.values(), key=lambda one: len(one.values))
    brought = _brought(contents, base, apart, time.name, time.values)
    if brought is None:
        return None
    kept = np.isin(time.values, base.stamps) if base.stamps is not None else slice(None)
    others = {one.name: one.values[kept] for one in table if one.name not in brought}
    count = len(brought[time.name])
    columns = tuple(
        replace(one, values=brought.get(one.name, others.get(one.name, one.values)[:count]))
        for one in contents.columns
        if one in table
    )
    told = f"its rows hold some of the columns only: each is read at its own rows, by `{time.name}`."
    rest = tuple(one for one in contents.columns if one not in table)
    return replace(contents, columns=(*columns, *rest), notes=(*contents.notes, told))


def _by_times(contents: Contents) -> Contents | None:
    """A log whose signals have times beside them, not all the same; None where it is none."""
    columns = {one.name: one for one in contents.columns if one.file is None and not one.group}
    names = list(columns) if is_table(contents.file, contents.format) else []
    own: dict[str, Column] = {}
    for name in columns:
        time = columns.get(f"{name}.time") or columns.get(time_before(names, name))
        if time is not None and name not in times_of_groups(names) and len(time.values) == len(columns[name].values):
            own[name] = time
    times = list({id(time): time for time in own.values()}.values())
    if not times or all(np.array_equal(time.values, times[0].values) for time in times):
        return None
    hints = read_names([columns[name] for name in own])
    driving = [name for name, hint in zip(own, hints, strict=True) if hint.role in DRIVING]
    base = (driving or list(own))[0]
    streams = {
        name: Stream(name, name, 1.0, columns[name].values, time.values, time.name) for name, time in own.items()
    }
    clock = own[base]
    brought = _brought(contents, streams[base], streams, clock.name, clock.values)
    if brought is None:
        return None
    dropped = {time.name for time in times} - {clock.name}
    joined = [replace(columns[name], values=brought[name]) for name in columns if name in brought]
    rest = [one for one in contents.columns if one.name not in brought and one.name not in dropped]
    told = f"its signals have clocks of their own, as {', '.join(f'`{time.name}`' for time in times[:3])}: they are"
    return replace(
        contents, columns=(*joined, *rest), notes=(*contents.notes, f"{told} brought to that of `{clock.name}`.")
    )


def _by_topics(contents: Contents) -> Contents | None:
    """Messages of several topics of which one drives and another one moves; None where there are none."""
    topics: dict[str, list[Column]] = {}
    for one in contents.columns:
        if one.group and one.file is None:
            topics.setdefault(one.group, []).append(one)
    roles = {name: {hint.role for hint in read_names(members)} for name, members in topics.items()}
    driving = [name for name, told in roles.items() if told & set(DRIVING)]
    moving = [name for name, told in roles.items() if told & set(MOVING)]
    if not driving or not moving or set(driving) & set(moving):
        return None
    chosen = [topics[driving[0]], topics[moving[0]]]
    kind = next((one for one in _TIMES if all(_time_of(members, one) for members in chosen)), "")
    first, other = (_time_of(members, kind) for members in chosen)
    if first is None or other is None:
        return None
    streams = {
        one.name: Stream(one.name, one.name, 1.0, one.values, stamps.values, stamps.name)
        for members, stamps in zip(chosen, (first, other), strict=True)
        for one in members
        if len(one.values) == len(stamps.values) and not one.name.partition(".")[2].startswith(_TIMES)
    }
    base = next((one for one in streams.values() if one.clock == first.name), None)
    brought = None if base is None else _brought(contents, base, streams, first.name, first.values)
    if brought is None:
        return None
    joined = [
        replace(one, values=brought[one.name], group=driving[0]) for one in contents.columns if one.name in brought
    ]
    rest = [one for one in contents.columns if one.name not in brought]
    told = f"topics {driving[0]} and {moving[0]} have clocks of their own: they are brought to one by `{kind}`."
    return replace(contents, columns=(*joined, *rest), notes=(*contents.notes, told))


def _time_of(members: Sequence[Column], kind: str) -> Column | None:
    return next((one for one in members if kind and one.name.partition(".")[2] == kind), None)


def _brought(
    contents: Contents, base: Stream, streams: Mapping[str, Stream], time: str, stamps: FloatArray
) -> dict[str, FloatArray] | None:
    """Signals at the instants of one of them, and these; None where they cannot be brought there."""
    mapping = LogMapping(
        file=contents.file,
        sampling_period_s=1.0,
        time=TimeChannel(time),
        inputs=(InputChannel("base", base.column),),
        outputs=tuple(OutputChannel(f"{index}", name) for index, name in enumerate(streams) if name != base.column),
    )
    joined, problems = on_one_clock(mapping, list(streams.values()), stamps)
    return None if problems else dict(joined.columns)
