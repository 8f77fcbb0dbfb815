"""The decoupling map on the page, after Fig. 9 of Oliveira et al. (2019)."""

from __future__ import annotations

import numpy as np

from robid.arrays import BoolArray
from robid.models.external.fit.coupling import CouplingMap
from robid.models.external.fit.options import CouplingOptions
from robid.models.external.fit.solution import Ports
from robid.report.numbers import MISSING, significant
from robid.report.section import Cell, ColumnStyle, Curve, Figure, Line, Notes, Row, Section, Table

_MOST_GROUPS = 6
_LEAD = (
    "How far each output follows each command: the largest root of the coherence, against the size of what follows over"
    " that of the command, each in its resolutions. What is right of and above the dotted thresholds counts as coupled."
)


def coupling_section(found: CouplingMap, ports: Ports, options: CouplingOptions) -> tuple[Section, ...]:
    """Lays out the decoupling map; nothing where there is nothing to be coupled.

    Args:
        found: The map.
        ports: Commands and outputs.
        options: Thresholds.
    """
    if found.own.all():
        return ()
    parts = (_map(found, ports, options), Notes((found.sentence,)), _pairs(found, ports), _limits(found, ports))
    return (Section("Decoupling", _LEAD, parts, "decoupling"),)


def _map(found: CouplingMap, ports: Ports, options: CouplingOptions) -> Figure:
    own = found.own
    known = np.isfinite(found.coherence) & np.isfinite(found.ratio) & (found.ratio > 0)
    groups = [significant(hz, 2) for hz in found.highest_hz.tolist()]
    names = sorted(dict.fromkeys(groups), key=float)[-_MOST_GROUPS:]
    curves = [_points("own output", "ring", known & own, found, ports, groups, len(names))]
    for shade, name in enumerate(names):
        there = np.array([group == name for group in groups])[:, None, None]
        curves.append(_points(f"up to {name} Hz", "dot", known & ~own & there, found, ports, groups, shade))
    lines = (
        Line("x", options.coherence, "threshold"),
        Line("x", float(found.limit.max()), "chance"),
        Line("y", options.ratio, "threshold"),
    )
    return Figure(
        "",
        "Largest root of the coherence",
        "Size of what follows, in resolutions",
        tuple(curve for curve in curves if curve.x),
        log_x=False,
        x_range=(0.0, 1.03),
        y_range=(0.5 * min(options.ratio, float(found.ratio[known].min(initial=1.0))), _above(found, known, options)),
        lines=lines,
        height=420,
    )


def _above(found: CouplingMap, known: BoolArray, options: CouplingOptions) -> float:
    return 2.0 * max(options.ratio, float(found.ratio[known].max(initial=1.0)))


def _points(
    name: str, symbol: str, chosen: BoolArray, found: CouplingMap, ports: Ports, groups: list[str], shade: int
) -> Curve:
    texts = []
    for band, output, command in np.argwhere(chosen):
        pair = f"{ports.outputs[output]} to {ports.inputs[command]}, up to {groups[band]} Hz"
        numbers = found.coherence[band, output, command], found.ratio[band, output, command]
        texts.append(f"{pair}: coherence {numbers[0]:.2f}, size {significant(float(numbers[1]), 2)}")
    x, y = (tuple(values[chosen].tolist()) for values in (found.coherence, found.ratio))
    return Curve(name, x, y, tuple(texts), points=True, symbol="ring" if symbol == "ring" else "dot", shade=shade)


def _pairs(found: CouplingMap, ports: Ports) -> Table:
    """Largest size of what follows of each pair, over the bands."""
    largest: list[list[float]] = np.where(np.isfinite(found.ratio), found.ratio, -np.inf).max(axis=0).tolist()
    coupled: list[list[bool]] = np.asarray(found.coupled.any(axis=0)).tolist()
    rows = tuple(
        Row((name, *(_pair(size, coupled=mark) for size, mark in zip(sizes, marks, strict=True))))
        for name, sizes, marks in zip(ports.outputs, largest, coupled, strict=True)
    )
    styles: tuple[ColumnStyle, ...] = ("name", *_numbers(len(ports.inputs)))
    caption = "Largest of all bands, in resolutions. Red: coupled in some band."
    heads = ("Output", *(f"command {name}" for name in ports.inputs))
    return Table(heads, rows, title="Size of what follows", caption=caption, styles=styles, fit="compact")


def _pair(value: float, *, coupled: bool) -> Cell:
    return Cell(significant(value, 2) if np.isfinite(value) else MISSING, "bad" if coupled else "")


def _limits(found: CouplingMap, ports: Ports) -> Table:
    rows = []
    for command, name in enumerate(ports.inputs):
        crossing = found.crossing_hz[:, command]
        others = [f"{ports.outputs[at]} from {significant(crossing[at], 3)} Hz" for at in np.argsort(crossing)]
        named = ", ".join(text for text, hz in zip(others, np.sort(crossing), strict=True) if np.isfinite(hz))
        rows.append((name, f"{significant(float(found.decoupled_up_to_hz[command]), 3)} Hz", named or "none"))
    caption = f"Examined up to {significant(found.examined_hz, 3)} Hz, by the empirical response beyond doubt."
    heads = ("Command", "Decoupled up to", "Outputs that follow it")
    return Table(heads, tuple(rows), title="Up to where", caption=caption, styles=("name", "strong", "prose"))


def _numbers(count: int) -> tuple[ColumnStyle, ...]:
    number: ColumnStyle = "number"
    return (number,) * count
