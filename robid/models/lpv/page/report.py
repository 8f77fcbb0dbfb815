"""What a position-dependent fit adds to page, terminal and summary."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robid.artifacts.results import grade_from_artifact
from robid.models.family import Shown
from robid.models.lpv.files import solution_from_artifact, validation_from_artifact
from robid.models.lpv.fit.responses import expected_share
from robid.models.lpv.fit.solution import Held, LpvSolution, Ports
from robid.models.lpv.fit.state_space import MATRICES, block_names
from robid.models.lpv.judge.validating import LpvValidation
from robid.models.lpv.page.charts import (
    path_figures,
    place_label,
    pole_figures,
    response_figures,
    surface_figures,
)
from robid.models.parameters import parameter_rows, parameter_summary
from robid.report.numbers import MISSING, percent, significant
from robid.report.page import FitReport, Headline, KeyNumber
from robid.report.parameter_section import parameter_numbers, parameter_section, parameter_table
from robid.report.parameters import Estimates
from robid.report.section import Beside, Choice, ColumnStyle, Notes, Part, Row, Section, Table
from robid.results.grade import Grade

_FITTED, _CHOOSING, _NEW = "fitted", "chooses the structure", "left out"


def sections(
    solution: LpvSolution, estimates: Estimates, validation: LpvValidation | None, notes: tuple[str, ...]
) -> tuple[Section, ...]:
    """Lays out a fit.

    Args:
        solution: What it found.
        estimates: Its parameters as rows.
        validation: What its validation found, if there is one.
        notes: What the responses' estimator wants the reader to know.
    """
    return (
        _responses(solution, validation, notes),
        _blocks(solution),
        _path(solution),
        _range(solution),
        *parameter_section(estimates, _conventions(solution)),
    )


def _groups(solution: LpvSolution, validation: LpvValidation | None) -> tuple[tuple[str, Held], ...]:
    found = ((_FITTED, solution.own), (_CHOOSING, solution.choosing))
    return found if validation is None else ((_NEW, validation.held), *found)


def _responses(solution: LpvSolution, validation: LpvValidation | None, notes: tuple[str, ...]) -> Section:
    ports, groups = solution.ports, _groups(solution, validation)
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


def _agreements(groups: tuple[tuple[str, Held], ...], ports: Ports) -> Table:
    rows = []
    for word, held in groups:
        found, expected = held.agreement, expected_share(held.degrees_of_freedom)
        for position, output, port in np.ndindex(found.excess.shape):
            at = position, output, port
            cells = (
                place_label(ports, held.points[position]),
                f"{ports.outputs[output]} by {ports.inputs[port]}",
                _share(float(found.share_within[at])),
                _share(expected),
                significant(float(found.error_ratio[at]), 3) if np.isfinite(found.error_ratio[at]) else MISSING,
                significant(float(found.error_db[at]), 2),
                percent(float(found.excess[at])),
            )
            rows.append(Row(cells, group=word))
    heads = ("Position", "Element", "Within 2 deviations", "Of a perfect model", "Error / deviation", "Error [dB]",
             "Beyond noise")  # fmt: skip
    caption = (
        "Error / deviation: root mean square over the lines. Error in dB: median of the magnitudes. Beyond noise: root"
        " mean square of the error that the deviations do not explain, over the response at all positions, or over what"
        " is natural to an element by its row and column where that is larger."
    )
    styles: tuple[ColumnStyle, ...] = ("name", "text", "number", "number", "number", "number", "number")
    return Table(heads, tuple(rows), caption=caption, styles=styles, fit="tall")


def _share(value: float) -> str:
    return percent(value) if np.isfinite(value) else MISSING


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
        cells = (
            significant(float(path.gamma[index]), 3) if path.gamma[index] > 0 else "0",
            str(int(np.count_nonzero(path.kept[index]))),
            ", ".join(dropped) if dropped else MISSING,
            significant(float(path.refit_cost[index]), 5),
            significant(float(path.validation_cost[index]), 5),
            path.status[index].replace("_", " "),
            "chosen" if index == path.chosen else "",
        )
        rows.append(Row(cells, faint=index != path.chosen))
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


def _conventions(solution: LpvSolution) -> str:
    ports, points = solution.ports, solution.own.points
    places = "; ".join(f"p{index + 1}: {place_label(ports, point)}" for index, point in enumerate(points))
    return (
        "Poles of the frozen model at the fitted positions, as rates, or as natural frequencies and damping ratios;"
        f" the matrices themselves depend on the basis of the states. {places}."
    )


def report(shown: Shown) -> FitReport:
    """Lays out a position-dependent fit for page, terminal and summary."""
    solution = solution_from_artifact(shown.model)
    validation = None if shown.validation is None else validation_from_artifact(shown.validation)
    grade = grade_from_artifact(shown.model) if validation is None else validation.outcome.grade
    estimates = _estimates(shown, solution)
    frf = shown.data.frf
    notes = () if frf is None else tuple(note for note in frf.notes if note not in shown.told)
    return FitReport(
        headline=_headline(shown.data.name, solution, estimates, validation, grade),
        verdict=_verdict(solution, validation, grade, named=shown.data.settings.validate_on is not None),
        grade=grade.value,
        sections=sections(solution, estimates, validation, notes),
        parameters=estimates.rows,
        summary=_summary(solution, estimates, validation, grade),
        terminal=(parameter_table(estimates),),
    )


def _estimates(shown: Shown, solution: LpvSolution) -> Estimates:
    estimate = solution.estimate
    return Estimates(
        rows=parameter_rows(estimate, shown.true),
        level=estimate.confidence,
        undetermined=estimate.undetermined,
        identifiable_relative_std=estimate.identifiable_relative_std,
        interval_rule=estimate.interval_rule,
    )


def _headline(
    name: str, solution: LpvSolution, estimates: Estimates, validation: LpvValidation | None, grade: Grade
) -> Headline:
    return Headline(
        name=name,
        numbers=(*parameter_numbers(estimates, usable=grade.value > 0), *_numbers(solution, validation)),
        doubts=tuple(doubt.sentence for doubt in grade.doubts),
        status=solution.estimate.status.replace("_", " "),
        advice=solution.estimate.advice,
    )


def _numbers(solution: LpvSolution, validation: LpvValidation | None) -> Iterator[KeyNumber]:
    yield _error("Beyond noise, own data", solution.own)
    if validation is not None:
        yield _error("Beyond noise, new data", validation.held)
    kept = solution.blocks.kept
    yield KeyNumber(
        "Blocks", f"{int(kept.sum())} of {kept.size}", f"dropped: {', '.join(block_names(~kept)) or 'none'}"
    )


def _error(label: str, held: Held) -> KeyNumber:
    share, expected = _mean(held), expected_share(held.degrees_of_freedom)
    known = np.isfinite(share) and np.isfinite(expected)
    detail = (
        f"{percent(share)} of the lines within 2 deviations; {percent(expected)} of a perfect model" if known else ""
    )
    return KeyNumber(label, percent(_worst(held)), detail)


def _worst(held: Held) -> float:
    return float(np.nanmax(held.agreement.excess, initial=0.0))


def _mean(held: Held) -> float:
    """Share of all lines within two deviations; NaN where these are unknown."""
    share = held.agreement.share_within
    return float(np.nanmean(share)) if np.isfinite(share).any() else float("nan")


def _verdict(solution: LpvSolution, validation: LpvValidation | None, grade: Grade, *, named: bool) -> str:
    kept = solution.blocks.kept
    found = [
        grade.sentence,
        f"{solution.core.n_state} states at {len(solution.own.points)} positions,"
        f" {int(kept.sum())} of {kept.size} blocks.",
    ]
    if validation is None:
        found.append("Not validated." if named else "Not validated: no campaign was named to hold it against.")
    elif validation.outcome.ok:
        found.append(f"The model {validation.outcome.verdict}.")
    return " ".join(found)


def _summary(
    solution: LpvSolution, estimates: Estimates, validation: LpvValidation | None, grade: Grade
) -> dict[str, float]:
    kept = solution.blocks.kept
    found = {
        "grade": float(grade.value),
        "converged": float(solution.estimate.status == "converged"),
        "blocks": float(kept.size),
        "blocks_dropped": float(kept.size - kept.sum()),
        "largest_pole": solution.largest_pole,
        "misfit": solution.misfit,
        "gamma": float(solution.path.gamma[solution.path.chosen]),
        **_agreement("local", solution.own),
        **_agreement("choosing", solution.choosing),
        **parameter_summary(estimates.rows),
    }
    if validation is not None:
        found |= {"validation.ok": float(validation.outcome.ok), **_agreement("validation", validation.held)}
    return found


def _agreement(name: str, held: Held) -> dict[str, float]:
    found = {f"{name}.excess": _worst(held), f"{name}.error_db": float(np.nanmax(held.agreement.error_db))}
    return found | ({f"{name}.share_within_2std": _mean(held)} if np.isfinite(_mean(held)) else {})
