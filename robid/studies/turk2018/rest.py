"""The model at rest beside the paper's: errors against the deviations of the responses, tables and Bode plots."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, TypeAlias

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray
from robid.artifacts.kinds import FRF, frf_from_artifact
from robid.artifacts.results import MODEL, VALIDATION
from robid.artifacts.store import read_artifact
from robid.frf.frf import Frf
from robid.models.lpv.files import solution_from_artifact, validation_from_artifact
from robid.models.lpv.fit.responses import expected_share, smooth_variance
from robid.models.lpv.fit.solution import Held, LpvSolution
from robid.models.lpv.fit.state_space import MATRICES, block_names, measure
from robid.models.lpv.settings import lpv_fit
from robid.pipeline.graph import Run
from robid.report.charts import Layer, Waterfall
from robid.report.numbers import MINUS, MISSING, percent, pretty_unit, significant
from robid.report.section import Beside, Curve, Figure, Row, Section, Table
from robid.studies.experiments import Further, fit_outputs, paper_figures
from robid.studies.page import Asked, PartFound
from robid.studies.settings.parts import RestCase
from robid.studies.study import Part, Results

_FREQUENCY = "Frequency [Hz]"
_SHOWN = 120  # Measured lines of one curve in space: all of them would hide the models
_Drawn: TypeAlias = Literal["points", "line", "dashed"]
_LAYERS: Mapping[str, _Drawn] = {"measured": "points", "sparse": "line", "SMILE": "dashed"}
_MEASURED, _SPARSE, _SMILE, _DEVIATION, _NOISE, _ERROR = range(6)


def places(held: Held) -> list[str]:
    """Writes the positions' first scheduling parameter."""
    return [f"{value:g}".replace("-", MINUS) for value in held.points[:, 0].tolist()]


def bode_section(solution: LpvSolution) -> Section:
    """Returns magnitude and phase of every element over the fitted positions, measured and of both models."""
    held = solution.own
    smile = solution.smile_model.frozen_response(held.points, held.frequency_hz)
    responses = (held.response, held.modelled, smile)
    parts: list[Beside] = []
    for output, port in np.ndindex(held.response.shape[2:]):
        element, name = [one[:, :, output, port] for one in responses], _element(solution, output, port)
        sizes, phases = [_db(one) for one in element], [_phase(one, element[1]) for one in element]
        size = _waterfall(f"{name}: magnitude", "Magnitude [dB]", solution, sizes)
        parts.append(Beside((size, _waterfall(f"{name}: phase", "Phase [°]", solution, phases)), 2))
    lead = (
        f"Responses at rest over the fitted positions, in dB of {', '.join(_units(solution))}; drag to turn. At high"
        " frequencies not every measured line is drawn. In the paper, too, interpolated and regularised models can"
        " hardly be distinguished."
    )
    return Section("Bode plots over the positions: Figs 3 to 6", lead, tuple(parts))


def _waterfall(title: str, y_title: str, solution: LpvSolution, heights: list[FloatArray]) -> Waterfall:
    """Measured, sparse and interpolated heights (n_pos, n_freq) over frequency and the first scheduling parameter."""
    held, ports = solution.own, solution.ports
    order, lines = np.argsort(held.points[:, 0]), np.arange(len(held.frequency_hz))
    # Lines at even distances on a logarithmic axis, as far as there are some.
    wanted = np.geomspace(held.frequency_hz[0], held.frequency_hz[-1], _SHOWN)
    spaced = np.unique(np.abs(np.log(held.frequency_hz[:, None] / wanted)).argmin(axis=0))
    layers = []
    for (name, drawn), rows in zip(_LAYERS.items(), heights, strict=True):
        shown = spaced if drawn == "points" else lines
        curves = tuple(tuple(row) for row in rows[order][:, shown].tolist())
        layers.append(Layer(name, tuple(held.frequency_hz[shown].tolist()), curves, drawn))
    along = tuple(held.points[order, 0].tolist())
    place_title = f"{ports.scheduling[0]} [{ports.scheduling_units[0]}]"
    return Waterfall(title, _FREQUENCY, place_title, y_title, along, tuple(layers))


def left_out_section(solution: LpvSolution, held: Held, measured: Frf) -> Section:
    """Returns every element at the positions left out: response, deviations, model and error."""
    outputs = [measured.output_names.index(name) for name in solution.ports.outputs]
    inputs = [measured.input_names.index(name) for name in solution.ports.inputs]
    noise = np.sqrt(measured.element_variance(noise_only=True))[:, :, outputs][..., inputs]
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
        y_title = f"Magnitude [dB of {_units(solution)[output]}]"
        figures.append(Figure(title, _FREQUENCY, y_title, curves, log_y=False, height=420))
    lead = (
        "The position that no fit has read. The deviation of G is the root of the total variance of the measured mean"
        " over realizations, which contains distortion by friction and ripple; that by noise alone comes from the"
        " periods. A model is as good as these data can tell where its error is at the level of the deviation."
    )
    return Section("The position left out: Figs 7 and 8", lead, (Beside(tuple(figures), 2),))


def _curve(
    name: str, held: Held, values: ComplexArray | FloatArray, shade: int, *, dashed: bool = False, points: bool = False
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
    ports = solution.ports
    return [pretty_unit(f"{unit}/({ports.input_units[0]})") for unit in ports.output_units]


_LIMITS = (2.0, 1.0)


def nearness_section(solution: LpvSolution, left_out: Held, window: int) -> Section:
    """Returns how near the interpolated, the full and the sparse model are to fitted and to left-out responses."""
    blocks = solution.blocks.kept
    models = (
        ("interpolated (SMILE)", solution.smile_model, blocks.size),
        ("all blocks fitted", solution.full_model, blocks.size),
        ("sparse", solution.model, int(blocks.sum())),
    )
    rows = []
    for word, held in (("Fitted positions", solution.own), ("Left out", left_out)):
        for name, model, count in models:
            answer = model.frozen_response(held.points, held.frequency_hz)
            shares = (percent(share_within(deviations(held, answer), limit)) for limit in _LIMITS)
            rows.append(Row((name, str(count), *shares, significant(error_ratio(held, answer, window))), group=word))
        perfect = (percent(expected_share(held.degrees_of_freedom, limit)) for limit in _LIMITS)
        rows.append(Row(("a perfect one", MISSING, *perfect, "1"), faint=True, group=word))
    heads = ("Model", "Blocks", "Within 2 deviations", "Within 1 deviation", "Error / deviation")
    caption = (
        "Share of the lines, of all positions and outputs, where the error is within deviations of the measured mean"
        " response (roots of its total variance). These are estimates, with"
        f" {left_out.degrees_of_freedom:g} complex degrees of freedom, so a perfect model is not within at more lines"
        " than a group's last row says. Error / deviation: root mean square, variances averaged over"
        f" {window} lines, as the fit weighs them."
    )
    unit = solution.ports.scheduling_units[0]
    own, other = (", ".join(places(held)) for held in (solution.own, left_out))
    lead = f"Models against measured responses, fitted at {own} {unit}, and at {other} {unit}, which no fit has read."
    shown = Table(heads, tuple(rows), caption=caption, fit="compact")
    return Section("At rest: how near the models are", lead, (shown,))


def block_section(solution: LpvSolution, paper: Mapping[str, Any]) -> Section:
    """Returns the sizes of the blocks of the interpolated and of the sparse model, the paper's beside ours."""
    sizes, sparse = solution.core_model.sizes, solution.blocks
    smile = measure(solution.dense.smile, solution.basis.basis().largest, sizes)
    varying = tuple(pretty_unit(name) for name in solution.basis.names)
    tables, heads = [], ("Function", *(head for matrix in MATRICES for head in (f"{matrix}, paper", "Ours")))
    for title, names, printed, key, ours in (
        ("Table I: SMILE model, norms", ("1", *varying), paper["smile"], "absolute", smile),
        ("Table II: SMILE model, relative", varying, paper["smile"], "relative", smile),
        ("Table III: sparse model, norms", ("1", *varying), paper["regularized"], "absolute", sparse),
        ("Table IV: sparse model, relative", varying, paper["regularized"], "relative", sparse),
    ):
        # Norms of the blocks by matrix, theirs and ours, some of fewer functions than others.
        norms = [row for pair in zip(printed[key], getattr(ours, key).tolist(), strict=True) for row in pair]
        rows = ((significant(row[at]) if at < len(row) else MISSING for row in norms) for at in range(len(names)))
        cells = tuple((name, *row) for name, row in zip(names, rows, strict=True))
        tables.append(Table(heads, cells, title=title))
    gone = ", ".join(block_names(~sparse.kept)) or "none"
    lead = (
        f"Dropped in the paper: {', '.join(paper['dropped'])}. Dropped here: {gone}. Relative norms are over that of"
        " the constant block, times the largest value of the function."
    )
    return Section("Blocks: Tables I to IV", f"{lead} {_differences(solution, paper)}", tuple(tables))


def _differences(solution: LpvSolution, paper: Mapping[str, Any]) -> str:
    ports, core = solution.ports, solution.core
    behind = sum(core.integrators)
    units = " and ".join(pretty_unit(unit) for unit in dict.fromkeys(ports.output_units))
    integrators = "no integrator" if behind == 0 else f"{behind} integrator{'s' if behind > 1 else ''}"
    return (
        f"The paper's model, of order {paper['order']}, leads to positions, one integrator"
        f" apart; ours, of order {core.n_state}, to outputs in {units}, {integrators} apart. Norms also depend on units"
        " and on the basis of the states: the SMILE model's is here the balanced one of the middle position, the"
        " sparse model's one in which few blocks vary."
    )


_ASKED = {
    "local.share_within_2std": Asked(lower=0.88),
    "left_out.share_within_2std": Asked(lower=0.80),
    "left_out.excess_percent": Asked(upper=5.0),
    "blocks_dropped": Asked(lower=7),
}
_DEVIATION_DB = Asked(20.0, 35.0)  # What the data have to be like, by the paper's Figs 7 and 8


def _conclude_local(run: Run, case: RestCase, _results: Results) -> PartFound:
    settings, paper = lpv_fit(run.loaded.experiment, case.fit), paper_figures(run.loaded)
    model, held = (run.path(output) for output in fit_outputs(case.fit))
    solution = solution_from_artifact(read_artifact(model, MODEL))
    validation = validation_from_artifact(read_artifact(held, VALIDATION))
    measured = frf_from_artifact(read_artifact(run.path(f"{settings.validate_on}/frf.h5"), FRF))
    left_out, window = validation.held, settings.weight_window
    figures = rest_figures(solution, left_out, window)
    sections = (
        nearness_section(solution, left_out, window),
        block_section(solution, paper),
        bode_section(solution),
        left_out_section(solution, left_out, measured),
    )
    return PartFound(figures, asked_of(figures), sections)


def asked_of(figures: Mapping[str, float]) -> dict[str, Asked]:
    """Returns what is asked of the figures."""
    return {**_ASKED, **{name: _DEVIATION_DB for name in figures if ".median_deviation_db." in name}}


def deviations(held: Held, response: ComplexArray) -> FloatArray:
    """Returns the error of a response (n_pos, n_freq, n_out, n_in) over the deviation of the measured mean.

    NaN where that is unknown or the element is left out.
    """
    error = np.abs(response - held.response)
    return np.asarray(np.divide(error, held.std, out=np.full(error.shape, np.nan), where=_is_known(held)))


def share_within(ratio: FloatArray, limit: float) -> float:
    """Returns the share of all known ratios within a limit; NaN where there is none."""
    known = ratio[np.isfinite(ratio)]
    return float(np.mean(known <= limit)) if known.size else float("nan")


def below_response_db(held: Held) -> FloatArray:
    """Returns how far (n_out,) the deviations are below the responses: median over positions, lines and inputs [dB]."""
    size = np.where(_is_known(held), held.std, np.nan)
    return np.asarray(np.nanmedian(20 * np.log10(np.abs(held.response) / size), axis=(0, 1, 3)))


def error_ratio(held: Held, response: ComplexArray, window: int) -> float:
    """Returns the root mean square over all lines of a model's error over its deviation, as a fit weighs it.

    The model's response is (n_pos, n_freq, n_out, n_in); the variance is averaged over a window of lines, so that few
    lines with small estimates do not decide.
    """
    known = _is_known(held)
    variance = smooth_variance(np.where(known, held.std, np.inf) ** 2, window)
    return float(np.sqrt(np.mean((np.abs(response - held.response) ** 2 / variance)[known])))


def rest_figures(solution: LpvSolution, left_out: Held, window: int) -> dict[str, float]:
    """Returns what the study says of the model at rest."""
    kept, outputs = solution.blocks.kept, solution.ports.outputs
    full = solution.full_model.frozen_response(left_out.points, left_out.frequency_hz)
    sparse, dense = (error_ratio(left_out, response, window) for response in (left_out.modelled, full))
    return {
        **_held_figures("local", solution.own, outputs),
        **_held_figures("left_out", left_out, outputs),
        "perfect_share_within_2std": expected_share(left_out.degrees_of_freedom),
        "perfect_share_within_1std": expected_share(left_out.degrees_of_freedom, 1.0),
        "left_out.error_ratio": sparse,
        "left_out.full_error_ratio": dense,
        "left_out.excess_percent": 100 * (sparse / dense - 1),
        "blocks": float(kept.size),
        "blocks_dropped": float(kept.size - kept.sum()),
        "largest_pole": solution.largest_pole,
    }


def _held_figures(name: str, held: Held, outputs: tuple[str, ...]) -> dict[str, float]:
    ratio = deviations(held, held.modelled)
    below = zip(outputs, below_response_db(held).tolist(), strict=True)
    return {
        f"{name}.share_within_2std": share_within(ratio, 2.0),
        f"{name}.share_within_1std": share_within(ratio, 1.0),
        **{f"{name}.median_deviation_db.{output}": one for output, one in below},
    }


def _is_known(held: Held) -> BoolArray:
    return np.isfinite(held.std) & (held.std > 0)


def _further_local(run: Run, case: RestCase) -> Further:
    return ((run, (*fit_outputs(case.fit), f"{lpv_fit(run.loaded.experiment, case.fit).validate_on}/frf.h5")),)


REST = Part("local", _conclude_local, further=_further_local)
