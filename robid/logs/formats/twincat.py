"""Reads the head of an export of TwinCAT 3 Scope: groups of channels, each behind a column of its time in ms."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from robid.arrays import FloatArray
from robid.logs.formats.cells import is_missing, is_number, split
from robid.logs.formats.layout import Body, Layout
from robid.logs.formats.moments import is_moment
from robid.logs.formats.telling import tell_kinds

_NAMES = ("Name", "SymbolName")
"""Rows of the head that name the channels; where they have a time, the row's own name stands above it."""

_STEP = re.compile(r"SampleTime(\[ms\])?")
_BEGINNINGS = ("starttime of export", "start time of export")
_HEAD, _TAIL = 60, 30
"""Lines in which the head is looked for, and those by which columns are told."""

_TICKS = 1e15
"""Times from here on are no milliseconds since the first sample, but 100 ns since the year 1601."""

_MS, _TICK_S = 1e-3, 1e-7


def tell_twincat(lines: Sequence[str]) -> Layout | None:
    """Tells the layout of an export of TwinCAT 3 Scope; None where it is none.

    Args:
        lines: The first lines of a table.
    """
    mark = _mark([line for line in lines[:_HEAD] if not line.isspace()])
    cells = [split(line, mark) for line in lines] if mark else []
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
    kinds = tell_kinds(full[-_TAIL:], full, comma=comma)[: len(columns)]
    whole = (row for row in cells[at:start] if len(row) >= len(names) and all(row[i] == row[0] for i in timed))
    told = {row[0]: row for row in whole}
    cells_of_times = [full[0][i] for i in timed] if has_times else []
    ticks = [float(cell.replace(",", ".")) for cell in cells_of_times if is_number(cell, decimal_comma=comma)]
    body = _Body(names, columns, told, kinds, times=has_times, begun=min(ticks, default=0.0))
    units = tuple(body.unit(column) for column in range(len(columns)))
    # Slow groups end above the others, by empty cells or by shorter rows.
    fewest = 1 if not has_times else 2 if len(timed) > 1 else width
    return Layout(mark, comma, body.names, units, start, kinds, width, fewest=fewest, body=body)


def _mark(head: Sequence[str]) -> str:
    """What separates cells, behind the name of the first row; nothing where this is no such export."""
    said = any(_STEP.match(line) or line.lower().startswith(_BEGINNINGS) for line in head)
    marks = (line[len(name)] for line in head for name in _NAMES if re.match(rf"{name}[\t;,: ]", line))
    return next(marks, "") if said else ""


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


class _Body(Body):
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
        self._steps: dict[str, float] = {}
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
            self.made = self._make_times()

    def _make_times(self) -> dict[str, int]:
        """Times by the steps that the head states."""
        steps = [self._step(column) for column in range(len(self.names))]
        if not all(steps):
            return {}
        if len(set(steps)) == 1:
            self._steps = {"time": steps[0]}
            return {"time": 0}
        self._steps = {f"{name}.time": step for name, step in zip(self.names, steps, strict=True)}
        return {name: column for column, name in enumerate(self._steps)}

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
        return self._steps[name] * np.arange(len(values))
