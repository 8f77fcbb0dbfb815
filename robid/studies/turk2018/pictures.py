"""The kinds of the paper's Figs 3 to 8: Bode plots over the positions, and the one left out."""

from __future__ import annotations

from typing import Literal

import numpy as np

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.frf.frf import Frf
from robid.models.lpv.fit.solution import Held, LpvSolution
from robid.report.charts import Layer, Waterfall
from robid.report.numbers import MINUS, pretty_unit
from robid.report.section import Beside, Curve, Figure, Part, Section

_FREQUENCY = "Frequency [Hz]"
_SHOWN = 120
"""Measured lines of one curve in space: all of them would hide the models."""
_LAYERS: tuple[tuple[str, Literal["points", "line", "dashed"]], ...] = (
    ("measured", "points"),
    ("sparse", "line"),
    ("SMILE", "dashed"),
)
_MEASURED, _SPARSE, _SMILE, _DEVIATION, _NOISE, _ERROR = range(6)


def places(held: Held) -> list[str]:
    """Writes the positions' first scheduling parameter."""
    return [f"{value:g}".replace("-", MINUS) for value in held.points[:, 0].tolist()]


def bode_section(solution: LpvSolution) -> Section:
    """Returns magnitude and phase of every element over the fitted positions, measured and of both models."""
    held = solution.own
    smile = solution.smile_model.frozen_response(held.points, held.frequency_hz)
    responses = (held.response, held.modelled, smile)
    parts: list[Part] = []
    for output, port in np.ndindex(held.response.shape[2:]):
        element = [one[:, :, output, port] for one in responses]
        name = _element(solution, output, port)
        phases = [_phase(one, element[1]) for one in element]
        figures = (
            _waterfall(f"{name}: magnitude", "Magnitude [dB]", solution, [_db(one) for one in element]),
            _waterfall(f"{name}: phase", "Phase [°]", solution, phases),
        )
        parts.append(Beside(figures, 2))
    lead = (
        f"Responses at rest over the fitted positions, in dB of {', '.join(_units(solution))}; drag to turn. At high"
        " frequencies not every measured line is drawn. In the paper, too, interpolated and regularised models can"
        " hardly be told apart."
    )
    return Section("Bode plots over the positions: Figs 3 to 6", lead, tuple(parts))


def _waterfall(title: str, y_title: str, solution: LpvSolution, heights: list[FloatArray]) -> Waterfall:
    """Measured, sparse and interpolated heights (n_pos, n_freq) over frequency and the first scheduling parameter."""
    held, ports = solution.own, solution.ports
    order, lines = np.argsort(held.points[:, 0]), np.arange(len(held.frequency_hz))
    layers = []
    for (name, drawn), rows in zip(_LAYERS, heights, strict=True):
        shown = _spaced(held.frequency_hz) if drawn == "points" else lines
        curves = tuple(tuple(row) for row in rows[order][:, shown].tolist())
        layers.append(Layer(name, tuple(held.frequency_hz[shown].tolist()), curves, drawn))
    along = tuple(held.points[order, 0].tolist())
    place_title = f"{ports.scheduling[0]} [{ports.scheduling_units[0]}]"
    return Waterfall(title, _FREQUENCY, place_title, y_title, along, tuple(layers))


def _spaced(frequency_hz: FloatArray) -> IntArray:
    """Indices of lines at even distances on a logarithmic axis, as far as there are some."""
    wanted = np.geomspace(frequency_hz[0], frequency_hz[-1], _SHOWN)
    return np.unique(np.abs(np.log(frequency_hz[:, None] / wanted)).argmin(axis=0))


def left_out_section(solution: LpvSolution, held: Held, measured: Frf) -> Section:
    """Returns every element at the positions left out: response, deviations, model and error.

    Args:
        solution: The fit.
        held: The responses that were left out, and the sparse model's.
        measured: The same responses with the covariance of their noise.
    """
    noise = noise_deviation(solution, measured)
    figures = []
    for position, output, port in np.ndindex((len(held.points), *held.response.shape[2:])):
        at = (position, slice(None), output, port)
        curves = (
            _curve("|G|", held, held.response[at], _MEASURED),
            _curve("deviation of G", held, held.std[at], _DEVIATION),
            _curve("by noise alone", held, noise[at], _NOISE),
            _curve("model", held, held.modelled[at], _SPARSE, dashed=True),
            _curve(f"|G {MINUS} model|", held, (held.response - held.modelled)[at], _ERROR, points=True),
        )
        place = f"{places(held)[position]} {solution.ports.scheduling_units[0]}"
        title = f"{_element(solution, output, port)} at {place}"
        figures.append(
            Figure(title, _FREQUENCY, f"Magnitude [dB of {_units(solution)[output]}]", curves, log_y=False, height=420)
        )
    lead = (
        "The position that no fit has read. The deviation of G is the root of the total variance of the measured mean"
        " over realizations, which holds distortion by friction and ripple; that by noise alone comes from the periods."
        " A model is as good as these data can tell where its error is at the level of the deviation."
    )
    return Section("The position left out: Figs 7 and 8", lead, (Beside(tuple(figures), 2),))


def noise_deviation(solution: LpvSolution, measured: Frf) -> FloatArray:
    """Returns the deviation (n_pos, n_freq, n_out, n_in) of a response's mean by noise alone, of a fit's channels."""
    outputs = [measured.output_names.index(name) for name in solution.ports.outputs]
    inputs = [measured.input_names.index(name) for name in solution.ports.inputs]
    return np.sqrt(measured.element_variance(noise_only=True))[:, :, outputs][..., inputs]


def _curve(
    name: str,
    held: Held,
    values: ComplexArray | FloatArray,
    shade: int,
    *,
    dashed: bool = False,
    points: bool = False,
) -> Curve:
    y = tuple(_db(values).tolist())
    return Curve(name, tuple(held.frequency_hz.tolist()), y, points=points, symbol="small", shade=shade, dashed=dashed)


def _db(values: ComplexArray | FloatArray) -> FloatArray:
    size = np.abs(values)
    return np.asarray(20 * np.log10(np.where(size > 0, size, np.nan)))


def _phase(response: ComplexArray, near: ComplexArray) -> FloatArray:
    """Phase (n_pos, n_freq) within half a turn of another response's, which goes on from line to line [degrees]."""
    angle = np.degrees(np.unwrap(np.angle(near), axis=1))
    angle -= 360 * np.round((angle - angle[:1]).mean(axis=1, keepdims=True) / 360)
    return np.asarray(angle + (np.degrees(np.angle(response)) - angle + 180) % 360 - 180)


def _element(solution: LpvSolution, output: int, port: int) -> str:
    ports = solution.ports
    return f"{ports.outputs[output]} by {ports.inputs[port]}"


def _units(solution: LpvSolution) -> list[str]:
    """Unit of every output over the first input's."""
    ports = solution.ports
    return [pretty_unit(f"{unit}/({ports.input_units[0]})") for unit in ports.output_units]
