"""Reads tables of text in chunks, and of them only the columns that were asked for."""

from __future__ import annotations

import codecs
import io
from collections.abc import Sequence
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robid.errors import DataError
from robid.logs.formats.known import UNPACKING_ERRORS, open_bytes
from robid.logs.formats.layout import REMEDY, Layout, is_row, tell_layout
from robid.logs.formats.variables import Found, Reason, UnreadableLogError, Wanted, number_repeated
from robid.signals.log_dialect import Dialect

_SAMPLE = 1 << 18
CHUNK = 1 << 20
"""Characters that are read at a time; memory beyond the columns themselves is less than ten times that."""
_BOMS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))


def read_table(file: Path, wanted: Wanted, dialect: Dialect) -> Found:
    """Reads columns of a table of text.

    Raises:
        DataError: If it is none, or a row has another number of cells than the others.
    """
    try:
        with _open_text(file, dialect) as text:
            sample = text.readlines(_SAMPLE)
        layout = tell_layout(sample, dialect)
        with _open_text(file, dialect) as text:
            return _Table(layout, wanted, dialect).read(text)
    except UnreadableLogError as e:
        line, told, what = str(e).partition(": ") if str(e).startswith("line ") else ("", "", str(e))
        where = f"{file}, {line}" if told else str(file)
        raise DataError(what, where=where, remedy=e.remedy or REMEDY) from e
    except (UnicodeError, LookupError, *UNPACKING_ERRORS) as e:
        remedy = "Correct or leave out `dialect: {encoding: ...}`, and check that it was copied completely."
        raise DataError(f"The log cannot be read as text ({e}).", where=str(file), remedy=remedy) from e


def _open_text(file: Path, dialect: Dialect) -> io.TextIOWrapper:
    """Opens a file as text, unpacked.

    An encoding that is not stated is told from the beginning; letters that it lacks are then replaced, as numbers
    have none.
    """
    if dialect.encoding is not None:
        stated = codecs.lookup(dialect.encoding).name
        return io.TextIOWrapper(open_bytes(file), encoding=stated)
    with open_bytes(file) as stream:
        start = stream.read(_SAMPLE)
    told = next((name for bom, name in _BOMS if start.startswith(bom)), None)
    if told is None:
        try:
            start[: start.rfind(b"\n") + 1].decode()
            told = "utf-8"
        except UnicodeDecodeError:
            told = "cp1252"
    return io.TextIOWrapper(open_bytes(file), encoding=told, errors="replace")


class _Table:
    """A table that is being read, chunk by chunk."""

    def __init__(self, layout: Layout, wanted: Wanted, dialect: Dialect) -> None:
        self._layout, self._dialect = layout, dialect
        self._found = Found()
        names, twice = number_repeated(layout.names)
        self._names = names
        self._found.unreadable.update(twice)
        self._parts: dict[int, list[NDArray[np.float64]]] = {}
        self._origins: dict[int, datetime] = {}
        for column, kind in enumerate(layout.kinds):
            if kind in ("number", "moment") and self._asked(column, wanted):
                self._parts[column] = []
            elif kind not in ("number", "moment"):
                what = f"It holds text (`{kind}`), not numbers." if kind else "It is empty."
                self._found.unreadable[names[column]] = Reason(what)

    def _asked(self, column: int, wanted: Wanted) -> bool:
        return self._names[column] in wanted or self._layout.names[column] in wanted

    def read(self, text: io.TextIOWrapper) -> Found:
        """Reads all rows."""
        count, number = 0, self._layout.lines + 1
        for _ in islice(text, self._layout.lines):
            pass
        while lines := text.readlines(CHUNK):
            rows = [(i, line) for i, line in enumerate(lines, start=number) if is_row(line, self._dialect.comments)]
            self._check_width(rows)
            self._read_rows(rows)
            count, number = count + len(rows), number + len(lines)
        for column, kind in enumerate(self._layout.kinds):
            name = self._names[column]
            if kind in ("number", "moment") and name not in self._found.unreadable:
                self._found.mention(name, count, "s" if kind == "moment" else self._layout.units[column])
        for column in list(self._parts):
            values = np.concatenate(self._parts.pop(column) or [np.zeros(0)])
            self._found.arrays[self._names[column]] = values
        return self._found

    def _check_width(self, rows: Sequence[tuple[int, str]]) -> None:
        layout, quoted = self._layout, any('"' in line for _, line in rows)
        for number, line in rows:
            width = len(layout.cells(line)) if quoted or layout.separator == " " else 1 + line.count(layout.separator)
            if width != layout.width:
                what = f"line {number}: The table is broken: {width} values for {len(layout.names)} columns."
                raise UnreadableLogError(what, "Correct or delete this line.")

    def _read_rows(self, rows: Sequence[tuple[int, str]]) -> None:
        """Adds a chunk to the columns, by numpy where all of it is plain numbers."""
        columns = [column for column in self._parts if self._layout.kinds[column] == "number"]
        table = self._parse(rows, columns) if rows and columns else None
        for index, column in enumerate(columns):
            values = self._column(rows, column) if table is None else table[:, index].copy()
            self._keep(column, values)
        for column in [column for column in self._parts if self._layout.kinds[column] == "moment"]:
            self._keep(column, self._column(rows, column))

    def _keep(self, column: int, values: NDArray[np.float64] | Reason) -> None:
        if isinstance(values, Reason):
            self._found.unreadable[self._names[column]] = values
            del self._parts[column]
        else:
            self._parts[column].append(values)

    def _parse(self, rows: Sequence[tuple[int, str]], columns: Sequence[int]) -> NDArray[np.float64] | None:
        """Parses a chunk; None where a cell is empty or no number."""
        separator = self._layout.separator
        lines = (line.replace(",", ".") if self._layout.decimal_comma else line for _, line in rows)
        delimiter: Any = None if separator == " " else separator
        try:
            return np.loadtxt(lines, delimiter=delimiter, usecols=columns, ndmin=2, comments=None, quotechar='"')
        except ValueError:
            return None

    def _column(self, rows: Sequence[tuple[int, str]], column: int) -> NDArray[np.float64] | Reason:
        """Parses one column cell by cell; says where a cell is no number."""
        moment = self._layout.kinds[column] == "moment"
        values = np.empty(len(rows))
        for index, (number, line) in enumerate(rows):
            cell = self._layout.cells(line)[column]
            try:
                values[index] = self._seconds(cell, column) if moment else self._layout.number(cell)
            except (ValueError, TypeError):
                return Reason(f"In line {number} `{cell}` is no number.", "Correct or delete this line.")
        return values

    def _seconds(self, cell: str, column: int) -> float:
        """Seconds from the column's first moment [s]; times without a zone count as one zone's."""
        moment = datetime.fromisoformat(cell)
        moment = moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment
        return (moment - self._origins.setdefault(column, moment)).total_seconds()
