"""Recorders whose tables of text have a head that says more than names: LabVIEW's LVM and TwinCAT 3 Scope."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from robid.arrays import FloatArray
from robid.logs.formats.layout import Body, Layout, is_missing, is_number, number, split
from robid.logs.formats.moments import Moments, is_moment
from robid.logs.formats.telling import tell_kinds

_START, _X, _COMMENT = "LabVIEW Measurement", "X_Value", "Comment"
_SEPARATORS = {"Tab": "\t", "Comma": ",", "Semicolon": ";"}
_SPECIAL = ("***Start_Special***", "***End_Special***")
_HALF = 0.5


def tell_lvm(lines: Sequence[str]) -> Layout | None:
    """Tells the layout of a LabVIEW measurement file by its first lines; None where it is none, or holds no data."""
    if not lines or not lines[0].startswith(_START):
        return None
    mark = _mark(lines)
    cells = [split(line, mark) for line in lines]
    at = next((i for i, row in enumerate(cells) if row[0] == _X), None)
    if at is None:
        return None
    told = {row[0]: row[1:] for row in cells[:at] if row[0]}
    comma = told.get("Decimal_Separator", [","])[0] == "," and mark != ","
    # The last name is that of comments, behind which a line may end with a separator.
    last = max(column for column, name in enumerate(cells[at]) if name)
    named = cells[at][: last + (cells[at][last] != _COMMENT)]
    names = [name or str(column) for column, name in enumerate(named, start=1)]
    rows = [row for row in cells[at + 1 :] if _is_data(row, comma=comma)]
    if not rows:
        return None
    width = max(map(len, rows))
    if "No" in told.get("X_Columns", ["One"])[:1] and width < len(names):
        names = names[1:]  # without even the empty column of x
    full = [row + [""] * (len(names) - len(row)) for row in rows]
    kinds = tell_kinds(full[-30:], full, comma=comma)[: len(names)]
    body = _SegmentedBody(names, kinds, cells[: at + 1], mark, comma=comma)
    units = tuple(body.unit(column) for column in range(len(names)))
    # The last cells of a row may be left out: the comment, and a separator at its end.
    longest = max(len(names) + 2, width)
    return Layout(mark, comma, body.names, units, at + 1, kinds, longest, fewest=len(names), body=body)


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
    """A part of the data: its first row, and the rows of its head by their names, the cells by column."""

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


class _SegmentedBody(Body):
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
        timed = x if len(x) > 1 else []
        self.names = tuple(f"{names[i + 1]}.time" if i in timed else name for i, name in enumerate(names))
        if self._is_time and not self._x:
            numbers = [column for column, kind in enumerate(kinds) if kind == "number"]
            steps = {one: self._segments[0].number("Delta_X", self._above[one]) for one in numbers}
            self.made = _times_by_steps(self.names, steps)

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


def _times_by_steps(names: Sequence[str], steps: Mapping[int, float]) -> dict[str, int]:
    """Times that stand in no column, by the steps that a head states of columns; none where it does not of one."""
    if not all(steps.values()):
        return {}
    if len(set(steps.values())) == 1:
        return {"time": next(iter(steps))}
    return {f"{names[column]}.time": column for column in steps}


# Rows of the head that name the channels; where they have a time, the row's own name stands above it
_NAMES = ("Name", "SymbolName")
_STEP = re.compile(r"SampleTime(\[ms\])?")
_BEGINNINGS = ("starttime of export", "start time of export")
_HEAD, _LAST = 60, 30
"""Lines in which the head is looked for, and those by which columns are recognized."""

_TICKS = 1e15  # times from here on are no milliseconds since the first sample, but 100 ns since the year 1601

_MS, _TICK_S = 1e-3, 1e-7


def tell_twincat(lines: Sequence[str]) -> Layout | None:
    """Tells the layout of an export of TwinCAT 3 Scope by its first lines; None where it is none."""
    head = [line for line in lines[:_HEAD] if not line.isspace()]
    is_export = any(_STEP.match(line) or line.lower().startswith(_BEGINNINGS) for line in head)
    # What separates cells stands behind the name of the first row.
    marks = (line[len(name)] for line in head for name in _NAMES if re.match(rf"{name}[\t;,: ]", line))
    mark = next(marks, "")
    cells = [split(line, mark) for line in lines] if mark and is_export else []
    at, names = _named(cells)
    comma = mark != ","
    start = next((i for i in range(at + 1, len(cells)) if _is_first(cells[i], comma)), None)
    if not names or start is None:
        return None
    timed = [i for i, name in enumerate(names) if name == names[0]]
    rows = [row for row in cells[start:] if any(row[1:])]
    width = max(map(len, rows))
    has_times = width >= len(names)
    columns = [i for i in range(len(names)) if has_times or i not in timed]
    if not len(columns) <= width <= len(columns) + 1:
        return None
    full = [row + [""] * (width - len(row)) for row in rows]
    kinds = tell_kinds(full[-_LAST:], full, comma=comma)[: len(columns)]
    whole = (row for row in cells[at:start] if len(row) >= len(names) and all(row[i] == row[0] for i in timed))
    told = {row[0]: row for row in whole}
    cells_of_times = [full[0][i] for i in timed] if has_times else []
    ticks = [float(cell.replace(",", ".")) for cell in cells_of_times if is_number(cell, decimal_comma=comma)]
    body = _ExportBody(names, columns, told, kinds, times=has_times, begun=min(ticks, default=0.0))
    units = tuple(body.unit(column) for column in range(len(columns)))
    # Slow groups end above the others, by empty cells or by shorter rows.
    fewest = 1 if not has_times else 2 if len(timed) > 1 else width
    return Layout(mark, comma, body.names, units, start, kinds, width, fewest=fewest, body=body)


def _named(cells: Sequence[Sequence[str]]) -> tuple[int, list[str]]:
    """The row that names the channels: the widest with the name of such a row, which may stand there several times."""
    rows = [(len(row), -i) for i, row in enumerate(cells) if len(row) > 1 and row[0] in _NAMES]
    # The file's own name stands in a row of two cells above.
    rows = [one for one in rows if one[0] > 2] or rows[-1:]
    if not rows:
        return 0, []
    by_name = [one for one in rows if cells[-one[1]][0] == _NAMES[0]] or rows
    at = -max(by_name)[1]
    names = list(cells[at])
    while names and not names[-1]:
        names.pop()
    return at, names


def _is_first(row: Sequence[str], comma: bool) -> bool:
    """Whether a line has numbers only, or moments before them."""
    told = [cell for cell in row if not is_missing(cell)]
    numbers = [cell for cell in told if is_number(cell, decimal_comma=comma)]
    return len(told) > 1 and bool(numbers) and all(cell in numbers or is_moment(cell) for cell in told)


class _ExportBody(Body):
    """Groups of channels, each with a clock of its own; slow ones end above the others or repeat their samples."""

    def __init__(
        self,
        heads: Sequence[str],
        columns: Sequence[int],
        told: Mapping[str, Sequence[str]],
        kinds: Sequence[str],
        *,
        times: bool,
        begun: float = 0.0,
    ) -> None:
        self._told, self._columns, self._kinds, self._begun = told, columns, kinds, begun
        is_time = [heads[column] == heads[0] for column in columns]
        names, groups = [heads[column] for column in columns], sum(is_time)
        clocks = {}
        for column, timed in enumerate(is_time):
            if timed:
                names[column] = f"{names[column + 1]}.time" if groups > 1 and column + 1 < len(names) else "time"
                clock = column
            elif times:
                clocks[column] = clock
        self.names, self.clocks = tuple(names), clocks
        if groups > 1:
            # Whoever looks for the time of a channel looks for it by the channel's name.
            self.shared = {f"{names[c]}.time": t for c, t in clocks.items() if names[t] != f"{names[c]}.time"}
        if not times:
            self.made = _times_by_steps(self.names, {one: self._step(one) for one in range(len(columns))})

    def _step(self, column: int) -> float:
        """The sampling period of a channel [s]; 0 where it is not stated."""
        cell = next((row[self._columns[column]] for key, row in self._told.items() if _STEP.fullmatch(key)), "")
        return _MS * float(cell.replace(",", ".")) if is_number(cell, decimal_comma=True) else 0.0

    def unit(self, column: int) -> str:
        """The unit of a column, without the name of its quantity."""
        if column in self.clocks.values():
            return "s" if self._kinds[column] == "moment" else "ms"
        stated = self._told.get("Unit", ())
        text = stated[self._columns[column]] if stated else ""
        return "" if text.startswith("(") else re.sub(r"\s*\(.*", "", text)

    def finish(self, column: int, values: FloatArray, time: FloatArray | None) -> FloatArray:
        """The samples of a channel or of its time: without rows that only other channels have, or that repeat one."""
        clock = values if time is None else time
        has = np.flatnonzero(np.isfinite(clock))
        stop = int(has[-1]) + 1 if len(has) else 0
        kept = np.ones(stop, bool)
        if column in self.clocks or column in self.clocks.values():
            kept[1:] = np.diff(clock[:stop]) != 0
        done = values[:stop][kept]
        is_ticks = column in self.clocks.values() and len(done) and done[0] > _TICKS
        return (done - self._begun) * (_TICK_S / _MS) if is_ticks else done

    def make_time(self, name: str, values: FloatArray) -> FloatArray:
        """A time by the stated step."""
        return self._step(self.made[name]) * np.arange(len(values))


def tell_recorder(lines: Sequence[str]) -> Layout | None:
    """Tells the layout of a recorder's table by its first lines; None where it is of none that is known."""
    return tell_lvm(lines) or tell_twincat(lines)
