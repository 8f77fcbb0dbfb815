"""Arms and curves in space, and values over their nominal ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


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


@dataclass(frozen=True)
class Layer:
    """Curves of one kind, one at each place; where a height is not finite there is a gap.

    Attributes:
        name: Its name.
        x: Along the curves, the same at all places.
        heights: One tuple of values a place.
        drawn: How.
    """

    name: str
    x: tuple[float, ...]
    heights: tuple[tuple[float, ...], ...]
    drawn: Literal["points", "line", "dashed"] = "line"


@dataclass(frozen=True)
class Waterfall:
    """Curves over one axis, one behind the other along a second one, that the reader can turn.

    Attributes:
        title: Title above it.
        x_title: Quantity and unit along the curves.
        place_title: Quantity and unit of the places.
        y_title: Quantity and unit of the heights; the shorter, the better.
        places: Where the curves stand.
        layers: What is drawn at each place.
        log_x: Whether x is logarithmic.
        caption: What the reader has to know.
        height: Height on the page [pixel].
    """

    title: str
    x_title: str
    place_title: str
    y_title: str
    places: tuple[float, ...]
    layers: tuple[Layer, ...]
    log_x: bool = True
    caption: str = ""
    height: int = 460

    def __post_init__(self) -> None:
        for layer in self.layers:
            if {len(layer.heights)} != {len(self.places)} or {*map(len, layer.heights)} != {len(layer.x)}:
                raise ValueError(f"Layer `{layer.name}` must have one height for each of its x at each place.")
