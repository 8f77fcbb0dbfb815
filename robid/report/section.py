"""Sections of a report and what they hold: tables, notes, and figures that the page draws."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, TypeAlias

from robid.report.charts import BodeMatrix, RatioChart, Skeletons, Waterfall

ColumnStyle: TypeAlias = Literal["name", "text", "number", "strong", "prose", "code", "meter"]


@dataclass(frozen=True)
class Cell:
    """A cell that is more than its text.

    Attributes:
        text: What it says.
        mark: Whether that is good or bad news.
        badge: A letter before the text.
        hint: What the badge means.
        share: Share of a limit, drawn as a meter where its column is one.
        link: Page that it leads to, from this page's folder on; empty for none.
    """

    text: str
    mark: Literal["", "good", "bad"] = ""
    badge: str = ""
    hint: str = ""
    share: float | None = None
    link: str = ""


@dataclass(frozen=True)
class Row:
    """A row that is more than its cells.

    Attributes:
        cells: Its cells.
        faint: Whether the reader should not rely on it.
        group: Title above it and its neighbours of the same group.
        choice: What the reader chooses it by, where the table has a choice.
    """

    cells: tuple[str | Cell, ...]
    faint: bool = False
    group: str = ""
    choice: str = ""


@dataclass(frozen=True)
class Table:
    """A table, its first column naming the row.

    Attributes:
        columns: Heads of the columns.
        rows: Cells as they are written; numbers stand to the right.
        title: Title above it.
        caption: What the reader has to know.
        strong: Index of the row to stress, or None.
        prose: Whether the cells are sentences, which stand to the left and wrap.
        styles: Style of each column; a name and numbers when empty.
        choice: What the reader chooses rows by; empty for no choice.
        footer: Name and text of lines below the rows.
        fit: How much room it takes: all of the width, as little as it needs, or a height of its own to scroll in.
    """

    columns: tuple[str, ...]
    rows: tuple[Row | tuple[str | Cell, ...], ...]
    title: str = ""
    caption: str = ""
    strong: int | None = None
    prose: bool = False
    styles: tuple[ColumnStyle, ...] = ()
    choice: str = ""
    footer: tuple[tuple[str, str], ...] = ()
    fit: Literal["wide", "compact", "tall", "compact tall"] = "wide"

    @property
    def texts(self) -> tuple[tuple[str, ...], ...]:
        """The cells of each row as text alone."""
        rows = (row.cells if isinstance(row, Row) else row for row in self.rows)
        return tuple(tuple(cell.text if isinstance(cell, Cell) else cell for cell in row) for row in rows)


@dataclass(frozen=True)
class Curve:
    """One curve of a figure; where y is not finite there is a gap.

    Attributes:
        name: Its name.
        x: Along x.
        y: Along y.
        texts: What is said of each point; the values when empty.
        points: Whether points are drawn in place of a line.
        symbol: What they are drawn as.
        lower: Lower end of a band around it; no band when empty.
        upper: Upper end of the band.
        shade: Index of its colour; that of its place among the curves when None.
        dashed: Whether a line of a stated shade is dashed; else its place among the curves says how.
    """

    name: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    texts: tuple[str, ...] = ()
    points: bool = False
    symbol: Literal["dot", "small", "cross", "ring", "square", "diamond"] = "dot"
    lower: tuple[float, ...] = ()
    upper: tuple[float, ...] = ()
    shade: int | None = None
    dashed: bool = False


@dataclass(frozen=True)
class Line:
    """A straight line across a figure, where one coordinate has one value.

    Attributes:
        along: The coordinate.
        at: Its value.
        name: What stands beside it.
    """

    along: Literal["x", "y"]
    at: float
    name: str = ""


@dataclass(frozen=True)
class Figure:
    """Curves over one axis.

    Attributes:
        title: Title above it.
        x_title: Quantity and unit along x.
        y_title: Quantity and unit along y.
        curves: The curves, at most seven.
        log_x: Whether x is logarithmic.
        log_y: Whether y is logarithmic.
        caption: What the reader has to know.
        y_range: Ends of the vertical axis; those of the curves when None.
        height: Height on the page [pixel].
        legend: Whether the curves are named.
        x_labels: What stands at x = 0, 1, ...; numbers when empty.
        lines: Straight lines across it.
        x_range: Ends of the horizontal axis; those of the curves when None.
        equal: Whether both axes have one scale.
    """

    title: str
    x_title: str
    y_title: str
    curves: tuple[Curve, ...]
    log_x: bool = True
    log_y: bool = True
    caption: str = ""
    y_range: tuple[float, float] | None = None
    height: int = 340
    legend: bool = True
    x_labels: tuple[str, ...] = ()
    lines: tuple[Line, ...] = ()
    x_range: tuple[float, float] | None = None
    equal: bool = False


@dataclass(frozen=True)
class Bars:
    """Stacked bars.

    Attributes:
        title: Title above it.
        value_title: Quantity and unit along the bars.
        labels: What each bar stands for.
        parts: Name and values (one for each label) of each part of the bars.
        flat: Whether the bars lie, their labels at the left.
        label_title: What the labels are.
        caption: What the reader has to know.
        groups: Name and number of bars of each group, in the order of the bars; one group when empty.
        marks: What each bar is held against, or None; nothing when empty.
        mark_title: What the marks are.
    """

    title: str
    value_title: str
    labels: tuple[str, ...]
    parts: tuple[tuple[str, tuple[float, ...]], ...]
    flat: bool = False
    label_title: str = ""
    caption: str = ""
    groups: tuple[tuple[str, int], ...] = ()
    marks: tuple[float | None, ...] = ()
    mark_title: str = ""


@dataclass(frozen=True)
class Notes:
    """A list of sentences."""

    items: tuple[str, ...]


@dataclass(frozen=True)
class Beside:
    """Parts that stand beside each other where the page is wide.

    Attributes:
        parts: The parts.
        columns: How many side by side; as many as there is room for when 0.
    """

    parts: tuple[Part, ...]
    columns: int = 0


@dataclass(frozen=True)
class Folded:
    """Parts that the reader unfolds."""

    title: str
    parts: tuple[Part, ...]


@dataclass(frozen=True)
class Choice:
    """Parts of which the reader chooses one.

    Attributes:
        label: What is chosen, as in `Channel`.
        options: Name and parts of each.
    """

    label: str
    options: tuple[tuple[str, tuple[Part, ...]], ...]


AnyFigure: TypeAlias = Figure | Bars | Skeletons | Waterfall | RatioChart | BodeMatrix
Part: TypeAlias = Table | Notes | Beside | Folded | Choice | AnyFigure


@dataclass(frozen=True)
class Section:
    """A titled part of the page.

    Attributes:
        title: Its title.
        lead: What it is about.
        parts: Tables, notes and figures, from top to bottom.
        anchor: Its name in the page's address; its number when empty.
        group: What it and its neighbours of the same group are about, as in the name of a fit.
    """

    title: str
    lead: str = ""
    parts: tuple[Part, ...] = ()
    anchor: str = ""
    group: str = ""

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
        elif isinstance(part, Choice):
            for _, parts in part.options:
                yield from _tables(parts)
