"""What a position-dependent fit adds to page, terminal and summary, with its figures."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robid.arrays import FloatArray
from robid.models.family import Shown
from robid.models.lpv.files import solution_from_artifact, validation_from_artifact
from robid.models.lpv.fit.responses import expected_share
from robid.models.lpv.fit.solution import Held, LpvSolution, Ports
from robid.models.lpv.fit.state_space import MATRICES, block_names
from robid.models.lpv.fit.uncertainty import continuous_poles
from robid.models.lpv.judge import UNUSABLE, LpvValidation
from robid.models.parameters import MEASURED, MODEL, curve, estimates_of, fit_report, quantile
from robid.report.correlation import correlation_section
from robid.report.numbers import MISSING, joint_text, percent, significant
from robid.report.page import FitReport, KeyNumber
from robid.report.parameter_section import parameter_section
from robid.report.residuals import ResidualData, residual_section
from robid.report.section import Beside, Choice, ColumnStyle, Curve, Figure, Line, Notes, Part, Row, Section, Table
from robid.results.line_residuals import compare_lines

_SURFACE, _GRID = 7, 101


def place_label(ports: Ports, point: FloatArray) -> str:
    """Names a position by its scheduling parameters, angles in degrees."""
    pairs = zip(ports.scheduling, point.tolist(), ports.scheduling_units, strict=True)
    return ", ".join(
        f"{name} {joint_text(np.degrees(value), unit)}°"
        if unit == "rad"
        else f"{name} {joint_text(value, unit) if unit == 'm' else significant(value, 4)} {unit}"
        for name, value, unit in pairs
    )


def gain_title(ports: Ports, output: int, port: int) -> str:
    """Names the magnitude of an element with its unit."""
    return f"Magnitude [{ports.output_units[output]} / ({ports.input_units[port]})]"


def response_figures(held: Held, ports: Ports, place: tuple[int, int, int], confidence: float) -> tuple[Figure, Figure]:
    """Magnitude and phase of one element (position, output, input), measured and modelled, with their bands."""
    at = (place[0], slice(None), place[1], place[2])
    measured, model, frequency_hz = held.response[at], held.modelled[at], held.frequency_hz
    radius = np.where(np.isfinite(held.std[at]), held.std[at], np.nan) * np.sqrt(-np.log(1 - confidence))
    half = quantile(confidence) * held.modelled_std[at] / np.sqrt(2)
    left_out = np.isinf(held.std[at])
    size, angle = np.where(left_out, np.nan, np.abs(measured)), np.degrees(np.unwrap(np.angle(model)))
    phase = angle + (np.degrees(np.angle(measured)) - angle + 180) % 360 - 180
    turned, own = (
        np.degrees(np.arcsin(np.minimum(wide / np.maximum(np.abs(one), np.finfo(float).tiny), 1.0)))
        for wide, one in ((radius, measured), (half, model))
    )
    heights = (
        curve("measured", frequency_hz, size, MEASURED, radius, points=True),
        curve("model", frequency_hz, np.abs(model), MODEL, np.minimum(half, np.abs(model))),
    )
    angles = (
        curve("measured", frequency_hz, np.where(left_out, np.nan, phase), MEASURED, turned, points=True),
        curve("model", frequency_hz, angle, MODEL, own),
    )
    known = np.concatenate([size[np.isfinite(size)], np.abs(model)])
    known = known[known > 0]
    ends = (0.5 * float(known.min()), 2.0 * float(known.max())) if known.size else None
    return (
        Figure("Magnitude", "Frequency [Hz]", gain_title(ports, place[1], place[2]), heights, y_range=ends),
        Figure("Phase", "Frequency [Hz]", "Phase [°]", angles, log_y=False),
    )


def surface_figures(solution: LpvSolution, output: int, port: int) -> tuple[Figure, ...]:
    """Magnitude of one element of the frozen model over the range of the first scheduling parameter."""
    points = _line(solution, _SURFACE)
    lines = solution.own.frequency_hz
    frequency_hz = np.geomspace(lines[0], lines[-1], 4 * _GRID) if lines.size > 1 else lines
    size = np.abs(solution.model.frozen_response(points, frequency_hz)[..., output, port])
    curves = tuple(
        Curve(place_label(solution.ports, point), tuple(frequency_hz.tolist()), tuple(one.tolist()))
        for point, one in zip(points, size, strict=True)
    )
    return (Figure("Over the range", "Frequency [Hz]", gain_title(solution.ports, output, port), curves, height=380),)


def pole_figures(solution: LpvSolution) -> tuple[Figure, Figure]:
    """Natural frequencies and damping ratios of the frozen model over the range of the first scheduling parameter."""
    points = _line(solution, _GRID)
    poles = continuous_poles(solution.core_model.at(points).A, solution.ports.sampling_period_s)
    upper = poles.imag >= 0
    size = np.abs(poles)
    along = np.broadcast_to(_readable(points[:, 0], solution.ports.scheduling_units[0])[:, None], size.shape)[upper]
    hertz, damping = size[upper] / (2 * np.pi), -poles.real[upper] / np.maximum(size[upper], np.finfo(float).tiny)
    fitted = tuple(
        Line("x", float(value))
        for value in _readable(np.unique(solution.own.points[:, 0]), solution.ports.scheduling_units[0])
    )
    name, unit = solution.ports.scheduling[0], solution.ports.scheduling_units[0]
    title = f"{name} [{'°' if unit == 'rad' else unit}]"
    drawn = [curve("poles", along, values, MODEL, points=True) for values in (hertz, damping)]
    common = {"log_x": False, "legend": False, "lines": fitted}
    return (
        Figure("Natural frequencies", title, "Frequency [Hz]", (drawn[0],), log_y=True, **common),  # type: ignore[arg-type]
        Figure("Damping ratios", title, "Damping ratio", (drawn[1],), log_y=False, **common),  # type: ignore[arg-type]
    )


def path_figures(solution: LpvSolution) -> tuple[Figure, Figure]:
    """Costs and number of blocks over the price of a block."""
    path = solution.path
    priced = path.gamma > 0
    gamma = path.gamma[priced]
    lines = (Line("x", float(path.gamma[path.chosen]), "chosen"),) if priced[path.chosen] else ()
    left = tuple(float(np.count_nonzero(kept)) for kept in path.kept[priced])
    costs = (
        curve("of the fit", gamma, path.refit_cost[priced], MEASURED),
        curve("of what chooses", gamma, path.validation_cost[priced], MODEL),
    )
    blocks = (Curve("blocks", tuple(gamma.tolist()), left, points=True, shade=MODEL),)
    return (
        Figure("Costs after the refit", "Price of a block", "Weighted cost", costs, lines=lines),
        Figure("Blocks that are left", "Price of a block", "Blocks", blocks, log_y=False, legend=False, lines=lines),
    )


def _line(solution: LpvSolution, count: int) -> FloatArray:
    """Points (count, n_scheduling) along the first scheduling parameter, the others in the middle."""
    lower, upper = solution.basis.lower, solution.basis.upper
    points = np.tile(0.5 * (lower + upper), (count, 1))
    points[:, 0] = np.linspace(lower[0], upper[0], count)
    return points


def _readable(values: FloatArray, unit: str) -> FloatArray:
    return np.degrees(values) if unit == "rad" else values


_FITTED, _CHOOSING, _NEW = "fitted", "chooses the structure", "left out"


def _responses(solution: LpvSolution, validation: LpvValidation | None, notes: tuple[str, ...]) -> Section:
    ports, new = solution.ports, () if validation is None else ((_NEW, validation.held),)
    groups = (*new, (_FITTED, solution.own), (_CHOOSING, solution.choosing))
    options: list[tuple[str, tuple[Part, ...]]] = []
    for output, port in np.ndindex(len(ports.outputs), len(ports.inputs)):
        element = f"{ports.outputs[output]} by {ports.inputs[port]}"
        options.append((f"{element}, over the range", surface_figures(solution, output, port)))
        for word, held in groups:
            for position in range(len(held.points)):
                figures = response_figures(held, ports, (position, output, port), solution.estimate.confidence)
                name = f"{element}, {place_label(ports, held.points[position])} ({word})"
                options.append((name, (Beside(figures, 2),)))
    lead = (
        "Measured responses at rest against the frozen model, both with their bands, at the fitted positions and at"
        " those left out."
    )
    parts: list[Part] = [_agreements(groups, ports), Choice("Element and position", tuple(options))]
    parts += [Notes(notes)] if notes else []
    return Section("Responses over the positions", lead, tuple(parts), "response")


_DEVIATION = "A deviation is that of the measured response, nothing else."


def _residuals(solution: LpvSolution, validation: LpvValidation | None) -> Iterator[ResidualData]:
    """Residuals at the fitted positions, at those that choose the structure, and at those left out."""
    ports, new = solution.ports, () if validation is None else (("positions left out", validation.held),)
    for name, held in (
        ("fitted positions", solution.own),
        ("positions that choose the structure", solution.choosing),
        *new,
    ):
        if len(held.points):
            lines = compare_lines(held.response, held.modelled, held.std)
            yield ResidualData(name, held.frequency_hz, ports.outputs, ports.inputs, lines)


def _agreements(groups: tuple[tuple[str, Held], ...], ports: Ports) -> Table:
    rows = []
    for word, held in groups:
        found, expected = held.agreement, expected_share(held.degrees_of_freedom)
        for position, output, port in np.ndindex(found.excess.shape):
            at = position, output, port
            named = place_label(ports, held.points[position]), f"{ports.outputs[output]} by {ports.inputs[port]}"
            within = percent(float(found.share_within[at])), percent(expected)
            ratio = significant(float(found.error_ratio[at]), 3) if np.isfinite(found.error_ratio[at]) else MISSING
            off = significant(float(found.error_db[at]), 2), percent(float(found.excess[at]))
            rows.append(Row((*named, *within, ratio, *off), group=word))
    heads = ("Position", "Element", "Within 2 deviations", "Of a perfect model", "Error / deviation", "Error [dB]",
             "Beyond noise")  # fmt: skip
    caption = (
        "Error / deviation: root mean square over the lines. Error in dB: median of the magnitudes. Beyond noise: root"
        " mean square of the error that the deviations do not explain, over the response at all positions, or over what"
        " is natural to an element by its row and column where that is larger."
    )
    styles: tuple[ColumnStyle, ...] = ("name", "text", "number", "number", "number", "number", "number")
    return Table(heads, tuple(rows), caption=caption, styles=styles, fit="tall")


def _blocks(solution: LpvSolution) -> Section:
    blocks, names = solution.blocks, solution.basis.names
    rows = []
    for row, matrix in enumerate(MATRICES):
        cells = [matrix, significant(float(blocks.absolute[row, 0]), 4)]
        cells += [
            significant(float(size), 3) if kept else MISSING
            for size, kept in zip(blocks.relative[row], blocks.kept[row], strict=True)
        ]
        rows.append(tuple(cells))
    dropped = block_names(~blocks.kept)
    caption = (
        "Constant block: Euclidean norm. Others: what a block contributes at most over the range, relative to the"
        f" constant one. Dropped: {', '.join(dropped) if dropped else 'none'}."
    )
    table = Table(("Matrix", "constant", *names), tuple(rows), caption=caption, fit="compact")
    lead = "A(p) = A₀ + Σ Aₖ ψₖ(p), and B, C and D alike: the blocks that the model needs, in its own basis of states."
    return Section("Blocks", lead, (table,), "blocks")


def _path(solution: LpvSolution) -> Section:
    path = solution.path
    rows = []
    for index in range(len(path.gamma)):
        dropped = block_names(~path.kept[index])
        price = significant(float(path.gamma[index]), 3) if path.gamma[index] > 0 else "0"
        left = str(int(np.count_nonzero(path.kept[index]))), ", ".join(dropped) if dropped else MISSING
        costs = (significant(float(each[index]), 5) for each in (path.refit_cost, path.validation_cost))
        ended = path.status[index].replace("_", " "), "chosen" if index == path.chosen else ""
        rows.append(Row((price, *left, *costs, *ended), faint=index != path.chosen))
    heads = ("Price", "Blocks", "Dropped", "Cost", "Cost of what chooses", "Refit", "")
    styles: tuple[ColumnStyle, ...] = ("name", "number", "text", "number", "number", "text", "text")
    table = Table(heads, tuple(rows), styles=styles, fit="tall")
    lead = (
        "Each block has a price; what vanishes at a price is dropped, and the rest is fitted again without prices. Of"
        " the models that are near the best on responses that the fit does not see, the one with the fewest blocks is"
        " chosen."
    )
    return Section("Regularisation path", lead, (table, Beside(path_figures(solution), 2)), "path")


def _range(solution: LpvSolution) -> Section:
    place = place_label(solution.ports, solution.largest_pole_at)
    stable = solution.largest_pole < 1
    told = (
        f"The frozen model is {'stable' if stable else 'not stable'} over its range: the largest pole has the absolute"
        f" value {solution.largest_pole:.6f}, at {place}. Integrators are not counted, and a parameter that moves fast"
        " may still excite what is stable at rest."
    )
    lead = "Poles of the frozen model over the first scheduling parameter; lines show the fitted positions."
    return Section("Over the range", lead, (Notes((told,)), Beside(pole_figures(solution), 2)), "range")


def report(shown: Shown) -> FitReport:
    """Lays out a position-dependent fit for page, terminal and summary."""
    solution = solution_from_artifact(shown.model)
    validation = None if shown.validation is None else validation_from_artifact(shown.validation)
    estimates, kept, points = estimates_of(shown, solution.estimate), solution.blocks.kept, solution.own.points
    frf = shown.data.frf
    notes = () if frf is None else tuple(note for note in frf.notes if note not in shown.told)
    left = f"{int(kept.sum())} of {kept.size}"
    blocks = KeyNumber("Blocks", left, f"dropped: {', '.join(block_names(~kept)) or 'none'}")
    new = [] if validation is None else [_error("Beyond noise, new data", validation.held)]
    places = "; ".join(f"p{at}: {place_label(solution.ports, point)}" for at, point in enumerate(points, start=1))
    conventions = (
        "Poles of the frozen model at the fitted positions, as rates, or as natural frequencies and damping ratios;"
        f" the matrices themselves depend on the basis of the states. {places}."
    )
    return fit_report(
        shown,
        solution.estimate,
        estimates,
        None if validation is None else validation.outcome,
        found=f"{solution.core.n_state} states at {len(points)} positions, {left} blocks",
        numbers=[_error("Beyond noise, own data", solution.own), *new, blocks],
        sections=(
            _responses(solution, validation, notes),
            *residual_section(tuple(_residuals(solution, validation)), _DEVIATION),
            _blocks(solution),
            _path(solution),
            _range(solution),
            *parameter_section(estimates, conventions),
            *correlation_section(estimates),
        ),
        summary=_summary(solution, validation),
        worst=("", "")
        if validation is None
        else (f"{percent(_worst(validation.held))} of the response", percent(UNUSABLE)),
    )


def _error(label: str, held: Held) -> KeyNumber:
    share, expected = _mean(held), expected_share(held.degrees_of_freedom)
    told = f"{percent(share)} of the lines within 2 deviations; {percent(expected)} of a perfect model"
    return KeyNumber(label, percent(_worst(held)), told if np.isfinite(share) and np.isfinite(expected) else "")


def _worst(held: Held) -> float:
    return float(np.nanmax(held.agreement.excess, initial=0.0))


def _mean(held: Held) -> float:
    """Share of all lines within two deviations; NaN where these are unknown."""
    share = held.agreement.share_within
    return float(np.nanmean(share)) if np.isfinite(share).any() else float("nan")


def _summary(solution: LpvSolution, validation: LpvValidation | None) -> dict[str, float]:
    kept = solution.blocks.kept
    found = {
        "blocks": float(kept.size),
        "blocks_dropped": float(kept.size - kept.sum()),
        "largest_pole": solution.largest_pole,
        "misfit": solution.misfit,
        "gamma": float(solution.path.gamma[solution.path.chosen]),
        **_agreement("local", solution.own),
        **_agreement("choosing", solution.choosing),
    }
    if validation is not None:
        found |= {"validation.ok": float(validation.outcome.ok), **_agreement("validation", validation.held)}
    return found


def _agreement(name: str, held: Held) -> dict[str, float]:
    found = {f"{name}.excess": _worst(held), f"{name}.error_db": float(np.nanmax(held.agreement.error_db))}
    return found | ({f"{name}.share_within_2std": _mean(held)} if np.isfinite(_mean(held)) else {})
