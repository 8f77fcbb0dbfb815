"""How a table of text is written: its columns, and what else is to be known of its rows."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from robid.arrays import FloatArray
from robid.logs.formats.cells import is_grouped, number, split, without_groups


class Body:
    """What else is to be known of the rows of a table; a recorder's own table has one of its own.

    Attributes:
        clocks: The column of the time of each column that has one of its own; both are read together.
        made: Times that stand in no column, by the names that they get: the column whose time each is.
        shared: Names of the time of each further channel that has the same column of it as another, by that column.
    """

    clocks: Mapping[int, int] = MappingProxyType({})
    made: Mapping[str, int] = MappingProxyType({})
    shared: Mapping[str, int] = MappingProxyType({})

    def keep(self, rows: list[tuple[int, str]]) -> list[tuple[int, str]]:
        """Returns the rows of numbers among numbered lines, which come in order, a part of the table at a time."""
        return rows

    def finish(self, column: int, values: FloatArray, time: FloatArray | None) -> FloatArray:  # noqa: ARG002
        """Returns what a column means, once all of it is there.

        Args:
            column: The column.
            values (n_row,): What stands in it.
            time (n_row,): What stands in the column of its time.
        """
        return values

    def make_time(self, name: str, values: FloatArray) -> FloatArray:  # noqa: ARG002
        """Returns a time that stands in no column, for the finished values of its column [s]."""
        raise KeyError(name)

    def damage(self, count: int) -> str:  # noqa: ARG002
        """Says what is missing of a table that ends after some rows; nothing where it is whole."""
        return ""


@dataclass(frozen=True)
class Join:
    """Joins what the separator cuts out of a moment."""

    cut: re.Pattern[str]
    mark: str

    def __call__(self, line: str) -> str:
        """Returns a line with one cell for each moment."""
        return self.cut.sub(self.mark, line)


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
        fewest: Cells of the shortest row, whose last ones are missing.
        headers: Lines above the numbers, which are passed over where they stand among them again.
        groups: For each column the mark of thousands, nothing where it has none, `?` where a comma may be one.
        join: What joins date and time in a line, where the separator stands between them.
        body: What else is to be known of its rows.
    """

    separator: str
    decimal_comma: bool
    names: tuple[str, ...]
    units: tuple[str, ...]
    lines: int
    kinds: tuple[str, ...]
    width: int
    fewest: int = 0
    headers: frozenset[str] = frozenset()
    groups: tuple[str, ...] = ()
    join: Join | None = None
    body: Body = field(default_factory=Body)

    def cells(self, line: str) -> list[str]:
        """Returns the cells of a line."""
        return split(line, self.separator)

    def number(self, cell: str, column: int) -> float:
        """Returns the number of a cell, NaN where it is missing.

        Raises:
            ValueError: If it holds something else.
        """
        if self.marks_groups(column) and self.groups[column] in cell:
            cell = without_groups(cell)
        return number(cell, decimal_comma=self.decimal_comma)

    def marks_groups(self, column: int) -> bool:
        """Whether a column may have marks of thousands that are known."""
        return bool(self.groups) and self.groups[column] in (",", ".")

    def is_open(self, cell: str, column: int) -> bool:
        """Whether a number may be two, as nothing tells what its comma marks."""
        return bool(self.groups) and self.groups[column] == "?" and "," in cell and is_grouped(cell)
