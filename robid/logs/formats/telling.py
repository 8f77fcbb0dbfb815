"""Tells from the first lines of a table how it is written: delimiter, names, units, where its numbers begin."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from robid.logs.formats.layout import (
    AROUND,
    Join,
    Layout,
    has_decimal_commas,
    is_missing,
    is_number,
    is_row,
    split,
    tell_groups,
)
from robid.logs.formats.moments import is_moment
from robid.logs.formats.unpacking import UnreadableLogError
from robid.signals.log_options import Dialect

_DELIMITERS = (";", "\t", ",", "|", " ")
_TAIL = 30  # lines at the end of the sample by which the columns are told
_MOST_ABOVE = 4  # rows of numbers above a table, as of a matrix
_FEWEST_CELLS = 2  # of what looks like a row
_BRACKETS = re.compile(r"[\[(]([^\[\]()]*)[\])]\s*$")
_UNITS = re.compile(
    "m?s|[uµ]s|ns|min|[mk]?n[·*]?m|k?n|m?[av]|k?w|[mu]?rad|deg|°|(m?rad|deg|°|turns?|rev|counts?|m?m)/s([\\^²]2?)?|rpm|[1u]/min"
    "|[muµ]?m|turns?|rev|counts?|incr?|k?hz|%|-|°?c|nms/rad|1|bool"
)
_UNEQUAL = "Correct that line, or set `dialect: {header_line: 0}`: columns are then named by numbers, from 1."
REMEDY = "Write one line of column names, then one line of numbers per sample, separated by `,`, `;` or tabs."
_JOINS = {
    " ": Join(re.compile(r"(?<=\d[-/.]\d\d)\s+(?=\d{1,2}:\d\d)|(?<=[-/.]\d{4})\s+(?=\d{1,2}:\d\d)"), "T"),
    ",": Join(re.compile(r"(?<=\d:\d\d:\d\d),(?=\d{3,6}(,|\s*$))"), "."),
}
"""By the separator: between a date and a time, and before the fraction of a second."""


def tell_layout(lines: Sequence[str], dialect: Dialect) -> Layout:
    """Tells the layout of a table from its first lines; what the dialect states goes first.

    Raises:
        UnreadableLogError: If they are no table.
    """
    if any("\x00" in line for line in lines):
        raise UnreadableLogError("D083 The log cannot be read as text (it contains bytes that are none).", REMEDY)
    rows = [(i, line) for i, line in enumerate(lines) if is_row(line, dialect.comments)]
    if dialect.header_line:
        rows = [(i, line) for i, line in rows if i + 1 >= dialect.header_line]
    # The end, and some rows before: a signal that ended on whole numbers has no decimal marks there.
    later = rows[len(rows) // 2 : -_TAIL]
    some = [*later[:: max(1, len(later) // _TAIL)], *rows[-_TAIL:]]
    separator, comma = tell_marks([line for _, line in some], dialect)
    cells = [(i, split(line, separator)) for i, line in rows]
    numeric = [c for _, c in cells[-_TAIL:] if any(is_number(cell, decimal_comma=comma) for cell in c)]
    if not numeric:
        raise UnreadableLogError("D084 The log contains no table.", REMEDY)
    width = Counter(map(len, numeric)).most_common(1)[0][0]
    kinds = tell_kinds([c for c in numeric if len(c) == width], [c for _, c in cells if len(c) == width], comma=comma)
    stated = dialect.header_line
    is_first = (at for at, (_, c) in enumerate(cells) if fits(c, kinds, comma=comma) and at >= bool(stated))
    first = _begin(cells, next(is_first, max(len(cells) - _TAIL, 0)), width, bool(stated))
    before = [] if stated == 0 else cells[:first]
    # A line of text above the numbers has no names.
    before = [] if before and not stated and len(before[-1][1]) == 1 < width else before
    fewest = width - (kinds[-1] == "")
    start = cells[first][0]
    names, units, header = _names(before, (fewest, width), lines, dialect, separator, start)
    if kinds[-1] == "" and len(names) == width - 1:
        kinds = kinds[:-1]
    join = _JOINS.get(separator)
    if len(names) == len(kinds) - 1 and join is not None and "moment" in kinds:
        joined = [join(line) for line in lines]
        if joined != list(lines):
            return replace(tell_layout(joined, dialect), join=join)
    if len(names) != len(kinds):
        told = f"line {start + 1}: The table is broken: {width} values for {len(names)} columns of line {header + 1}."
        raise UnreadableLogError(f"D085 {told}", _UNEQUAL)
    headers = frozenset(
        line.strip(AROUND) for line in lines[:start] if not fits(split(line, separator), kinds, comma=comma)
    )
    groups = _groups([c for _, c in cells[first:] if len(c) == width], len(kinds), dialect)
    return Layout(separator, comma, tuple(names), tuple(units), start, kinds, width, headers=headers, groups=groups)


def _begin(cells: Sequence[tuple[int, list[str]]], first: int, width: int, named: bool) -> int:
    """Where rows begin, at or above the first one that fits: what looks like one above is read, and refused, as one.

    Raises:
        UnreadableLogError: If there are more rows of numbers above, of another table.
    """
    while first > named and len(cells[first - 1][1]) == width and _looks_like_a_row(cells[first - 1][1]):
        first -= 1
    alike = 0
    for at in range(named, first):
        alike = alike + 1 if _looks_like_a_row(cells[at][1]) else 0
        if alike > _MOST_ABOVE:
            begin, end = cells[at - alike + 1][0] + 1, cells[first][0]
            told = f"line {begin}: Rows of numbers stand above the table that begins after line {end}."
            remedy = f"Make it two logs, or read the later part alone by `dialect: {{header_line: {end}}}`."
            raise UnreadableLogError(f"D654 {told}", remedy)
    return first


def _looks_like_a_row(cells: Sequence[str]) -> bool:
    """Whether a line is a row for the most part, whatever its decimal mark, and no words before numbers."""
    if len(cells) < _FEWEST_CELLS or (cells[0][:1].isalpha() and not is_missing(cells[0])):
        return False
    numbers = sum(is_number(cell, decimal_comma=False) or is_number(cell, decimal_comma=True) for cell in cells)
    missing = sum(map(is_missing, cells))
    return any(cells) and 2 * (numbers + missing) >= len(cells) and (numbers > 0 or missing == len(cells))


def _groups(rows: Sequence[Sequence[str]], count: int, dialect: Dialect) -> tuple[str, ...]:
    """The mark of thousands of each column: what is stated not to be that of decimals, else what the numbers tell."""
    if dialect.decimal is not None:
        return ("." if dialect.decimal == "," else ",",) * count
    return tell_groups([[row[column] for row in rows] for column in range(count)])


def tell_marks(lines: Sequence[str], dialect: Dialect) -> tuple[str, bool]:
    """What separates cells, and whether decimal marks are commas.

    Those that make the most numbers in rows of one length; white space for a single column.
    """
    comma = dialect.decimal == "," if dialect.decimal else dialect.separator != ","
    best, found = 0.0, (dialect.separator or " ", comma)
    for separator in (dialect.separator,) if dialect.separator else _DELIMITERS:
        cells = [split(line, separator) for line in lines]
        for comma in _decimal_commas(cells, separator, dialect):
            rows = [c for c in cells if len(c) > 1 and any(is_number(cell, decimal_comma=comma) for cell in c)]
            if not rows:
                continue
            width = Counter(map(len, rows)).most_common(1)[0][0]
            alike = [c for c in rows if len(c) == width]
            numbers = sum(is_number(cell, decimal_comma=comma) or is_missing(cell) for c in alike for cell in c)
            score = len(alike) / len(cells) * numbers / (width * len(alike))
            if score > best + 1e-9:
                best, found = score, (separator, comma)
    return found


def _decimal_commas(cells: Sequence[Sequence[str]], separator: str, dialect: Dialect) -> tuple[bool, ...]:
    """Whether decimal marks may be commas: also between commas, where quotes tell them apart."""
    if dialect.decimal:
        return (dialect.decimal == ",",)
    if separator != ",":
        return (True,)
    return (False, True) if has_decimal_commas([cell for row in cells for cell in row]) else (False,)


def tell_kinds(tail: Sequence[Sequence[str]], rows: Sequence[Sequence[str]], *, comma: bool) -> tuple[str, ...]:
    """Tells what each column holds, mostly by the last rows; by all that were looked at where it is empty in these."""
    kinds = [_kind([row[column] for row in tail], comma) for column in range(len(tail[0]))]
    for column in [column for column, kind in enumerate(kinds) if not kind]:
        cells = [row[column] for row in rows]
        if any(is_number(cell, decimal_comma=comma) for cell in cells):
            kinds[column] = "number"
        elif any(map(is_moment, cells)):
            kinds[column] = "moment"
    return tuple(kinds)


def _kind(cells: Sequence[str], comma: bool) -> str:
    """What a column holds: `number`, `moment`, an example of its text, or nothing at all."""
    numbers = sum(is_number(cell, decimal_comma=comma) for cell in cells)
    missing = sum(map(is_missing, cells))
    if numbers and 2 * (numbers + missing) >= len(cells):
        return "number"
    texts = [cell for cell in cells if not (is_missing(cell) or is_number(cell, decimal_comma=comma))]
    if texts and all(map(is_moment, texts)):
        return "moment"
    return texts[-1] if texts else ""


def fits(cells: Sequence[str], kinds: Sequence[str], *, comma: bool) -> bool:
    """Whether a line is a row of the table: a number, or nothing, wherever a column has numbers."""
    if len(cells) != len(kinds):
        return False
    numbers = [cell for cell, kind in zip(cells, kinds, strict=True) if kind == "number"]
    moments = [cell for cell, kind in zip(cells, kinds, strict=True) if kind == "moment"]
    return (
        all(is_number(cell, decimal_comma=comma) or is_missing(cell) for cell in numbers)
        and any(is_number(cell, decimal_comma=comma) for cell in numbers)
        and all(is_moment(cell) or is_missing(cell) for cell in moments)
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
        return names, units_of(names), first
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
    units = units_of(names)
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


def units_of(names: Sequence[str]) -> list[str]:
    """Units in brackets at the end of names; a number is an index, and what differs behind one name tells joints."""
    found = [_BRACKETS.search(name) for name in names]
    inside = ["" if one is None else one[1].strip() for one in found]
    stems = [name if one is None else name[: one.start()] for name, one in zip(names, found, strict=True)]
    behind: dict[str, set[str]] = {}
    for stem, text in zip(stems, inside, strict=True):
        behind.setdefault(stem, set()).add(text)
    labels = {stem for stem, texts in behind.items() if len(texts) > 1 and not any(map(_is_unit, texts))}
    return ["" if one.isdigit() or stem in labels else one for stem, one in zip(stems, inside, strict=True)]


def _is_unit(text: str) -> bool:
    return bool(_UNITS.fullmatch(text.strip("[]() ").lower().replace(" ", "")))


def _are_units(cells: Sequence[str]) -> bool:
    stated = [cell for cell in cells if cell]
    known = [cell for cell in stated if _is_unit(cell) or cell[0] in "[("]
    return bool(stated) and 2 * len(known) >= len(stated)
