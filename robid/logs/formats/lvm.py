"""Reads the head of a LabVIEW measurement file, whose data come in segments with heads of their own."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from robid.arrays import FloatArray
from robid.logs.formats.cells import is_number, number, split
from robid.logs.formats.layout import Body, Layout
from robid.logs.formats.moments import Moments
from robid.logs.formats.telling import tell_kinds

_START, _X, _COMMENT = "LabVIEW Measurement", "X_Value", "Comment"
_SEPARATORS = {"Tab": "\t", "Comma": ",", "Semicolon": ";"}
_SPECIAL = ("***Start_Special***", "***End_Special***")
_HALF = 0.5


def tell_lvm(lines: Sequence[str]) -> Layout | None:
    """Tells the layout of a LabVIEW measurement file; None where it is none, or holds no data.

    Args:
        lines: The first lines of a table.
    """
    if not lines or not lines[0].startswith(_START):
        return None
    mark = _mark(lines)
    cells = [split(line, mark) for line in lines]
    at = next((i for i, row in enumerate(cells) if row[0] == _X), None)
    if at is None:
        return None
    told = {row[0]: row[1:] for row in cells[:at] if row[0]}
    comma = told.get("Decimal_Separator", [","])[0] == "," and mark != ","
    names = [name or str(column) for column, name in enumerate(_without_comment(cells[at]), start=1)]
    rows = [row for row in cells[at + 1 :] if _is_data(row, comma=comma)]
    if not rows:
        return None
    width = max(map(len, rows))
    if "No" in told.get("X_Columns", ["One"])[:1] and width < len(names):
        names = names[1:]  # without even the empty column of x
    full = [row + [""] * (len(names) - len(row)) for row in rows]
    kinds = tell_kinds(full[-30:], full, comma=comma)[: len(names)]
    body = _Body(names, kinds, cells[: at + 1], mark, comma=comma)
    units = tuple(body.unit(column) for column in range(len(names)))
    # The last cells of a row may be left out: the comment, and a separator at its end.
    longest = max(len(names) + 2, width)
    return Layout(mark, comma, body.names, units, at + 1, kinds, longest, fewest=len(names), body=body)


def _without_comment(row: Sequence[str]) -> Sequence[str]:
    """The names of the columns: the last one is that of comments, behind which a line may end with a separator."""
    last = max(column for column, name in enumerate(row) if name)
    return row[:last] if row[last] == _COMMENT else row[: last + 1]


def _mark(lines: Sequence[str]) -> str:
    """What separates cells: what the head says, in a line that it separates itself."""
    for line in lines[:30]:
        found = re.match(r"Separator(.)(\w+)", line)
        if found:
            return _SEPARATORS.get(found[2], found[1])
    return "\t"


def _is_data(row: Sequence[str], *, comma: bool) -> bool:
    """Whether a row has data: a number or nothing at first, and some number."""
    if row[0] and not is_number(row[0], decimal_comma=comma):
        return False
    return any(is_number(cell, decimal_comma=comma) for cell in row)


@dataclass
class _Segment:
    """A part of the data, with what its head says of each column.

    Attributes:
        first: Its first row.
        told: Rows of its head by their names, the cells by column.
    """

    first: int
    told: dict[str, list[str]] = field(default_factory=dict)

    def text(self, key: str, above: int) -> str:
        """What a row says in the cell above a column."""
        row = self.told.get(key, [])
        return row[above] if above < len(row) else ""

    def number(self, key: str, above: int) -> float:
        """The number that a row says above a column; 0 where it says none."""
        cell = self.text(key, above)
        return number(cell, decimal_comma=True) if is_number(cell, decimal_comma=True) else 0.0

    def moment(self, above: int) -> str:
        """Date and time of the first sample of a column; nothing where they are not said."""
        date, time = self.text("Date", above), self.text("Time", above)
        return f"{date} {time}".strip() if time else ""


class _Body(Body):
    """Segments of data with a time in one column, in one for each channel, or in none."""

    def __init__(
        self, names: Sequence[str], kinds: Sequence[str], head: Sequence[list[str]], mark: str, *, comma: bool
    ) -> None:
        self._mark, self._comma, self._count, self._special = mark, comma, 0, False
        self._head: _Segment | None = _Segment(0)
        self._segments = [self._head]
        start = next((i for i, row in enumerate(head) if row[0].startswith("***End_of_Header")), 0)
        for row in head[start:]:
            self._read_head(row)
        x = [column for column, name in enumerate(names) if name == _X]
        # What a head says stands above the channels; the first column, of x, may be missing below it.
        self._above = [column + (0 not in x) + (column in x) for column in range(len(names))]
        self._is_time = self._segments[0].text("X_Dimension", self._above[-1]) in ("", "Time")
        self._x = frozenset(column for column in x if kinds[column] == "number")
        follows = {column: max((one for one in x if one <= column), default=-1) for column in range(len(names))}
        self.clocks = {column: one for column, one in follows.items() if one in self._x and one != column}
        own = [
            f"{names[column + 1]}.time" if column in x[len(x) < 2 :] and len(x) > 1 else name
            for column, name in enumerate(names)
        ]
        self.names = tuple(own)
        self.made = {} if self._x or not self._is_time else self._made_times(kinds)

    def _made_times(self, kinds: Sequence[str]) -> dict[str, int]:
        """Times by the steps that the head states, where no column has them."""
        steps = {
            column: self._segments[0].number("Delta_X", self._above[column])
            for column, kind in enumerate(kinds)
            if kind == "number"
        }
        if not all(steps.values()):
            return {}
        if len(set(steps.values())) == 1:
            return {"time": next(iter(steps))}
        return {f"{self.names[column]}.time": column for column in steps}

    def unit(self, column: int) -> str:
        """The unit of a column; that of a time is the second."""
        if column in self._x:
            return "s" if self._is_time else ""
        return self._segments[0].text("Y_Unit_Label", self._above[column])

    def keep(self, rows: list[tuple[int, str]]) -> list[tuple[int, str]]:
        """The rows of data; the heads of further segments are read."""
        kept = []
        for numbered in rows:
            first = numbered[1].partition(self._mark)[0].strip()
            plain = not first or first[0] in "0123456789-+." or is_number(first, decimal_comma=self._comma)
            if plain and self._head is None and not self._special:
                kept.append(numbered)
                self._count += 1
            else:
                self._read_head(split(numbered[1], self._mark))
        return kept

    def _read_head(self, row: list[str]) -> None:
        """Reads a line of a head, up to the names of the columns."""
        if row[0] in _SPECIAL:
            self._special = row[0] == _SPECIAL[0]
        elif row[0] == _X:
            self._head = None
        elif row[0] and not self._special:
            if self._head is None:
                self._head = _Segment(self._count)
                self._segments.append(self._head)
            self._head.told[row[0]] = row

    def finish(self, column: int, values: FloatArray, time: FloatArray | None) -> FloatArray:
        """The samples of a channel, or of a time, which goes on where it begins again with a segment."""
        if column in self._x:
            values = self._joined(values, [one.first for one in self._segments], column)
            clock = values
        elif time is not None:
            clock = time
        else:
            counts = self._counts(column, len(values))
            firsts = [one.first for one in self._segments]
            return np.concatenate([values[i : i + n] for i, n in zip(firsts, counts, strict=True)])
        return values[np.isfinite(clock)] if len(self._x) > 1 else values

    def _counts(self, column: int, n_row: int) -> list[int]:
        """How many samples of a column each segment has; its head tells where it has as many rows as that says."""
        stops = [*(one.first for one in self._segments[1:]), n_row]
        counts = []
        for one, stop in zip(self._segments, stops, strict=True):
            rows = stop - one.first
            said = int(one.number("Samples", self._above[column]))
            most = max(int(one.number("Samples", above)) for above in self._above)
            counts.append(said if rows == most else rows)
        return counts

    def make_time(self, name: str, values: FloatArray) -> FloatArray:
        """A time by the steps that the heads state."""
        column = self.made[name]
        counts = self._counts(column, self._count)
        above = self._above[column]
        parts = [
            one.number("X0", above) + one.number("Delta_X", above) * np.arange(count)
            for one, count in zip(self._segments, counts, strict=True)
        ]
        return self._joined(np.concatenate(parts)[: len(values)], [0, *np.cumsum(counts)[:-1].tolist()], column)

    def _joined(self, time: FloatArray, firsts: Sequence[int], column: int) -> FloatArray:
        """A time that goes on from segment to segment, by the moments at which these begin.

        Segments follow each other without a gap where the moments differ by no more than they are rounded to.
        """
        joined, above = time.copy(), self._above[column]
        for one, first, stop in zip(self._segments, firsts, [*firsts[1:], len(time)], strict=True):
            before = joined[:first][np.isfinite(joined[:first])]
            if not 0 < first < len(time) or not len(before) or time[first] > before[-1]:
                continue
            step = one.number("Delta_X", above) or self._segments[0].number("Delta_X", above)
            moments, next_s = Moments(), float(before[-1]) + step
            begins = [self._segments[0].moment(above), one.moment(above)]
            if not all(begins) or moments.add(begins) is not None or moments.first_wrong() is not None:
                continue
            start = float(moments.seconds()[1] + time[first])
            rounded = 10.0 ** -len(re.sub(r".*[.,]|.*:\d+$", "", begins[1]))
            if abs(start - next_s) <= max(_HALF * step, rounded):
                start = next_s
            joined[first:stop] += start - time[first]
        return joined

    def damage(self, count: int) -> str:
        """Says where the last segment has fewer rows than its head states."""
        last = self._segments[-1]
        said = max(int(last.number("Samples", above)) for above in self._above)
        rows = count - last.first
        return f"Its last part has {rows} of the {said} rows that its head states." if 0 < rows < said else ""
