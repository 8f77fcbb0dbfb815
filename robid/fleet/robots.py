"""Whose measurements the rows of a manifest are: which robot, of which population, and when."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.fleet.manifest import GROUP, ROBOT, Manifest
from robid.settings.placeholders import Value

TIME = "time"
COLUMNS = (ROBOT, GROUP, TIME)
ALL = "all"
"""Name of the population where the manifest tells of none."""
_DAY_S = 86400.0
_NUMBER, _DATE = "number", "date and time as 2026-01-31T14:00"
_LARGEST_TIME = 1e20
_DIGITS = re.compile(r"[0-9]{8}(\.0)?")


@dataclass(frozen=True)
class Robots:
    """The robots of a fleet."""

    names: tuple[str, ...]
    robot: IntArray  # (n_row,): number of each row's robot
    groups: tuple[str, ...]  # names of the populations; `all` where the manifest tells of none
    group: IntArray  # (n_row,): number of each row's population
    time: FloatArray  # (n_row,): when each row was measured; not a number where that is not said
    time_unit: str  # what time is counted in

    @property
    def repeated(self) -> int:
        """Number of robots that were measured more than once."""
        return int((np.bincount(self.robot) > 1).sum())


def robots_of(manifest: Manifest, robot_files: Collection[str] = ()) -> Robots:
    """Reads whose measurements the rows of a manifest are.

    Args:
        manifest: The manifest, without wrong times.
        robot_files: Columns that fill the name of the robot file: one of the name `robot` names no robot.
    """
    named = ROBOT in manifest.columns and ROBOT not in robot_files
    names, robot = _numbered([(named and _text(row.values[ROBOT])) or row.id for row in manifest.rows])
    grouped = GROUP in manifest.columns
    groups, group = _numbered([_text(row.values[GROUP]) if grouped else ALL for row in manifest.rows])
    if TIME not in manifest.columns:
        return Robots(names, robot, groups, group, _order(robot), "measurement")
    values = [row.values[TIME] for row in manifest.rows]
    dated = _kind(values) == _DATE
    time = np.array([(_days if dated else _number)(value) for value in values])
    return Robots(names, robot, groups, group, time, "day" if dated else f"unit of `{TIME}`")


def wrong_times(manifest: Manifest) -> Iterator[str]:
    """Yields which rows of a manifest have a time that is none, or another kind of time than the others."""
    if TIME not in manifest.columns:
        return
    values = [row.values[TIME] for row in manifest.rows if _text(row.values[TIME])]
    kind = _kind(values)
    digits = kind == _NUMBER and all(map(_is_date_in_digits, values))
    for row in manifest.rows:
        value = row.values[TIME]
        wrong = "a date without hyphens: write dates as 2026-01-31" if digits else _wrong_time(value, kind)
        if _text(value) and wrong:
            yield f"{row.place}: {TIME}: `{value}` is {wrong}"


def _numbered(texts: list[str]) -> tuple[tuple[str, ...], IntArray]:
    numbers = {text: number for number, text in enumerate(dict.fromkeys(texts))}
    return tuple(numbers), np.array([numbers[text] for text in texts], int)


def _order(robot: IntArray) -> FloatArray:
    """How many measurements of its robot stand above each row."""
    order = np.argsort(robot, kind="stable")
    first = np.searchsorted(robot[order], robot[order])
    found = np.empty(len(robot))
    found[order] = np.arange(len(robot)) - first
    return found


def _text(value: Value) -> str:
    return "" if value is None else str(value).strip()


def _kind(values: list[Value]) -> str:
    """What the first time is that is one; the others are to be the same."""
    for value in values:
        if math.isfinite(_number(value)):
            return _NUMBER
        if _day_or_none(value) is not None:
            return _DATE
    return ""


def _wrong_time(value: Value, kind: str) -> str:
    """What is wrong with a time among others of a kind; empty where it is fine."""
    if not kind:
        return "neither a date as 2026-01-31 nor a number"
    if kind == _DATE:
        return "" if _day_or_none(value) is not None else f"no {_DATE}, as others of the column are"
    number = _number(value)
    if not math.isfinite(number):
        return f"no {_NUMBER}, as others of the column are"
    return "" if abs(number) <= _LARGEST_TIME else f"too large: count from a later day, below {_LARGEST_TIME:g}"


def _is_date_in_digits(value: Value) -> bool:
    """Whether a time is written as 20260131, whose differences are no times."""
    text = _text(value)
    return _DIGITS.fullmatch(text) is not None and _day_or_none(text[:8]) is not None


def _number(value: Value) -> float:
    try:
        return math.nan if isinstance(value, bool) else float(_text(value))
    except ValueError:
        return math.nan


def _days(value: Value) -> float:
    day = _day_or_none(value)
    return math.nan if day is None else day


def _day_or_none(value: Value) -> float | None:
    """Days since 1970; what has no time zone is in UTC."""
    try:
        found = datetime.fromisoformat(_text(value))
    except ValueError:
        return None
    return (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp() / _DAY_S
