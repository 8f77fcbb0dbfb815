"""How a table of text is written: how a line falls into cells, which numbers they hold, and what its columns are."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

from robid.arrays import FloatArray

_MISSING = frozenset(
    (
        *("", "-", "--", "---", "na", "n/a", "n.a.", "<na>", "#na", "#n/a", "#n/a n/a", "#nv", "nil", "none", "null"),
        *("(null)", "\\n", "nodata", "no data", "missing", "invalid", "undefined", "undef", "?", "*", "."),
        *("#value!", "#wert!", "#div/0!", "#num!", "#zahl!", "#ref!", "#bezug!", "#name?", "#null!"),
    )
)
"""What tools write where there is no value, in lower case."""

AROUND = " \t\r\n\ufeff"
"""What may stand around a line: also the mark of its encoding, where files were joined."""

_NO_NUMBER = re.compile(r"[-+]?(nan(\([a-z0-9]*\))?|[qs]nan|1[.,]#(ind|nan|qnan|snan)0*|1[.,]#j|nan[qs])")
_INFINITE = re.compile(r"([-+]?)1[.,]#inf0*|([-+]?)1[.,]#i")
_FORTRAN = re.compile(r"([-+]?\d+\.?\d*|[-+]?\.\d+)d([-+]?\d+)")
_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+(e[-+]?\d+)?")
_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2}(?:(?:,\d{3})+(?:\.\d*)?|(?:\.\d{3})+(?:,\d*)?)")
_SURELY = re.compile(r"[-+]?[1-9]\d{0,2}(?:(?:,\d{3})+\.\d*|(?:\.\d{3})+,\d*|(?:,\d{3}){2,}|(?:\.\d{3}){2,})")


def is_row(line: str, comments: Sequence[str]) -> bool:
    """Whether a line is neither empty nor a comment."""
    return not line.isspace() and bool(line) and not line.startswith(tuple(comments))


def split(line: str, separator: str) -> list[str]:
    """Splits a line into its cells, without quotes, within which separators are text."""
    line = line.strip("\r\n")
    parts = line.split() if separator == " " else line.split(separator)
    if '"' in line and separator != " " and len(line) < csv.field_size_limit():
        parts = next(csv.reader([line], delimiter=separator, skipinitialspace=True))
    return [part.strip().strip('"').strip() for part in parts]


def split_all(lines: Sequence[str], separator: str) -> list[list[str]]:
    """Splits lines into their cells, which may still have spaces around them."""
    if separator != " ":
        if not any('"' in line for line in lines):
            return [line.rstrip("\r\n").split(separator) for line in lines]
        try:
            rows = list(csv.reader(lines, delimiter=separator, skipinitialspace=True))
        except csv.Error:
            rows = []
        if len(rows) == len(lines):
            return rows
    return [split(line, separator) for line in lines]


def is_missing(cell: str) -> bool:
    """Whether a cell says that there is no value."""
    text = cell.lower()
    return text in _MISSING or _NO_NUMBER.fullmatch(text) is not None


def number(cell: str, *, decimal_comma: bool) -> float:
    """Returns the number of a cell, NaN where it is missing.

    Raises:
        ValueError: If it holds something else.
    """
    if "_" in cell:
        raise ValueError(cell)
    try:
        return float(cell.replace(",", ".") if decimal_comma else cell)
    except ValueError:
        return _odd_number(cell.lower(), decimal_comma=decimal_comma)


def _odd_number(text: str, *, decimal_comma: bool) -> float:
    """A number that is written as only some tools do."""
    if is_missing(text):
        return math.nan
    if infinite := _INFINITE.fullmatch(text):
        return -math.inf if "-" in infinite[0] else math.inf
    text = text.replace("\u2212", "-")
    if _SURELY.fullmatch(text):
        return float(without_groups(text))
    text = text.replace(",", "." if decimal_comma else ",")
    if fortran := _FORTRAN.fullmatch(text):
        text = f"{fortran[1]}e{fortran[2]}"
    return float(text)


def is_number(cell: str, *, decimal_comma: bool) -> bool:
    """Whether a cell holds a number."""
    try:
        return not math.isnan(number(cell, decimal_comma=decimal_comma))
    except ValueError:
        return False


def without_groups(cell: str) -> str:
    """Returns the text of a number without marks of thousands, a point before its decimals; others as they are."""
    if not _THOUSANDS.fullmatch(cell):
        return cell
    first = next(mark for mark in cell if mark in ",.")
    return cell.replace(first, "").replace(",", ".")


def is_grouped(cell: str) -> bool:
    """Whether a number may have marks of thousands."""
    return _THOUSANDS.fullmatch(cell) is not None


def repeated_mark(cell: str) -> str:
    """Returns the mark of thousands that stands in a number more than once; empty without one."""
    found = next((mark for mark in ",." if cell.count(mark) > 1), "")
    return found if found and is_grouped(cell) else ""


def has_decimal_commas(cells: Sequence[str]) -> bool:
    """Whether commas in cells are decimal marks: no group of thousands begins with 0 or has other than three digits.

    What is no number tells nothing: a date may have points, and a comma before the fraction of its second.
    """
    with_comma = [cell.lower() for cell in cells if "," in cell and is_number(cell, decimal_comma=True)]
    found = [cell for cell in with_comma if _DECIMAL_COMMA.fullmatch(cell)]
    pointed = any(cell.rfind(".") > cell.rfind(",") for cell in with_comma)
    return not pointed and any(not is_grouped(cell) for cell in found)


def tell_groups(columns: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Tells for each column which mark can only be that of thousands, as another marks its decimals.

    What the numbers of a column leave open, those of the others tell; `?` where a comma may be either.
    """
    own = []
    for cells in columns:
        texts = [cell for cell in cells if ("," in cell or "." in cell) and is_number(cell, decimal_comma=True)]
        # Marks that stand before decimals, and can be nothing else
        told = [text for text in texts if not is_grouped(text) or ("," in text and "." in text)]
        marks = {text[max(text.rfind(","), text.rfind("."))] for text in told}
        # One that stands twice in a number is none before decimals.
        marks |= {"," if one == "." else "." for one in map(repeated_mark, texts) if one}
        own.append("".join(sorted(marks)))
    every = "".join(sorted(set("".join(own))))
    return tuple({"": "?", ",": ".", ".": ",", ",.": ""}[marks or every] for marks in own)


class Body:
    """What else is to be known of the rows of a table; a recorder's own table has one of its own."""

    # The column of the time of each column that has one of its own; both are read together
    clocks: Mapping[int, int] = MappingProxyType({})
    # Times that stand in no column, by the names that they get: the column whose time each is
    made: Mapping[str, int] = MappingProxyType({})
    # Names of the time of each further channel that has the same column of it as another, by that column
    shared: Mapping[str, int] = MappingProxyType({})

    def keep(self, rows: list[tuple[int, str]]) -> list[tuple[int, str]]:
        """Returns the rows of numbers among numbered lines, which come in order, a part of the table at a time."""
        return rows

    def finish(self, column: int, values: FloatArray, time: FloatArray | None) -> FloatArray:  # noqa: ARG002
        """Returns what a column means, once all of it (n_row,) is there, and what stands in the column of its time."""
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
    """How a table is written."""

    separator: str  # What separates cells; a space stands for any white space
    decimal_comma: bool  # Whether decimal marks are commas
    names: tuple[str, ...]
    units: tuple[str, ...]  # Their units; empty where none is stated
    lines: int  # Lines before the first row
    kinds: tuple[str, ...]  # What each column holds: `number`, `moment` (date and time), or a text that is neither
    width: int  # Number of cells of a row; one more than there are columns where rows end with a separator
    fewest: int = 0  # Cells of the shortest row, whose last ones are missing
    # Lines above the numbers, which are passed over where they stand among them again
    headers: frozenset[str] = frozenset()
    # For each column the mark of thousands, nothing where it has none, `?` where a comma may be one
    groups: tuple[str, ...] = ()
    join: Join | None = None  # What joins date and time in a line, where the separator stands between them
    body: Body = field(default_factory=Body)  # What else is to be known of its rows

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
