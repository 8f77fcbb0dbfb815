"""The variables behind the channels of a log: weights in sums, jumps where numbers begin again, stamps of their own."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robid.arrays import FloatArray
from robid.logs.formats.known import tell_format
from robid.logs.mapping import LogMapping
from robid.signals.log_channels import LogChannel

_MESSAGES = ("mcap", "rosbag")
_TIMED = ("tdms", "mdf")
_TIMES = ("header.stamp", "log_time")
_TABLES = ("csv", "parquet")
_PLACE = re.compile(r"\d+|.*\([\d:, ]+\)")
_NUMBER = re.compile(r"[\s_(-]*\d+\)?")
_TIME_WORD = re.compile(r"(?<![a-z])(time|timestamp|stamp|zeit|zeitstempel|temps|tempo)(?![a-z])")


@dataclass(frozen=True, eq=False)
class Stream:
    """The samples of a variable.

    Attributes:
        column: The column that it is, or is a part of.
        name: Its name.
        weight: Its weight in the column.
        values (n_sample,): Its samples.
        stamps (n_sample,): Its own time stamps, in the unit of the log's time; None where it has none.
        clock: The variable that holds them.
        held: Whether its numbers stay from one sample to the next, as a command does.
    """

    column: str
    name: str
    weight: float
    values: NDArray[Any]
    stamps: NDArray[Any] | None = None
    clock: str = ""
    held: bool = False


def own_times(mapping: LogMapping, channel: LogChannel, path: Path, name: str) -> list[str]:
    """Returns the variables that may hold the time stamps of one, the likeliest first.

    Messages of a topic have times of their own, as have the channels of TDMS and MDF files and of other recorders that
    say so by the name; a further log those of the same name as the first one's.
    """
    if channel.time is not None:
        return [channel.time]
    if mapping.time is None:
        return []
    told, found = mapping.time.variable, [f"{name}.time"]
    if path != mapping.file and (path, told) not in mapping.variables.values():
        found.insert(0, told)
    kind = topic_time(mapping)
    if kind and _has_topics(path):
        label = name[name.rindex("[") :] if name.endswith("]") else ""
        other = is_of_other_topic(mapping, path, name)
        found = [f"{topic_of(name)}.{kind}{label}", *([f"{topic_of(name)}.{kind}"] if other else [])]
    return [one for one in dict.fromkeys(found) if path != mapping.file or one != told]


def may_be_time(name: str, stamps: NDArray[Any]) -> bool:
    """Returns whether a variable that was looked for by its name may hold time stamps.

    One that is named by its place, a column's number or that of a matrix, has to advance: any may stand there.

    Args:
        name: The variable.
        stamps: Its samples.
    """
    if stamps.dtype.kind not in "fiu" or stamps.ndim != 1 or len(stamps) < 2:
        return False
    return _PLACE.fullmatch(name) is None or bool(np.all(np.diff(stamps.astype(float)) > 0))


def on_time_of_log(
    stamps: NDArray[Any], recorded: NDArray[Any] | None, time: NDArray[Any] | None
) -> NDArray[Any] | None:
    """Returns a recorder's stamps of a variable as times of the log's own time, a variable with such stamps itself.

    Args:
        stamps (n_sample,): The stamps.
        recorded (n_time,): Those of the log's own time; None where it has none.
        time (n_time,): The log's own time, in its unit.

    Returns:
        The times in that unit; None where both were not recorded so.
    """
    if recorded is None or time is None or len(recorded) != len(time):
        return None
    if np.result_type(stamps, recorded, time).kind != "f" or not np.all(np.diff(recorded) > 0):
        return None  # whole numbers may be nanoseconds since 1970, with more digits than a float holds
    stamps, recorded, time = stamps.astype(float), recorded.astype(float), time.astype(float)
    at = np.clip(np.searchsorted(recorded, stamps, side="right") - 1, 0, len(time) - 2)
    slope = (time[at + 1] - time[at]) / (recorded[at + 1] - recorded[at])
    return np.asarray(time[at] + slope * (stamps - recorded[at]))


def topic_of(name: str) -> str:
    """Returns the topic of a field of its messages."""
    return name.partition(".")[0]


def topic_time(mapping: LogMapping) -> str:
    """Returns which time of messages a log's own is: `header.stamp` or `log_time`; empty where it is neither."""
    told = "" if mapping.time is None else mapping.time.variable.partition(".")[2].partition("[")[0]
    return told if told in _TIMES else ""


def is_of_other_topic(mapping: LogMapping, path: Path, name: str) -> bool:
    """Returns whether a variable is of other messages than those whose times are the log's own."""
    if mapping.time is None or not topic_time(mapping) or not _has_topics(path):
        return False
    return path != mapping.file or topic_of(name) != topic_of(mapping.time.variable)


def _has_topics(path: Path) -> bool:
    return path.exists() and (path.is_dir() or tell_format(path) in _MESSAGES)


def apart_without_time(mapping: LogMapping) -> list[str]:
    """Returns the variables that tell when the channels of a log without `time` were sampled, where there are some."""
    if mapping.time is not None or not mapping.file.exists():
        return []
    names = [variable for path, variable in mapping.variables.values() if path == mapping.file]
    kind = mapping.format or tell_format(mapping.file)
    if kind in _MESSAGES:
        return list(dict.fromkeys(f"{topic_of(name)}.log_time" for name in names))
    return list(dict.fromkeys(f"{name}.time" for name in names)) if kind in _TIMED else []


def times_of_groups(names: Sequence[str]) -> list[str]:
    """Returns the columns of a table that are times of the columns behind them, as `Time1` and `Time2`; else nothing.

    Args:
        names: The columns in their order.
    """
    stems: dict[str, list[str]] = {}
    for name in names:
        stem = _NUMBER.sub("", name).lower()
        if _TIME_WORD.search(stem):
            stems.setdefault(stem, []).append(name)
    return max(stems.values(), key=len) if any(len(alike) > 1 for alike in stems.values()) else []


def time_before(names: Sequence[str], name: str) -> str:
    """Returns the time of the group that a column of a table belongs to: the last before it; empty without one."""
    times, found = set(times_of_groups(names)), ""
    for one in names if times else ():
        if one == name:
            return found
        found = one if one in times else found
    return ""


def is_table(path: Path, stated: str | None) -> bool:
    """Returns whether a log has columns in an order."""
    return path.is_file() and (stated or tell_format(path)) in _TABLES


def unwrapped(values: NDArray[Any], wrap: float) -> tuple[FloatArray, int]:
    """Samples without the jumps where numbers begin again, and how many of them there were.

    Args:
        values (n_sample,): The samples; those that are no numbers stay.
        wrap: The range after which they begin again.
    """
    known = np.isfinite(values)
    found = values.astype(float)
    kept = found[known]
    found[known] = np.unwrap(kept, period=wrap)
    return found, int(np.count_nonzero(np.abs(np.diff(kept)) > wrap / 2))


def jump_notes(channel: LogChannel, name: str, wrap: float, jumps: int) -> list[str]:
    """Says that a variable jumped, by what, and how often; nothing where it did not."""
    turns = channel.unwrap is None or isinstance(channel.unwrap, bool)
    told = "a turn" if turns else f"its range of {wrap:g}"
    return [f"`{name}` jumped by {told} {jumps} times; the jumps were taken out."] if jumps else []
