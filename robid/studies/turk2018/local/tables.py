"""How near each model is to the responses, and the paper's Tables I to IV beside ours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from robid.models.lpv.fit.model import LpvModel
from robid.models.lpv.fit.responses import expected_share
from robid.models.lpv.fit.solution import Held, LpvSolution
from robid.models.lpv.fit.state_space import MATRICES, block_names, measure
from robid.report.numbers import MISSING, percent, pretty_unit, significant
from robid.report.section import Row, Section, Table
from robid.studies.turk2018.local.figures import deviations, error_ratio, places, share_within

_LIMITS = (2.0, 1.0)


def nearness_section(solution: LpvSolution, left_out: Held, window: int) -> Section:
    """Returns how near the interpolated, the full and the sparse model are to fitted and to left-out responses.

    Args:
        solution: The fit.
        left_out: Responses that no fit read.
        window: Lines over which the fit's weights average the variance.
    """
    blocks = solution.blocks.kept
    models = (
        ("interpolated (SMILE)", solution.smile_model, blocks.size),
        ("all blocks fitted", solution.full_model, blocks.size),
        ("sparse", solution.model, int(blocks.sum())),
    )
    rows = []
    for word, held in (("Fitted positions", solution.own), ("Left out", left_out)):
        rows += [Row((name, str(count), *_nearness(held, model, window)), group=word) for name, model, count in models]
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
    return Section(
        "At rest: how near the models are", lead, (Table(heads, tuple(rows), caption=caption, fit="compact"),)
    )


def _nearness(held: Held, model: LpvModel, window: int) -> tuple[str, ...]:
    response = model.frozen_response(held.points, held.frequency_hz)
    ratio = deviations(held, response)
    shares = (percent(share_within(ratio, limit)) for limit in _LIMITS)
    return (*shares, significant(error_ratio(held, response, window)))


def block_section(solution: LpvSolution, paper: Mapping[str, Any]) -> Section:
    """Returns the sizes of the blocks of the interpolated and of the sparse model, the paper's beside ours."""
    sizes, sparse = solution.core_model.sizes, solution.blocks
    smile = measure(solution.dense.smile, solution.basis.basis().largest, sizes)
    names = tuple(pretty_unit(name) for name in solution.basis.names)
    whole, varying = ("1", *names), names
    printed = paper["smile"], paper["regularized"]
    tables = (
        _blocks("Table I: SMILE model, norms", whole, printed[0]["absolute"], smile.absolute.tolist()),
        _blocks("Table II: SMILE model, relative", varying, printed[0]["relative"], smile.relative.tolist()),
        _blocks("Table III: sparse model, norms", whole, printed[1]["absolute"], sparse.absolute.tolist()),
        _blocks("Table IV: sparse model, relative", varying, printed[1]["relative"], sparse.relative.tolist()),
    )
    gone = ", ".join(block_names(~sparse.kept)) or "none"
    lead = (
        f"Dropped in the paper: {', '.join(paper['dropped'])}. Dropped here: {gone}. Relative norms are over that of"
        " the constant block, times the largest value of the function."
    )
    return Section("Blocks: Tables I to IV", f"{lead} {_differences(solution, paper)}", tables)


def _blocks(
    title: str, names: tuple[str, ...], paper: Sequence[Sequence[float]], ours: Sequence[Sequence[float]]
) -> Table:
    """Norms of the blocks (matrix, function), a row a function."""
    rows = []
    for place, name in enumerate(names):
        cells = (_text(row, place) for pair in zip(paper, ours, strict=True) for row in pair)
        rows.append((name, *cells))
    heads = ("Function", *(head for matrix in MATRICES for head in (f"{matrix}, paper", "Ours")))
    return Table(heads, tuple(rows), title=title)


def _text(row: Sequence[float], place: int) -> str:
    return significant(row[place]) if place < len(row) else MISSING


def _differences(solution: LpvSolution, paper: Mapping[str, Any]) -> str:
    """Says why the numbers need not be alike."""
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
