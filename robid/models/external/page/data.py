"""Measured against simulated outputs, after Figs 7 and 8, and the decoupling map."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import Literal, TypeAlias

import numpy as np

from robid.arrays import BoolArray, IntArray
from robid.models.external.fit.coupling import CouplingMap
from robid.models.external.fit.data import Agreement
from robid.models.external.fit.options import CouplingOptions
from robid.models.external.fit.solution import ExternalSolution, Ports
from robid.models.external.judge.validating import ExternalValidation
from robid.models.external.page.charts import Trace, readable_factor, trace_figures
from robid.models.parameters import quantile
from robid.report.numbers import MISSING, percent, significant
from robid.report.section import Cell, Choice, ColumnStyle, Curve, Figure, Line, Notes, Part, Row, Section, Table

_MOST_GROUPS = 6
_LEAD = (
    "How far each output follows each command: the largest root of the coherence, against the size of what follows over"
    " that of the command, each in its resolutions. What is right of and above the dotted thresholds counts as coupled."
)


def coupling_section(found: CouplingMap, ports: Ports, options: CouplingOptions) -> tuple[Section, ...]:
    """Lays out the decoupling map; nothing where there is nothing to be coupled."""
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
        y_range=(
            0.5 * min(options.ratio, float(found.ratio[known].min(initial=1.0))),
            2.0 * max(options.ratio, float(found.ratio[known].max(initial=1.0))),
        ),
        lines=lines,
        height=420,
    )


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
    rows: list[tuple[str | Cell, ...]] = []
    for name, sizes, marks in zip(ports.outputs, largest, coupled, strict=True):
        texts = [significant(size, 2) if np.isfinite(size) else MISSING for size in sizes]
        rows.append((name, *(Cell(text, "bad" if mark else "") for text, mark in zip(texts, marks, strict=True))))
    caption = "Largest of all bands, in resolutions. Red: coupled in some band."
    heads = ("Output", *(f"command {name}" for name in ports.inputs))
    return Table(heads, tuple(rows), title="Size of what follows", caption=caption, fit="compact")


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


_MOST_SHOTS = 4
_MANY = 12
_CAPTION = (
    "R² and NRMSE are 1 where the model is perfect, 0 where it is no better than a constant. Error and motion: root"
    " mean square. "
)


_OVER_TIME = "Curves are thinned to the smallest and the largest value of each stretch, so that peaks stay."


def own_section(solution: ExternalSolution) -> Section:
    """Lays out measured against simulated outputs of the fit's own shots."""
    lead = f"Measured outputs against simulated ones, in the fit's own shots. {_OVER_TIME}"
    return Section("On its own data", lead, (_choice(solution, _own_traces(solution)),), "traces")


def new_section(solution: ExternalSolution, validation: ExternalValidation) -> Section:
    """Lays out measured against predicted outputs of shots that the fit never saw, and of its own."""
    choice = _choice(solution, _new_traces(validation), _own_traces(solution))
    lead = (
        f"The model {validation.outcome.verdict}. Bounds hold the uncertainty of the parameters and the noise at"
        f" {percent(validation.confidence)}. {_OVER_TIME}"
    )
    return Section("On new data", lead, (_new_table(solution, validation), choice), "traces")


def own_table(solution: ExternalSolution) -> Table:
    """Tabulates how well the fit describes its own shots."""
    quality, place = solution.quality, dict(zip(solution.quality.output_names, itertools.count(), strict=False))
    rows = []
    for each in solution.agreements:
        block = int(np.searchsorted(quality.first_output, place[each.output], side="right")) - 1
        scores = significant(float(quality.fpe[block]), 2), percent(float(quality.whiteness_p[block]))
        cells = (f"{each.r_squared:.4f}", f"{each.nrmse:.4f}", *scores, *_sizes(solution, each))
        rows.append(Row((each.output, each.place, *cells, quality.status[block].replace("_", " "))))
    caption = (
        f"{_CAPTION}FPE: Akaike's final prediction error over the output's variance. Whiteness: chance that white noise"
        " looks as coloured as the residual of the worst shot."
    )
    heads = ("Output", "Where", "R²", "NRMSE", "FPE", "Whiteness", "Error", "Motion", "Fit")
    styles: tuple[ColumnStyle, ...] = ("name", "text", *("number",) * 6, "text")
    fit: Literal["wide", "tall"] = "tall" if len(rows) > _MANY else "wide"
    return Table(heads, tuple(rows), title="How well it fits", caption=caption, styles=styles, fit=fit)


def _new_table(solution: ExternalSolution, validation: ExternalValidation) -> Table:
    rows = []
    for each, bounds in zip(validation.agreements, validation.bounds, strict=True):
        scores = [f"{score:.4f}" for score in (each.r_squared, each.nrmse, bounds.own_nrmse)]
        sizes = (*_sizes(solution, each), _size(solution, each.output, bounds.expected_std), percent(bounds.inside))
        rows.append((each.output, each.place, *scores, significant(bounds.fpe, 2), *sizes))
    heads = ("Output", "Where", "R²", "NRMSE", "of the fit", "FPE", "Error", "Motion", "Expected error", "In bounds")
    caption = f"{_CAPTION}Expected error: what noise, parameters and a model error of one per cent of the motion give."
    return Table(heads, tuple(rows), caption=caption, styles=("name", "text", *("number",) * 8))


def _sizes(solution: ExternalSolution, each: Agreement) -> tuple[str, str]:
    return _size(solution, each.output, each.error_std), _size(solution, each.output, each.motion_std)


def _size(solution: ExternalSolution, output: str, value: float) -> str:
    to_unit, unit = readable_factor(_unit_of(solution)[output])
    return f"{significant(to_unit * value, 2)} {unit}" if np.isfinite(value) else MISSING


_Records: TypeAlias = dict[str, list[Trace]]


def _own_traces(solution: ExternalSolution) -> _Records:
    """Measured and simulated outputs of the fit's own shots, by output."""
    found = solution.traces

    def trace(rows: BoolArray, name: str) -> Trace:
        return Trace(f"{name} (fit)", found.time_s[rows], found.measured[rows], found.simulated[rows])

    return _split(solution.quality.output_names, (found.output, found.shot, found.shots), trace)


def _new_traces(validation: ExternalValidation) -> _Records:
    """Measured and predicted outputs of shots that the fit never saw, with bounds, by output."""
    found, wide = validation.traces, quantile(validation.confidence)

    def trace(rows: BoolArray, name: str) -> Trace:
        half = wide * found.std[rows]
        return Trace(f"{name} (validation)", found.time_s[rows], found.measured[rows], found.predicted[rows], half)

    return _split(found.names, (found.output, found.shot, found.shots), trace)


def _split(
    names: Sequence[str],
    labels: tuple[IntArray, IntArray, tuple[str, ...]],
    trace: Callable[[BoolArray, str], Trace],
) -> _Records:
    """Takes the rows of all outputs and shots apart, a few shots of each output."""
    outputs, shots, every = labels
    return {
        name: [
            trace((outputs == output) & (shots == shot), every[shot])
            for shot in np.unique(shots[outputs == output])[:_MOST_SHOTS].tolist()
        ]
        for output, name in enumerate(names)
    }


def _choice(solution: ExternalSolution, *several: _Records) -> Choice:
    """Lets the reader choose an output, and one of its records, each shown by itself."""
    units = _unit_of(solution)
    options: list[tuple[str, tuple[Part, ...]]] = []
    for name in several[0]:
        traces = [trace for records in several for trace in records.get(name, [])]
        options.append(
            (name, (Choice("Record", tuple((one.name, trace_figures(one, units[name])) for one in traces)),))
        )
    single = len(solution.transfers.names) == len(solution.quality.output_names)
    return Choice("Channel" if single else "Output", tuple(options))


def _unit_of(solution: ExternalSolution) -> dict[str, str]:
    """Unit of each output that the quality names: block by block, each output once."""
    transfers = solution.transfers
    outputs = [
        output
        for block in range(len(transfers.blocks))
        for output in dict.fromkeys(transfers.outputs[transfers.channels_of(block)].tolist())
    ]
    units = (solution.ports.output_units[output] for output in outputs)
    return dict(zip(solution.quality.output_names, units, strict=True))
