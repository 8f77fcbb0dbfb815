"""The variables behind the channels of a log: stamps of their own, jumps, and weighted sums of them.

A sum is written as `q2 + q3`, `0.5*a - 2*b` or `(a + b)/2`.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robid.arrays import FloatArray
from robid.logs.formats.variables import FORMATS, tell_format
from robid.logs.mapping import LogMapping
from robid.signals.log_channels import LogChannel
from robid.signals.log_options import LogFormat

_TIMES = ("header.stamp", "log_time")
_PLACE = re.compile(r"\d+|.*\([\d:, ]+\)")
_NUMBER = re.compile(r"[\s_(-]*\d+\)?")
_TIME_WORD = re.compile(r"(?<![a-z])(time|timestamp|stamp|zeit|zeitstempel|temps|tempo)(?![a-z])")


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
    """
    if stamps.dtype.kind not in "fiu" or stamps.ndim != 1 or len(stamps) < 2:
        return False
    return _PLACE.fullmatch(name) is None or bool(np.all(np.diff(stamps.astype(float)) > 0))


def on_time_of_log(
    stamps: NDArray[Any], recorded: NDArray[Any] | None, time: NDArray[Any] | None
) -> NDArray[Any] | None:
    """Returns a recorder's stamps (n_sample,) of a variable as times of the log's own time (n_time,), in its unit.

    The log's own time has such stamps itself, `recorded` (n_time,); None where both were not recorded so.
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
    return path.exists() and (path.is_dir() or FORMATS[tell_format(path)].holds == "messages")


def apart_without_time(mapping: LogMapping) -> list[str]:
    """Returns the variables that tell when the channels of a log without `time` were sampled, where there are some."""
    if mapping.time is not None or not mapping.file.exists():
        return []
    names = [variable for path, variable in mapping.variables.values() if path == mapping.file]
    holds = FORMATS[mapping.format or tell_format(mapping.file)].holds
    if holds == "messages":
        return list(dict.fromkeys(f"{topic_of(name)}.log_time" for name in names))
    return list(dict.fromkeys(f"{name}.time" for name in names)) if holds == "timed" else []


def times_of_groups(names: Sequence[str]) -> list[str]:
    """Returns the columns of a table that are times of those behind them, as `Time1` and `Time2`; else nothing."""
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


def is_table(path: Path, stated: LogFormat | None) -> bool:
    """Returns whether a log has columns in an order."""
    return path.is_file() and FORMATS[stated or tell_format(path)].holds == "columns"


def unwrapped(values: NDArray[Any], wrap: float) -> tuple[FloatArray, int]:
    """Samples (n_sample,) without jumps by the range after which they begin again, and how many of these there were."""
    known = np.isfinite(values)
    found = values.astype(float)
    kept = found[known]
    found[known] = np.unwrap(kept, period=wrap)
    return found, int(np.count_nonzero(np.abs(np.diff(kept)) > wrap / 2))


def signed(values: NDArray[Any], wrap: float) -> tuple[FloatArray, int]:
    """Samples (n_sample,) that were logged as unsigned ones of a range, and how many of these are negative."""
    found = values.astype(float)
    negative = found >= wrap / 2
    found[negative] -= wrap
    return found, int(np.count_nonzero(negative))


def jump_notes(channel: LogChannel, name: str, wrap: float, jumps: int) -> list[str]:
    """Says that a variable jumped, by what, and how often, or was unsigned; nothing where it did not."""
    if jumps and not channel.goes_on:
        return [f"`{name}` was logged without signs: {jumps} of its samples, above {wrap / 2:g}, are negative."]
    turns = channel.unwrap is None or isinstance(channel.unwrap, bool)
    told = "a turn" if turns else f"its range of {wrap:g}"
    return [f"`{name}` jumped by {told} {jumps} times; the jumps were taken out."] if jumps else []


_FACTOR = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.\[(])")
_INDEX = re.compile(r"\(\s*[\d:]+\s*(?:,\s*[\d:]+\s*)*\)|\{\d+\}|\[[^\]]*\]")
_QUOTED = re.compile(r"`([^`]+)`|\"([^\"]+)\"|'([^']+)'")
_WORD = re.compile(r"[^\s+*/()`\"'-]+")
_OPERATORS = re.compile(r"[-+*/`\"']")
_DEEPEST = 20


class NoSumError(Exception):
    """Why a text is no weighted sum of variables."""


@dataclass(frozen=True)
class Sum:
    """A weighted sum: the weight of each variable by its name, and what is added."""

    weights: dict[str, float] = field(default_factory=dict)
    constant: float = 0.0

    def __add__(self, other: Sum) -> Sum:
        names = dict.fromkeys([*self.weights, *other.weights])
        weights = {name: self.weights.get(name, 0.0) + other.weights.get(name, 0.0) for name in names}
        return Sum(weights, self.constant + other.constant)

    def times(self, factor: float) -> Sum:
        """The sum, scaled."""
        return Sum({name: weight * factor for name, weight in self.weights.items()}, self.constant * factor)


def may_be_sum(text: str) -> bool:
    """Whether a name that no variable has could be a sum."""
    return bool(_OPERATORS.search(text))


def parse_sum(text: str, known: Collection[str]) -> Sum:
    """Reads a weighted sum of variables.

    A name is the longest of the log's that stands there, whatever it is made of; one in quotes is taken as it is. A
    number is a weight, unless it is a column's, has no factor but numbers, and is the last of them.

    Raises:
        NoSumError: If it is none.
    """
    reader = _Reader(text, sorted({form for name in known for form in (name, name.removeprefix("/"))}, key=len)[::-1])
    found = reader.sum(0)
    reader.skip()
    if reader.at < len(text):
        raise NoSumError(f"at `{text[reader.at :]}` it is no sum of variables")
    if found.constant:
        raise NoSumError(
            f"it adds the number {found.constant:g}, which is no variable: an output's offset is its `zero`"
        )
    weights = {name: weight for name, weight in found.weights.items() if weight}
    if not weights:
        raise NoSumError("nothing is left of its variables")
    return Sum(weights)


class _Reader:
    """Reads a sum from left to right."""

    def __init__(self, text: str, known: list[str]) -> None:
        self.text, self.known, self.at = text, known, 0

    def skip(self) -> None:
        while self.at < len(self.text) and self.text[self.at].isspace():
            self.at += 1

    def take(self, marks: str) -> str:
        """The next mark if it is one of some; nothing else."""
        self.skip()
        if self.at < len(self.text) and self.text[self.at] in marks:
            self.at += 1
            return self.text[self.at - 1]
        return ""

    def sum(self, depth: int) -> Sum:
        """Terms with signs between them."""
        if depth > _DEEPEST:
            raise NoSumError("its brackets are too deep")
        sign = -1.0 if self.take("+-") == "-" else 1.0
        found = self.product(depth).times(sign)
        while mark := self.take("+-"):
            found += self.product(depth).times(-1.0 if mark == "-" else 1.0)
        return found

    def product(self, depth: int) -> Sum:
        """A variable or a sum in brackets with its weights."""
        factors = [self.factor(depth)]
        divisors: list[float] = []
        while mark := self.take("*/"):
            factor = self.factor(depth)
            if mark == "*":
                factors.append(factor)
            elif isinstance(factor, float):
                divisors.append(factor)
            else:
                raise NoSumError("it divides by a variable")
        sums = [one for one in factors if not isinstance(one, float)]
        numbers = [one for one in factors if isinstance(one, float)]
        if len(sums) > 1:
            raise NoSumError("it multiplies variables")
        found = sums[0] if sums else self._column(numbers)
        for number in numbers:
            found = found.times(number)
        for divisor in divisors:
            if divisor == 0:
                raise NoSumError("it divides by zero")
            found = found.times(1 / divisor)
        return found

    def _column(self, numbers: list[float]) -> Sum:
        """The column that the last of some numbers names, in tables without names; else a constant."""
        name = f"{numbers[-1]:g}"
        if name in self.known:
            numbers.pop()
            return Sum({name: 1.0})
        return Sum({}, 1.0)

    def factor(self, depth: int) -> Sum | float:
        """A number, a variable or a sum in brackets."""
        self.skip()
        rest = self.text[self.at :]
        if quoted := _QUOTED.match(rest):
            self.at += quoted.end()
            return Sum({next(one for one in quoted.groups() if one is not None): 1.0})
        number = _FACTOR.match(rest)
        name = next((one for one in self.known if self._stands(rest, one)), None)
        if number and (name is None or len(name) <= number.end()):
            self.at += number.end()
            return float(number[0])
        if name is not None:
            index = _INDEX.match(rest, len(name))
            length = index.end() if index else len(name)
            self.at += length
            return Sum({rest[:length]: 1.0})
        if rest.startswith("("):
            self.at += 1
            found = self.sum(depth + 1)
            if not self.take(")"):
                raise NoSumError("a bracket is open at its end")
            return found
        if rest.startswith(("-", "+")):
            self.at += 1
            sign, factor = -1.0 if rest[0] == "-" else 1.0, self.factor(depth)
            return factor * sign if isinstance(factor, float) else factor.times(sign)
        word = _WORD.match(rest)
        raise UnknownNameError(word[0]) if word else NoSumError("a variable is missing in it")

    def _stands(self, rest: str, name: str) -> bool:
        """Whether a name stands at the beginning of a text, and not only as the beginning of a longer word."""
        if not rest.startswith(name):
            return False
        after = rest[len(name) : len(name) + 1]
        return not (after.isalnum() or after in ("_", ".")) or not (name[-1].isalnum() or name[-1] == "_")


class UnknownNameError(NoSumError):
    """A variable of a sum that the log does not have."""

    def __init__(self, name: str) -> None:
        super().__init__(f"the log has no variable `{name}`")
        self.name = name
