"""Tells from the first lines of a table how it is written: delimiter, names, units, where its numbers begin."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from robid.logs.formats.variables import UnreadableLogError
from robid.signals.log_dialect import Dialect

_DELIMITERS = (";", "\t", ",", "|", " ")
_MISSING = ("", "na", "n/a", "null", "nan", "-", "--")
_TAIL = 30
"""Lines at the end of the sample by which the columns are told."""
_BRACKETS = re.compile(r"[\[(]([^\[\]()]*)[\])]\s*$")
_UNITS = re.compile(
    "m?s|[uµ]s|ns|min|[mk]?n[·*]?m|k?n|m?[av]|k?w|[mu]?rad|deg|°|(m?rad|deg|°|turns?|rev|counts?|m?m)/s([\\^²]2?)?|rpm|[1u]/min"
    "|[muµ]?m|turns?|rev|counts?|incr?|k?hz|%|-|°?c|nms/rad|1|bool"
)
REMEDY = "Write one line of column names, then one line of numbers per sample, separated by `,`, `;` or tabs."


@dataclass(frozen=True)
class Layout:
    """How a table is written.

    Attributes:
        separator: What separates cells; a space stands for any white space.
        decimal_comma: Whether decimal marks are commas.
        names: Names of the columns.
        units: Their units; empty where none is stated.
        lines: Lines before the first row.
        kinds: What each column holds: `number`, `moment` (date and time), or a text that is neither.
        width: Number of cells of a row; one more than there are columns where rows end with a separator.
    """

    separator: str
    decimal_comma: bool
    names: tuple[str, ...]
    units: tuple[str, ...]
    lines: int
    kinds: tuple[str, ...]
    width: int

    def cells(self, line: str) -> list[str]:
        """Returns the cells of a line."""
        return split(line, self.separator)

    def number(self, cell: str) -> float:
        """Returns the number of a cell, NaN where it is missing.

        Raises:
            ValueError: If it holds something else.
        """
        return _number(cell, decimal_comma=self.decimal_comma)


def split(line: str, separator: str) -> list[str]:
    """Splits a line into its cells, without quotes, within which separators are text."""
    line = line.strip("\r\n")
    parts = line.split() if separator == " " else line.split(separator)
    if '"' in line and separator != " " and len(line) < csv.field_size_limit():
        parts = next(csv.reader([line], delimiter=separator, skipinitialspace=True))
    return [part.strip().strip('"').strip() for part in parts]


def is_row(line: str, comments: Sequence[str]) -> bool:
    """Whether a line is neither empty nor a comment."""
    return not line.isspace() and bool(line) and not line.startswith(tuple(comments))


def tell_layout(lines: Sequence[str], dialect: Dialect) -> Layout:
    """Tells the layout of a table from its first lines; what the dialect states goes first.

    Raises:
        UnreadableLogError: If they are no table.
    """
    if any("\x00" in line for line in lines):
        raise UnreadableLogError("The log cannot be read as text (it holds bytes that are none).", REMEDY)
    rows = [(i, line) for i, line in enumerate(lines) if is_row(line, dialect.comments)]
    if dialect.header_line:
        rows = [(i, line) for i, line in rows if i + 1 >= dialect.header_line]
    tail = [line for _, line in rows[-_TAIL:]]
    separator = dialect.separator or _tell_separator(tail, dialect.decimal)
    comma = dialect.decimal == "," if dialect.decimal else separator != ","
    cells = [(i, split(line, separator)) for i, line in rows]
    told = [c for _, c in cells[-_TAIL:]]
    numeric = [c for c in told if any(_is_number(cell, comma) for cell in c)]
    if not numeric:
        raise UnreadableLogError("The log holds no table.", REMEDY)
    width = Counter(map(len, numeric)).most_common(1)[0][0]
    numeric = [c for c in numeric if len(c) == width]
    kinds = tuple(_kind([c[column] for c in numeric], comma) for column in range(width))
    stated = dialect.header_line
    is_first = (at for at, (_, c) in enumerate(cells) if _fits(c, kinds, comma) and at >= bool(stated))
    first = next(is_first, len(cells) - len(told))
    before = [] if stated == 0 else cells[:first]
    if before and not stated and len(before[-1][1]) == 1 < width:
        before = []  # a line of text above the numbers, no names
    fewest = width - (kinds[-1] == "")
    names, units, header = _names(before, (fewest, width), lines, dialect, separator, cells[first][0])
    if kinds[-1] == "" and len(names) == width - 1:
        kinds = kinds[:-1]
    if len(names) != len(kinds):
        raise _no_fit(cells[first][0], width, len(names), header)
    return Layout(separator, comma, tuple(names), tuple(units), cells[first][0], kinds, width)


def _no_fit(line: int, width: int, count: int, header: int) -> UnreadableLogError:
    what = f"line {line + 1}: The table is broken: {width} values for {count} columns of line {header + 1}."
    remedy = "Correct that line, or set `dialect: {header_line: 0}`: columns are then named by their numbers, from 1."
    return UnreadableLogError(what, remedy)


def _tell_separator(lines: Sequence[str], decimal: str | None) -> str:
    """The separator that makes the most numbers in rows of one length; white space for a single column."""
    best, found = 0.0, " "
    for separator in _DELIMITERS:
        cells = [split(line, separator) for line in lines]
        comma = decimal == "," if decimal else separator != ","
        rows = [c for c in cells if len(c) > 1 and any(_is_number(cell, comma) for cell in c)]
        if not rows:
            continue
        width = Counter(map(len, rows)).most_common(1)[0][0]
        alike = [c for c in rows if len(c) == width]
        numbers = sum(_is_number(cell, comma) or cell.lower() in _MISSING for c in alike for cell in c)
        score = len(alike) / len(cells) * numbers / (width * len(alike))
        if score > best + 1e-9:
            best, found = score, separator
    return found


def _kind(cells: Sequence[str], comma: bool) -> str:
    """What a column holds: `number`, `moment`, an example of its text, or nothing at all."""
    numbers = sum(_is_number(cell, comma) for cell in cells)
    missing = sum(cell.lower() in _MISSING for cell in cells)
    if numbers and 2 * (numbers + missing) >= len(cells):
        return "number"
    texts = [cell for cell in cells if cell and not _is_number(cell, comma)]
    if texts and all(_is_moment(cell) for cell in texts):
        return "moment"
    return texts[-1] if texts else ""


def _fits(cells: Sequence[str], kinds: Sequence[str], comma: bool) -> bool:
    """Whether a line is a row of the table: a number, or nothing, wherever a column has numbers."""
    if len(cells) != len(kinds):
        return False
    numbers = [cell for cell, kind in zip(cells, kinds, strict=True) if kind == "number"]
    moments = [cell for cell, kind in zip(cells, kinds, strict=True) if kind == "moment"]
    return (
        all(_is_number(cell, comma) or cell.lower() in _MISSING for cell in numbers)
        and any(_is_number(cell, comma) for cell in numbers)
        and all(_is_moment(cell) for cell in moments)
    )


def _names(
    before: list[tuple[int, list[str]]],
    widths: tuple[int, int],
    lines: Sequence[str],
    dialect: Dialect,
    separator: str,
    first: int,
) -> tuple[list[str], list[str], int]:
    """Names and units of the columns by the lines before the first row, and the line that they stand in."""
    width = widths[1]
    if not before:
        commented = None if dialect.header_line == 0 else _commented(lines[:first], widths, dialect, separator)
        names = commented or [str(i) for i in range(1, width + 1)]
        return names, _units(names), first
    if dialect.header_line:
        at = 0
    else:
        at = len(before) - 1
        above = at > 0 and len(before[at - 1][1]) == len(before[at][1])
        if above and _are_units(before[at][1]):
            at -= 1
    line, names = before[at]
    if separator == " " and len(names) != width:
        names = split(lines[line], "\t") if "\t" in lines[line] else names
    below = before[at + 1][1] if at + 1 < len(before) else []
    units = _units(names)
    if len(below) == len(names) and _are_units(below):
        units = [stated.strip("[]() ") or unit for stated, unit in zip(below, units, strict=True)]
    if names and not names[-1] and len(names) == width:
        names, units = names[:-1], units[:-1]
    return [name or str(i) for i, name in enumerate(names, start=1)], units, line


def _commented(lines: Sequence[str], widths: tuple[int, int], dialect: Dialect, separator: str) -> list[str] | None:
    """Names in the last comment before the first row, as numpy and gnuplot write them; the last one may be empty."""
    comments = [line for line in lines if line.startswith(tuple(dialect.comments))]
    if not comments:
        return None
    mark = next(mark for mark in dialect.comments if comments[-1].startswith(mark))
    names = split(comments[-1].removeprefix(mark).strip(), separator)
    names = names[:-1] if names and not names[-1] else names
    return names if widths[0] <= len(names) <= widths[1] and all(names) else None


def _units(names: Sequence[str]) -> list[str]:
    """Units in brackets at the end of names."""
    return [found[1].strip() if (found := _BRACKETS.search(name)) else "" for name in names]


def _are_units(cells: Sequence[str]) -> bool:
    """Whether cells are units, mostly."""
    stated = [cell for cell in cells if cell]
    known = [
        cell for cell in stated if _UNITS.fullmatch(cell.strip("[]() ").lower().replace(" ", "")) or cell[0] in "[("
    ]
    return bool(stated) and 2 * len(known) >= len(stated)


def _number(cell: str, *, decimal_comma: bool) -> float:
    if cell.lower() in _MISSING:
        return float("nan")
    if "_" in cell:
        raise ValueError(cell)
    return float(cell.replace(",", ".") if decimal_comma else cell)


def _is_number(cell: str, comma: bool) -> bool:
    try:
        return cell.lower() not in _MISSING and _number(cell, decimal_comma=comma) is not None
    except ValueError:
        return False


def _is_moment(cell: str) -> bool:
    try:
        return datetime.fromisoformat(cell) is not None
    except ValueError:
        return False
