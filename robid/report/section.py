"""Sections of a report that a study fills: tables of text, figures of curves, bars and skeletons of arms."""

from __future__ import annotations

from dataclasses import dataclass


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
    """

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    title: str = ""
    caption: str = ""
    strong: int | None = None
    prose: bool = False


@dataclass(frozen=True)
class Curve:
    """One curve of a figure; where y is not finite there is a gap."""

    name: str
    x: tuple[float, ...]
    y: tuple[float, ...]


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
    """

    title: str
    value_title: str
    labels: tuple[str, ...]
    parts: tuple[tuple[str, tuple[float, ...]], ...]
    flat: bool = False
    label_title: str = ""
    caption: str = ""


@dataclass(frozen=True)
class Skeletons:
    """Arms in space that the reader can turn, on the floor z = 0.

    Attributes:
        title: Title above it.
        names: Name of each arm.
        points: Points of each arm from base to tool, (x, y, z) in the base frame [m].
        weights: Weight of each arm, which its line shows.
        others: Tool points of arms that are not drawn [m].
        caption: What the reader has to know.
    """

    title: str
    names: tuple[str, ...]
    points: tuple[tuple[tuple[float, float, float], ...], ...]
    weights: tuple[float, ...]
    others: tuple[tuple[float, float, float], ...] = ()
    caption: str = ""


@dataclass(frozen=True)
class Section:
    """A titled part of the page.

    Attributes:
        title: Its title.
        lead: What it is about.
        tables: Its tables.
        figures: Its figures, after the tables.
        columns: Number of figures beside each other where the page is wide.
    """

    title: str
    lead: str = ""
    tables: tuple[Table, ...] = ()
    figures: tuple[Figure | Bars | Skeletons, ...] = ()
    columns: int = 1
