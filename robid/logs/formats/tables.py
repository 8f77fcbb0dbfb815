"""Reads tables of text in chunks, and of them only the columns that were asked for; first those that lie across."""

from __future__ import annotations

import codecs
import io
import re
from collections.abc import Iterable, Sequence
from itertools import islice
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.logs.formats.layout import (
    AROUND,
    Layout,
    is_missing,
    is_number,
    is_row,
    number,
    repeated_mark,
    split,
    split_all,
    without_groups,
)
from robid.logs.formats.moments import Moments, origin_of
from robid.logs.formats.recorders import tell_recorder
from robid.logs.formats.telling import REMEDY, tell_layout, tell_marks, units_of
from robid.logs.formats.unpacking import LONGEST_LINE, UNPACKING_ERRORS, UnreadableLogError, check_unpacks, open_bytes
from robid.logs.formats.variables import Found, Reason, Wanted, number_repeated
from robid.signals.log_options import Dialect

_MOST_CHANNELS = 64  # channels of such a table at most
_LONGER = 4  # samples per channel from which it lies across, in as many as there are channels
_LEAD = 2  # cells before the samples at most: a name and a unit


def read_across(text: Iterable[str], sample: Sequence[str], wanted: Wanted, dialect: Dialect) -> Found | None:
    """Reads channels of a table that lies across; None where it does not, or its names are said to be in a line."""
    first = next((line for line in sample if is_row(line, dialect.comments)), "")
    if dialect.header_line is not None or len(first) < _MOST_CHANNELS * _LONGER:
        return None
    separator, comma = tell_marks([first], dialect)
    lead = _lead(split(first, separator), comma)
    if lead is None:
        return None
    rows = [line for line in islice(text, 2 * _MOST_CHANNELS) if is_row(line, dialect.comments)]
    cells = [split(line.rstrip("\r\n" + separator.strip()), separator) for line in rows]
    length = len(cells[0])
    if any(len(row) != length or _lead(row, comma) != lead for row in cells):
        return None
    if len(rows) > _MOST_CHANNELS or length - lead < _LONGER * max(len(rows), _MOST_CHANNELS):
        return None
    names, twice = number_repeated([row[0] if lead else str(index) for index, row in enumerate(cells, start=1)])
    found = Found()
    found.unreadable.update(twice)
    for name, row, unit in zip(names, cells, units_of(names), strict=True):
        stated = row[1] if lead == _LEAD else unit
        if name not in wanted:
            found.mention(name, length - lead, stated)
            continue
        try:
            found.add(name, np.array([number(cell, decimal_comma=comma) for cell in row[lead:]]), stated)
        except ValueError as e:
            found.unreadable[name] = Reason(f"D075 It contains what is no number ({e}).")
    return found


def _lead(row: Sequence[str], comma: bool) -> int | None:
    """How many cells of words stand before numbers only; None where there are others."""
    samples = [is_number(cell, decimal_comma=comma) or is_missing(cell) for cell in row]
    lead = next((index for index, cell in enumerate(row) if is_number(cell, decimal_comma=comma)), len(row))
    return lead if lead <= _LEAD and all(samples[lead:]) and len(row) > lead else None


_SAMPLE = 1 << 18
_DATED = ("date", "numbers")  # kinds of moments that have a date
CHUNK = 1 << 20
"""Characters that are read at a time; memory beyond the columns themselves is less than ten times that."""
_PLACED = re.compile(r"(?P<code>\w+) (?P<line>line \d+): (?P<what>.*)", re.DOTALL)
_BEGINS_NUMBERS, _DIGIT = re.compile(r"[+-]?[.,]?\d"), re.compile(r"\d")
_BOMS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))


def read_table(file: Path, wanted: Wanted, dialect: Dialect) -> Found:
    """Reads columns of a table of text.

    Raises:
        DataError: If it is none, or a row has another number of cells than the others.
    """
    try:
        check_unpacks(file)
        with _open_text(file, dialect) as text:
            sample = text.readlines(_SAMPLE)
        with _open_text(file, dialect) as text:
            across = read_across(text, sample, wanted, dialect)
        if across is not None:
            return across
        layout = (dialect.header_line is None and tell_recorder(sample)) or tell_layout(sample, dialect)
        with _open_text(file, dialect) as text:
            return _Table(layout, wanted, dialect).read(text)
    except MemoryError as e:
        what, remedy = "D509 There is not enough memory for the log.", "Read fewer columns, or save a shorter part."
        raise DataError(what, where=str(file), remedy=remedy) from e
    except UnreadableLogError as e:
        placed = _PLACED.fullmatch(str(e))
        what = str(e) if placed is None else f"{placed['code']} {placed['what']}"
        where = str(file) if placed is None else f"{file}, {placed['line']}"
        raise DataError(what, where=where, remedy=e.remedy or REMEDY) from e
    except (UnicodeError, LookupError, *UNPACKING_ERRORS) as e:
        remedy = "Correct or leave out `dialect: {encoding: ...}`, and check that it was copied completely."
        raise DataError(f"D076 The log cannot be read as text ({e}).", where=str(file), remedy=remedy) from e


def _open_text(file: Path, dialect: Dialect) -> io.TextIOWrapper:
    """Opens a file as text, unpacked.

    An encoding that is not stated is told from the beginning; letters that it lacks are then replaced, as numbers
    have none.
    """
    if dialect.encoding is not None:
        stated = codecs.lookup(dialect.encoding).name
        return io.TextIOWrapper(_lines(file), encoding=stated)
    with open_bytes(file) as stream:
        start = stream.read(_SAMPLE)
    told = next((name for bom, name in _BOMS if start.startswith(bom)), None)
    if told is None:
        try:
            start[: start.rfind(b"\n") + 1].decode()
            told = "utf-8"
        except UnicodeDecodeError:
            told = "cp1252"
    return io.TextIOWrapper(_lines(file), encoding=told, errors="replace")


def _lines(file: Path) -> IO[bytes]:
    return open_bytes(file, longest_line=LONGEST_LINE)


class _Table:
    """A table that is being read, chunk by chunk."""

    def __init__(self, layout: Layout, wanted: Wanted, dialect: Dialect) -> None:
        self._layout, self._dialect = layout, dialect
        self._found = Found()
        names, twice = number_repeated(layout.names)
        self._names = names
        self._found.unreadable.update(twice)
        self._parts: dict[int, list[FloatArray]] = {}
        self._moments: dict[int, Moments] = {}
        self._foot: tuple[int, int] | None = None
        asked = (i for i, name in enumerate(names) if name in wanted or layout.names[i] in wanted)
        self._asked = dict.fromkeys(asked)
        self._made = {name: column for name, column in layout.body.made.items() if name in wanted}
        self._shared = {name: column for name, column in layout.body.shared.items() if name in wanted}
        needed = {*self._asked, *self._made.values(), *self._shared.values()}
        needed |= {layout.body.clocks[column] for column in needed if column in layout.body.clocks}
        if any(layout.kinds[column] == "moment" for column in needed):
            # All count from one moment, whichever are asked for.
            needed |= {column for column, kind in enumerate(layout.kinds) if kind == "moment"}
        for column, kind in enumerate(layout.kinds):
            if kind not in ("number", "moment"):
                what = f"D077 It contains text (`{kind}`), not numbers." if kind else "D078 It is empty."
                self._found.unreadable[names[column]] = Reason(what)
            elif column in needed and kind == "moment":
                self._moments[column] = Moments()
            elif column in needed:
                self._parts[column] = []

    def read(self, text: io.TextIOWrapper) -> Found:
        """Reads all rows."""
        layout, count, number = self._layout, 0, self._layout.lines + 1
        for _ in islice(text, layout.lines):
            pass
        while lines := text.readlines(CHUNK):
            lines = lines if layout.join is None else list(map(layout.join, lines))
            rows = [(i, line) for i, line in enumerate(lines, start=number) if is_row(line, self._dialect.comments)]
            rows = [(i, line) for i, line in rows if line.strip(AROUND) not in layout.headers]
            rows = self._check_width(layout.body.keep(rows))
            self._read_rows(rows)
            count, number = count + len(rows), number + len(lines)
        for column, kind in enumerate(layout.kinds):
            name = self._names[column]
            if kind in ("number", "moment") and name not in self._found.unreadable:
                self._found.mention(name, count, "s" if kind == "moment" else layout.units[column])
        self._finish(count)
        return self._found

    def _check_width(self, rows: list[tuple[int, str]]) -> list[tuple[int, str]]:
        """Returns the rows without those at the end of the table that hold no number, as `EOF`."""
        layout = self._layout
        allowed = range(layout.fewest or layout.width, layout.width + 1)
        if layout.separator == " " or any('"' in line for _, line in rows):
            widths = [len(row) for row in split_all([line for _, line in rows], layout.separator)]
        else:
            widths = [1 + line.count(layout.separator) for _, line in rows]
        kept = []
        for (at, line), width in zip(rows, widths, strict=True):
            is_row = width in allowed and not self._is_text(line)
            if is_row and self._foot is None:
                kept.append((at, line))
            elif self._foot is None and not self._has_number(line):
                self._foot = at, width
            elif is_row or self._has_number(line):
                at, width = self._foot or (at, width)
                how = "no number" if width in allowed else f"{width} values for {len(layout.names)} columns"
                what = f"D079 line {at}: The table is broken: {how}."
                raise UnreadableLogError(what, "Correct or delete this line.")
        return kept

    def _is_text(self, line: str) -> bool:
        """Whether a line, of as many words as the table has columns, holds no number, and not gaps instead of them."""
        kinds = self._layout.kinds
        begins = _BEGINS_NUMBERS.match(line.lstrip(AROUND)) if kinds[0] == "number" else _DIGIT.search(line)
        if begins or self._has_number(line):
            return False
        cells = zip(self._layout.cells(line), kinds, strict=False)
        return not all(is_missing(cell) for cell, kind in cells if kind in ("number", "moment"))

    def _has_number(self, line: str) -> bool:
        layout = self._layout
        return any(is_number(cell, decimal_comma=layout.decimal_comma) for cell in layout.cells(line))

    def _read_rows(self, rows: Sequence[tuple[int, str]]) -> None:
        """Adds a chunk to the columns, by numpy where all of it is plain numbers."""
        if not rows:
            return
        columns = list(self._parts)
        parsed = self._parse(rows, columns) if columns else None
        if parsed is not None:
            for index, column in enumerate(columns):
                self._parts[column].append(parsed[:, index].copy())
            columns = []
        cells = {}
        if columns or self._moments:  # empty where a row is too short
            table = split_all([line for _, line in rows], self._layout.separator)
            for column in (*columns, *self._moments):
                cells[column] = [row[column].strip() if column < len(row) else "" for row in table]
        for column in columns:
            self._add_numbers(column, cells[column], rows)
        for column, moments in list(self._moments.items()):
            wrong = moments.add(["" if is_missing(cell) else cell for cell in cells[column]])
            if wrong is not None:
                self._refuse(column, rows[wrong][0], cells[column][wrong])

    def _refuse(self, column: int, line: int, cell: str, either: str = "") -> None:
        """Gives a column up for a cell that is none of its kind, or may be either of two numbers."""
        kind = "date or time" if column in self._moments else "number"
        what, remedy = f"D080 In line {line} `{cell}` is no {kind}.", "Correct or delete this line."
        if either:
            what = f"D081 In line {line} `{cell}` may be {either}."
            remedy = 'Say so by `dialect: {decimal: "."}` or `{decimal: ","}`.'
        self._found.unreadable[self._names[column]] = Reason(what, remedy)
        self._parts.pop(column, None)
        self._moments.pop(column, None)

    def _parse(self, rows: Sequence[tuple[int, str]], columns: Sequence[int]) -> NDArray[np.float64] | None:
        layout = self._layout
        quoted = any('"' in line for _, line in rows)
        if layout.decimal_comma and layout.separator == ",":
            return None
        marks = {layout.groups[column].replace("?", ",") for column in columns} - {""} if layout.groups else set()
        marks -= set() if quoted else {layout.separator}
        if any(mark in line for mark in marks for _, line in rows):
            return None
        lines = (line.replace(",", ".") if layout.decimal_comma else line for _, line in rows)
        delimiter: Any = None if layout.separator == " " else layout.separator
        try:
            found = np.loadtxt(lines, delimiter=delimiter, usecols=columns, ndmin=2, comments=None, quotechar='"')
        except ValueError:
            return None
        # A quote that is not closed takes the lines behind it for text.
        return found if len(found) == len(rows) else None

    def _add_numbers(self, column: int, cells: Sequence[str], rows: Sequence[tuple[int, str]]) -> None:
        """Adds numbers cell by cell; gives the column up where one is none."""
        values = np.empty(len(cells))
        for index, cell in enumerate(cells):
            try:
                values[index] = self._value(cell, column)
            except ValueError:
                self._refuse(column, rows[index][0], cell)
                return
            if "," in cell and self._layout.is_open(cell, column):
                self._refuse(column, rows[index][0], cell, f"{without_groups(cell)} or {cell.replace(',', '.')}")
                return
            if (mark := repeated_mark(cell)) and self._layout.groups and self._layout.groups[column] != mark:
                either = f"{without_groups(cell)}, where `{mark}` is no decimal mark as in other numbers"
                self._refuse(column, rows[index][0], cell, either)
                return
        self._parts[column].append(values)

    def _value(self, cell: str, column: int) -> float:
        """The number of a cell; what is plain, as most are, is not looked at closely."""
        layout = self._layout
        groups = layout.groups[column] if layout.groups else ""
        if "_" not in cell and not (groups and groups in cell):  # Python takes `1_000` for a number
            try:
                return float(cell.replace(",", ".") if layout.decimal_comma else cell)
            except ValueError:
                pass
        return layout.number(cell, column)

    def _start(self, moments: Moments) -> tuple[int, int] | None:
        """The moment from which a column counts: the first of all that have dates as it has, or have none either."""
        dated = moments.kind in _DATED
        starts = [one.start() for one in self._moments.values() if (one.kind in _DATED) == dated]
        return min((start for start in starts if start is not None), default=None)

    def _finish(self, count: int) -> None:
        body, none = self._layout.body, np.zeros(0)
        values = {column: np.concatenate(parts or [none]) for column, parts in self._parts.items()}
        for column, moments in list(self._moments.items()):
            wrong = moments.first_wrong()
            if wrong is not None:
                what = f"D082 In its row {wrong + 1} is a date that there is not."
                self._found.unreadable[self._names[column]] = Reason(what, "Correct or delete this row.")
            else:
                start = self._start(moments)
                values[column] = moments.seconds(start)
                if start is not None and moments.kind != "minutes":
                    self._found.origins[self._names[column]] = origin_of(start, dated=moments.kind in _DATED)
        for column in dict.fromkeys([*self._asked, *self._made.values(), *self._shared.values()]):
            if column in values:
                done = body.finish(column, values[column], values.get(body.clocks.get(column, -1)))
                if column in self._asked:
                    self._found.arrays[self._names[column]] = done
                    self._found.sizes[self._names[column]] = len(done)
                for name in [name for name, of in self._shared.items() if of == column]:
                    self._found.add(name, done, self._layout.units[column])
                for name in [name for name, of in self._made.items() if of == column]:
                    self._found.add(name, body.make_time(name, done), "s")
        times = {name: self._layout.units[column] for name, column in body.shared.items()}
        for name, unit in (times | dict.fromkeys(body.made, "s")).items():
            if name not in self._found.arrays:
                self._found.mention(name, count, unit)
        if lost := body.damage(count):
            self._found.damage = Reason(f"D253 {lost}", "Check that it was copied completely.")
