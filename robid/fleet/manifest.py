"""The manifest: a CSV or Parquet file with a row for each robot or log."""

from __future__ import annotations

import csv
import datetime
import decimal
import io
import math
import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robid.errors import SettingsError, require_module
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
    problems = list(_wrong_columns(columns))
    if not lines and not problems:
        problems.append("it has no rows")
    if problems:
        raise SettingsError("; ".join(problems), where=str(path), remedy=_REMEDY)
    folder, named = path.parent.resolve(), ID in columns
    rows = []
    for number, (place, cells) in enumerate(lines, start=1):
        values = dict(zip(columns, cells, strict=True))
        name = values[ID] if named else number
        rows.append(Row("" if name is None else str(name).strip(), f"{path}:{place}", folder, values, typed))
    return Manifest(path, columns, tuple(rows))


def wrong_rows(manifest: Manifest, used: Collection[str]) -> Iterator[str]:
    """Yields what is wrong with the rows of a manifest, whatever they fill.

    Args:
        manifest: The manifest.
        used: Columns that the experiment file asks for.
    """
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


def _wrong_columns(columns: Sequence[str]) -> Iterator[str]:
    for index, name in enumerate(columns):
        if not name:
            yield f"column {index + 1} has no name"
        elif name in columns[:index]:
            yield f"column `{name}` is there twice"


def _read_csv(path: Path) -> tuple[tuple[str, ...], list[tuple[str, list[Value]]]]:
    """Columns, and for each row its line and its texts; lines without any text and such columns do not count."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise SettingsError(f"cannot be read: {error.strerror or error}", where=str(path), remedy=_REMEDY) from error
    except UnicodeDecodeError as error:
        remedy = "save it as CSV in UTF-8, or as Parquet with the ending .parquet"
        raise SettingsError("is not a UTF-8 text file", where=str(path), remedy=remedy) from error
    head = next((line for line in text.splitlines() if line.strip()), "")
    stated = _SEPARATOR_LINE.fullmatch(head)
    separator = stated[1] if stated else max(_SEPARATORS, key=head.count)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True)
    try:
        lines = [(reader.line_num, [cell.strip() for cell in cells]) for cells in reader]
    except csv.Error as error:
        remedy = "close the quotes in this line or above it"
        raise SettingsError(f"is no CSV: {error}", where=f"{path}:{reader.line_num}", remedy=remedy) from error
    lines = [(line, cells) for line, cells in lines if any(cells)][1 if stated else 0 :]
    if not lines:
        raise SettingsError("is empty", where=str(path), remedy="begin with a line of column names")
    columns, rows = lines[0][1], lines[1:]
    while columns and not columns[-1] and all(len(cells) < len(columns) or not cells[-1] for _, cells in rows):
        rows = [(line, cells[: len(columns) - 1]) for line, cells in rows]
        columns = columns[:-1]
    wrong = [f"{path}:{line}: has {len(cells)} values" for line, cells in rows if len(cells) != len(columns)]
    if wrong:
        more = f"\nand {len(wrong) - 10} more lines" if len(wrong) > 10 else ""
        remedy = f"there are {len(columns)} columns; put texts with a separator in quotes"
        raise SettingsError("\n".join(wrong[:10]) + more, remedy=remedy)
    return tuple(columns), [(str(line), list(cells)) for line, cells in rows]


def _read_parquet(path: Path) -> tuple[tuple[str, ...], list[tuple[str, list[Value]]]]:
    """Columns, and for each row its number and its values."""
    require_module("pyarrow", "fleet", "Reading a manifest in Parquet")
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(path)
    except (OSError, pa.ArrowException) as error:
        first = str(error).splitlines()[0]
        raise SettingsError(f"cannot be read as Parquet: {first}", where=str(path), remedy=_REMEDY) from error
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
        raise SettingsError(f"column `{name}` cannot be read: {error}", where=str(path), remedy=remedy) from error
    is_name = name in NAMES
    return [int(cell) if is_name and isinstance(cell, float) and cell.is_integer() else cell for cell in cells]


def _plain(path: Path, number: int, cell: object) -> Value:
    if isinstance(cell, datetime.date | datetime.time):
        return cell.isoformat()
    if isinstance(cell, decimal.Decimal):
        return int(cell) if cell == cell.to_integral_value() else float(cell)
    if cell is None or isinstance(cell, str | int | float):
        return None if isinstance(cell, float) and math.isnan(cell) else cell
    raise SettingsError(
        f"a value of type {type(cell).__name__} cannot be filled in",
        where=f"{path}: row {number}",
        remedy="keep numbers, texts, truth values and dates in the manifest",
    )
