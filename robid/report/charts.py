"""Arms in space, and values over their nominal ones."""

from __future__ import annotations

from dataclasses import dataclass


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
class Ratio:
    """A value over its nominal one.

    Attributes:
        name: Its name.
        estimate: The ratio.
        lower: Lower end of its interval.
        upper: Upper end of its interval.
        truth: True value over the nominal one, or None.
        identifiable: Whether the data determine it.
        text: The value itself, written out.
    """

    name: str
    estimate: float
    lower: float
    upper: float
    truth: float | None = None
    identifiable: bool = True
    text: str = ""


@dataclass(frozen=True)
class RatioChart:
    """Values over their nominal ones, with intervals and the truth.

    Attributes:
        title: Title above it.
        panels: Title and values of each panel; they stand beside each other on one scale.
        interval: What the intervals are, as in `95 % interval`.
        caption: What the reader has to know.
    """

    title: str
    panels: tuple[tuple[str, tuple[Ratio, ...]], ...]
    interval: str
    caption: str = ""
