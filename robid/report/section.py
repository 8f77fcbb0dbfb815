"""Sections of a report and what they hold: tables, notes, and figures that the page draws."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Literal, TypeAlias

from robid.report.charts import BodeMatrix, Heatmap, MovingArms, RatioChart, Skeletons, Waterfall

ColumnStyle: TypeAlias = Literal["name", "text", "unit", "number", "strong", "prose", "code", "meter"]


@dataclass(frozen=True)
class Cell:
    """A cell that is more than its text."""

    text: str  # what it says
    mark: Literal["", "good", "bad"] = ""  # whether that is good or bad news
    badge: str = ""  # a letter before the text
    hint: str = ""  # what the badge means
    share: float | None = None  # share of a limit, drawn as a meter where its column is one
    link: str = ""  # page that it leads to, from this page's folder on, or `#` and an anchor of this one; or empty


@dataclass(frozen=True)
class Row:
    """A row that is more than its cells."""

    cells: tuple[str | Cell, ...]  # its cells
    faint: bool = False  # whether the reader should not rely on it
    group: str = ""  # title above it and its neighbours of the same group
    choice: str = ""  # what the reader chooses it by, where the table has a choice
    note: str = ""  # what the reader has to know of it, in a line below
    anchor: str = ""  # its name in the page's address, for links to it; empty for none


@dataclass(frozen=True)
class Table:
    """A table, its first column naming the row."""

    columns: tuple[str, ...]  # heads of the columns
    rows: tuple[Row | tuple[str | Cell, ...], ...]  # cells as they are written; numbers stand to the right
    title: str = ""  # title above it
    caption: str = ""  # what the reader has to know
    strong: int | None = None  # index of the row to stress, or None
    prose: bool = False  # whether the cells are sentences, which stand to the left and wrap
    styles: tuple[ColumnStyle, ...] = ()  # style of each column; a name and numbers when empty
    choice: str = ""  # what the reader chooses rows by; empty for no choice
    leaves: tuple[str, ...] = ()  # heads of the columns that leave where there is no room, the first first
    footer: tuple[tuple[str, str], ...] = ()  # name and text of lines below the rows
    # How much room it takes: all of the width, as little as it needs, or a height of its own to scroll in.
    fit: Literal["wide", "compact", "tall", "compact tall"] = "wide"

    @property
    def texts(self) -> tuple[tuple[str, ...], ...]:
        """The cells of each row as text alone."""
        rows = (row.cells if isinstance(row, Row) else row for row in self.rows)
        return tuple(tuple(cell.text if isinstance(cell, Cell) else cell for cell in row) for row in rows)


@dataclass(frozen=True)
class Curve:
    """One curve of a figure; where y is not finite there is a gap."""

    name: str  # its name
    x: tuple[float, ...]  # along x
    y: tuple[float, ...]  # along y
    texts: tuple[str, ...] = ()  # what is said of each point; the values when empty
    points: bool = False  # whether points are drawn in place of a line
    symbol: Literal["dot", "small", "cross", "ring", "square", "diamond"] = "dot"  # what they are drawn as
    lower: tuple[float, ...] = ()  # lower end of a band around it; no band when empty
    upper: tuple[float, ...] = ()  # upper end of the band
    shade: int | None = None  # index of its colour; that of its place among the curves when None
    dashed: bool = False  # whether a line of a stated shade is dashed; else its place among the curves says how
    width: float = 1.8  # of a line [pixel]


@dataclass(frozen=True)
class Line:
    """A straight line across a figure, where one coordinate has one value."""

    along: Literal["x", "y"]  # the coordinate
    at: float  # its value
    name: str = ""  # what stands beside it


@dataclass(frozen=True)
class Figure:
    """Curves over one axis."""

    title: str  # title above it
    x_title: str  # quantity and unit along x
    y_title: str  # quantity and unit along y
    curves: tuple[Curve, ...]  # the curves, at most seven
    log_x: bool = True  # whether x is logarithmic
    log_y: bool = True  # whether y is logarithmic
    caption: str = ""  # what the reader has to know
    y_range: tuple[float, float] | None = None  # ends of the vertical axis; those of the curves when None
    height: int = 340  # height on the page [pixel]
    legend: bool = True  # whether the curves are named
    x_labels: tuple[str, ...] = ()  # what stands at x = 0, 1, ...; numbers when empty
    lines: tuple[Line, ...] = ()  # straight lines across it
    x_range: tuple[float, float] | None = None  # ends of the horizontal axis; those of the curves when None
    equal: bool = False  # whether both axes have one scale


@dataclass(frozen=True)
class Bars:
    """Stacked bars."""

    title: str  # title above it
    value_title: str  # quantity and unit along the bars
    labels: tuple[str, ...]  # what each bar stands for
    parts: tuple[tuple[str, tuple[float, ...]], ...]  # name and values (one for each label) of each part of the bars
    flat: bool = False  # whether the bars lie, their labels at the left
    label_title: str = ""  # what the labels are
    caption: str = ""  # what the reader has to know
    # Name and number of bars of each group, in the order of the bars; one group when empty.
    groups: tuple[tuple[str, int], ...] = ()
    marks: tuple[float | None, ...] = ()  # what each bar is held against, or None; nothing when empty
    mark_title: str = ""  # what the marks are


@dataclass(frozen=True)
class Notes:
    """A list of sentences."""

    items: tuple[str, ...]


@dataclass(frozen=True)
class Beside:
    """Parts that stand beside each other where the page is wide."""

    parts: tuple[Part, ...]  # the parts
    columns: int = 0  # how many side by side; as many as there is room for when 0


@dataclass(frozen=True)
class Folded:
    """Parts that the reader unfolds."""

    title: str
    parts: tuple[Part, ...]


@dataclass(frozen=True)
class Choice:
    """Parts of which the reader chooses one."""

    label: str  # what is chosen, as in `Channel`
    options: tuple[tuple[str, tuple[Part, ...]], ...]  # name and parts of each


@dataclass(frozen=True)
class Choices:
    """Parts of which the reader chooses one by several choices, whose options are combined freely."""

    labels: tuple[str, ...]  # what is chosen, as in `Motor` and `Record`
    options: tuple[tuple[tuple[str, ...], tuple[Part, ...]], ...]  # names, one for each choice, and parts

    def __post_init__(self) -> None:
        names = [option for option, _ in self.options]
        every = set(product(*(dict.fromkeys(column) for column in zip(*names, strict=True))))
        if len(set(names)) < len(names) or set(names) != every or {*map(len, names)} != {len(self.labels)}:
            raise ValueError(f"Choices of {', '.join(self.labels)} must have each combination once.")


AnyFigure: TypeAlias = Figure | Bars | Skeletons | MovingArms | Waterfall | RatioChart | Heatmap | BodeMatrix
Part: TypeAlias = Table | Notes | Beside | Folded | Choice | Choices | AnyFigure


@dataclass(frozen=True)
class Section:
    """A titled part of the page."""

    title: str  # its title
    lead: str = ""  # what it is about
    parts: tuple[Part, ...] = ()  # tables, notes and figures, from top to bottom
    anchor: str = ""  # its name in the page's address; its number when empty
    group: str = ""  # what it and its neighbours of the same group are about, as in the name of a fit

    @property
    def tables(self) -> tuple[Table, ...]:
        """All tables, from top to bottom."""
        return tuple(_tables(self.parts))


def _tables(parts: tuple[Part, ...]) -> Iterator[Table]:
    for part in parts:
        if isinstance(part, Table):
            yield part
        elif isinstance(part, Beside | Folded):
            yield from _tables(part.parts)
        elif isinstance(part, Choice | Choices):
            for _, parts in part.options:
                yield from _tables(parts)
