"""The manifest: a CSV or Parquet file with a row for each robot or log, and whose measurements the rows are."""

from __future__ import annotations

import csv
import datetime
import decimal
import io
import math
import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.errors import SettingsError, require_module
from robid.files import check_regular, read_regular
from robid.settings.other_files import SUFFIXES, refuse_binary, unreadable
from robid.settings.placeholders import Row, Value

ID, ROBOT, GROUP = NAMES = ("id", "robot", "group")
"""Columns of names: of rows, of robots and of populations."""
_SEPARATORS = ",;\t"
_SEPARATOR_LINE = re.compile(r"sep=([,;\t|])")
_ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
_REMEDY = "correct the manifest"


@dataclass(frozen=True)
class Manifest:
    """What a manifest says."""

    path: Path  # the file, as the user named it
    columns: tuple[str, ...]
    rows: tuple[Row, ...]  # its rows; without a column `id` their ids are their numbers from 1


def read_manifest(path: Path) -> Manifest:
    """Reads a manifest.

    Raises:
        SettingsError: If it cannot be read, or is no table whose columns have different names.
    """
    typed = path.suffix.lower() in (".parquet", ".pq")
    columns, lines = (_read_parquet if typed else _read_csv)(path)
    problems = []
    for index, name in enumerate(columns):
        if not name:
            problems.append(f"S037 column {index + 1} has no name")
        elif name in columns[:index]:
            problems.append(f"S038 column `{name}` is there twice")
    if not lines and not problems:
        problems.append("S036 it has no rows")
    if problems:
        raise SettingsError("; ".join(problems), where=str(path), remedy=_REMEDY)
    folder, named = path.parent.resolve(), ID in columns
    rows = []
    for number, (place, cells) in enumerate(lines, start=1):
        values = dict(zip(columns, cells, strict=True))
        own = values[ID] if named else number
        rows.append(Row("" if own is None else str(own).strip(), f"{path}:{place}", folder, values, typed))
    return Manifest(path, columns, tuple(rows))


def wrong_rows(manifest: Manifest, used: Collection[str]) -> Iterator[str]:
    """Yields what is wrong with the rows of a manifest, whatever they fill."""
    names: dict[str, Row] = {}
    contents: dict[tuple[object, ...], Row] = {}
    compared = [column for column in manifest.columns if column != ID or ID in used]
    for row in manifest.rows:
        if not _ID.fullmatch(row.id):
            yield (
                f"{row.place}: id: `{row.id}` is no name of a folder: up to 64 letters, digits, `.`, `_` or `-`, the"
                " first a letter or digit"
            )
        elif row.id.lower() in names:
            before = names[row.id.lower()]
            same = "is there twice" if before.id == row.id else f"and `{before.id}` are the same where case is ignored"
            yield f"{row.place}: id: `{row.id}` {same}, see {before.place}"
        names.setdefault(row.id.lower(), row)
        content = tuple(row.values[column] for column in compared)
        if compared and content in contents:
            yield f"{row.place}: row {row.id} says the same as row {contents[content].id}, {contents[content].place}"
        contents.setdefault(content, row)


def _read_csv(path: Path) -> tuple[tuple[str, ...], list[tuple[str, list[Value]]]]:
    """Columns, and for each row its line and its texts; lines without any text and such columns do not count."""
    if path.suffix.lower() in SUFFIXES:
        what = "S523 is a YAML file, where a manifest is asked for: a table, as CSV or Parquet"
        raise SettingsError(
            what, where=str(path), remedy="`robid reprocess MANIFEST.csv EXPERIMENT.yaml`, in this order"
        )
    try:
        content = read_regular(path)
        refuse_binary(path, content, "a manifest as CSV or Parquet")
        text = content.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except OSError as error:
        raise unreadable(path, error, (".csv", ".parquet", ".pq")) from error
    except UnicodeDecodeError as error:
        remedy = "save it as CSV in UTF-8, or as Parquet with the ending .parquet"
        raise SettingsError("S040 is not a UTF-8 text file", where=str(path), remedy=remedy) from error
    head = next((line for line in text.splitlines() if line.strip()), "")
    stated = _SEPARATOR_LINE.fullmatch(head)
    separator = stated[1] if stated else max(_SEPARATORS, key=head.count)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True)
    try:
        lines = [(reader.line_num, [cell.strip() for cell in cells]) for cells in reader]
    except csv.Error as error:
        remedy = "close the quotes in this line or above it"
        raise SettingsError(f"S041 is no CSV: {error}", where=f"{path}:{reader.line_num}", remedy=remedy) from error
    lines = [(line, cells) for line, cells in lines if any(cells)][1 if stated else 0 :]
    if not lines:
        raise SettingsError("S042 is empty", where=str(path), remedy="begin with a line of column names")
    columns, rows = lines[0][1], lines[1:]
    while columns and not columns[-1] and all(len(cells) < len(columns) or not cells[-1] for _, cells in rows):
        rows = [(line, cells[: len(columns) - 1]) for line, cells in rows]
        columns = columns[:-1]
    wrong = [f"S043 {path}:{line}: has {len(cells)} values" for line, cells in rows if len(cells) != len(columns)]
    if wrong:
        more = f"\nand {len(wrong) - 10} more lines" if len(wrong) > 10 else ""
        remedy = f"there are {len(columns)} columns; put texts with a separator in quotes"
        raise SettingsError("\n".join(wrong[:10]) + more, remedy=remedy)
    return tuple(columns), [(str(line), list(cells)) for line, cells in rows]


def _read_parquet(path: Path) -> tuple[tuple[str, ...], list[tuple[str, list[Value]]]]:
    require_module("pyarrow", "fleet", "Reading a manifest in Parquet")
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        check_regular(path)
        table = pq.read_table(path)
    except (OSError, pa.ArrowException) as error:
        first = str(error).splitlines()[0]
        raise SettingsError(f"S044 cannot be read as Parquet: {first}", where=str(path), remedy=_REMEDY) from error
    names = tuple(table.column_names)
    columns = [_plain_column(path, name, column) for name, column in zip(names, table.columns, strict=True)]
    return names, [(f"row {number}", list(cells)) for number, cells in enumerate(zip(*columns, strict=True), start=1)]


def _plain_column(path: Path, name: str, column: Any) -> list[Value]:  # noqa: ANN401
    """The values of a column of Parquet; names that pandas made numbers with a point are whole again."""
    import pyarrow as pa

    try:
        if pa.types.is_timestamp(column.type):
            column = column.cast(pa.timestamp("us", column.type.tz), safe=False)
        cells = [_plain(path, number, cell) for number, cell in enumerate(column.to_pylist(), start=1)]
    except (OSError, ValueError, KeyError, OverflowError, pa.ArrowException) as error:
        remedy = "write it as a text, or dates between the years 1 and 9999"
        raise SettingsError(f"S045 column `{name}` cannot be read: {error}", where=str(path), remedy=remedy) from error
    is_name = name in NAMES
    return [int(cell) if is_name and isinstance(cell, float) and cell.is_integer() else cell for cell in cells]


def _plain(path: Path, number: int, cell: object) -> Value:
    if isinstance(cell, datetime.date | datetime.time):
        return cell.isoformat()
    if isinstance(cell, decimal.Decimal):
        return int(cell) if cell == cell.to_integral_value() else float(cell)
    if cell is None or isinstance(cell, str | int | float):
        return None if isinstance(cell, float) and math.isnan(cell) else cell
    message = f"S046 a value of type {type(cell).__name__} cannot be filled in"
    remedy = "keep numbers, texts, truth values and dates in the manifest"
    raise SettingsError(message, where=f"{path}: row {number}", remedy=remedy)


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
    """Reads whose measurements the rows are; where the column `robot` fills the robot file's name it names no robot."""
    named = ROBOT in manifest.columns and ROBOT not in robot_files
    names, robot = _numbered([(named and _text(row.values[ROBOT])) or row.id for row in manifest.rows])
    grouped = GROUP in manifest.columns
    groups, group = _numbered([_text(row.values[GROUP]) if grouped else ALL for row in manifest.rows])
    if TIME not in manifest.columns:
        return Robots(names, robot, groups, group, _order(robot), "measurement")
    values = [row.values[TIME] for row in manifest.rows]
    dated = _kind(values) == _DATE
    days = [math.nan if (day := _day_or_none(value)) is None else day for value in values]
    time = np.array(days if dated else [_number(value) for value in values])
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


def _day_or_none(value: Value) -> float | None:
    """Days since 1970; what has no time zone is in UTC."""
    try:
        found = datetime.datetime.fromisoformat(_text(value))
    except ValueError:
        return None
    return (found if found.tzinfo else found.replace(tzinfo=datetime.UTC)).timestamp() / _DAY_S
