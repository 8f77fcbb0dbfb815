"""`robid fit --try`: what a fit becomes where more is freed, beside what it is."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from rich.text import Text

from robid.arrays import Meaning
from robid.artifacts.artifact import Artifact
from robid.artifacts.results import estimate_from_artifact, grade_from_artifact
from robid.commands.output import Answer, print_json
from robid.commands.shared import choose_node, graded, make_shell, require_inputs
from robid.errors import SettingsError
from robid.models.family import Work
from robid.models.parameters import parameter_rows
from robid.pipeline.export import export_plan
from robid.pipeline.fit import Trial, tried_experiment, try_fit, write_tried
from robid.pipeline.freshness import check_outputs, input_hashes
from robid.pipeline.graph import Run
from robid.pipeline.stage import Job
from robid.report.numbers import duration, percent, scale_for, significant
from robid.report.parameters import ParameterRow, kind_title
from robid.report.terminal_table import Column, TerminalTable
from robid.results.grade import WORDS
from robid.robot.parameters import FRICTION_KIND

_MOVED = 1.0  # half-widths


@dataclass(frozen=True)
class Value:
    """A parameter before or after."""

    value: Annotated[float, Meaning("Its value.")]
    half_width: Annotated[float, Meaning("Half of its interval.")]
    unit: Annotated[str, Meaning("SI unit of both.")]


@dataclass(frozen=True)
class Side:
    """A fit before or after."""

    cost: Annotated[float, Meaning("What it has minimised.")]
    misfit: Annotated[float, Meaning("Cost over what noise and the assumed model error give.")]
    grade: Annotated[int, Meaning("Its grade by itself: 1 *predicts*, 0 *do not use*.")]
    grade_sentence: Annotated[str, Meaning("The grade, why it is no better, and the likeliest cause.")]
    parameters: Annotated[dict[str, Value], Meaning("Parameters by name.")]


@dataclass(frozen=True)
class TryAnswer(Answer, type="fit-try"):
    """What a fit becomes where more is freed."""

    fit: Annotated[str, Meaning("The fit.")]
    tried: Annotated[tuple[str, ...], Meaning("What was freed.")]
    output: Annotated[str | None, Meaning("Where the fit with it was written; null where `--output` was not given.")]
    before: Annotated[Side, Meaning("The fit as it is.")]
    after: Annotated[Side, Meaning("The fit with more freed.")]


def check_try(others: Mapping[str, object]) -> None:
    """Refuses `--try` beside options that it does not know.

    Raises:
        SettingsError: If one is given.
    """
    given = [name for name, value in others.items() if value]
    if given:
        message = f"S018 `{given[0]}` says nothing of a fit that is only tried"
        raise SettingsError(message, where="--try", remedy=f"leave out {given[0]}")


def try_freeing(run: Run, fit: str | None, names: list[str], output: Path | None, *, force: bool, as_json: bool) -> int:
    """Refits with more freed from the minimum found, and sets both side by side; returns the exit code."""
    node = choose_node(run, "fit", fit)
    tried = tried_experiment(run.loaded, node.owner, names)
    inputs = require_inputs(run, dataclasses.replace(node, plan=export_plan(run.loaded, node.owner)), [])
    plan = node.stage.plan(tried, node.owner)
    if output is not None:
        check_outputs(run.loaded, node.stage, plan, inputs, output)
        if output.exists() and not force:
            raise SettingsError(
                "S006 the file is there already", where=f"--output {output}", remedy="`--force` replaces it"
            )
    shell, begun = make_shell(run, as_json=as_json), time.monotonic()
    label = f"{node.owner} with {', '.join(names)}"
    with run.make_map() as parallel_map, shell.progress(label, workers=run.at_a_time) as progress:
        trial = try_fit(tried, node.owner, inputs, Work(parallel_map, progress))
        if output is not None:
            read = {name: path for name, path in inputs.items() if name != "model"}
            hashes = input_hashes(plan, read)
            of = (tried, node.stage.name, node.owner, plan.settings, output, read, hashes)
            write_tried(trial, Job(*of, run.folder, parallel_map, 1, progress))
    if as_json:
        sides = (_told(model, trial) for model in (trial.before, trial.after))
        print_json(TryAnswer(node.owner, tuple(names), None if output is None else str(output), *sides))
        return 0
    shell.show(side_by_side(trial, node.owner, names))
    ended = "nothing is written" if output is None else f"written to {output}"
    free = ", ".join(tried.plain["fits"][node.owner]["free"])
    shell.say(f"{ended}; `free: [{free}]` in fits.{node.owner} makes it so ({duration(time.monotonic() - begun)})")
    return 0


def _told(model: Artifact, trial: Trial) -> Side:
    rows = {row.name: Value(row.middle, _half(row), row.unit) for row in _rows(model, trial, full=True)}
    return Side(_cost(model), _misfit(model), parameters=rows, **graded(grade_from_artifact(model)))


def side_by_side(trial: Trial, fit: str, names: list[str]) -> TerminalTable:
    """Lays out value and half-width of each parameter, cost and grade, before and after; what moved stands out."""
    freed = f"with {', '.join(names)}"
    columns = (
        *(Column("parameter", numbers=False), Column(fit), Column("±", leaves=2)),
        *(Column(freed), Column("±", leaves=2), Column("unit", numbers=False), Column("moved", leaves=1)),
    )
    table = TerminalTable(columns)
    before = {(row.kind, row.name): row for row in _rows(trial.before, trial)}
    after = {(row.kind, row.name): row for row in _rows(trial.after, trial)}
    every = [*before, *(key for key in after if key not in before)]
    for kind in dict.fromkeys(kind for kind, _ in every):
        table.add(Text(kind_title(kind, trial.torque_unit), style="bold"))
        for key in every:
            if key[0] == kind:
                _add(table, key[1], before.get(key), after.get(key))
    _add_figures(table, trial)
    return table


def _add(table: TerminalTable, name: str, before: ParameterRow | None, after: ParameterRow | None) -> None:
    rows = [row for row in (after, before) if row is not None]
    scale = scale_for(rows[0].middle or rows[0].nominal, rows[0].unit, _half(rows[0]))
    cells = []
    for row in (before, after):
        cells += ["", ""] if row is None else [scale.text(row.middle), scale.text(_half(row))]
    moved, style = "", "" if before is not None else "bold"
    if before is not None and after is not None:
        moved = percent(after.middle / before.middle - 1, signed=True) if before.middle else ""
        half = _half(before)
        style = "bold" if half > 0 and abs(after.middle - before.middle) / half > _MOVED else ""
    table.add(*(Text(cell, style) for cell in (f"  {name}", *cells, scale.unit, moved)))


def _add_figures(table: TerminalTable, trial: Trial) -> None:
    models = trial.before, trial.after
    table.add(Text("Fit", style="bold"))
    cost = [_cost(model) for model in models]
    shown = [cell for value in cost for cell in (significant(value, 4), "")]
    table.add("  cost", *shown, "", percent(cost[1] / cost[0] - 1, signed=True) if cost[0] else "")
    misfit = [cell for model in models for cell in (significant(_misfit(model), 3), "")]
    table.add("  over noise and model error", *misfit, "", "")
    grade = [cell for model in models for cell in (WORDS[grade_from_artifact(model).value].split(",")[0], "")]
    table.add("  grade by itself", *grade, "", "")


def _rows(model: Artifact, trial: Trial, *, full: bool = False) -> list[ParameterRow]:
    estimate = estimate_from_artifact(model)
    rows = parameter_rows(estimate, {}, (), trial.torque_unit)
    if full:
        return [dataclasses.replace(row, name=name) for row, name in zip(rows, estimate.names, strict=True)]
    return [row for row in rows if row.kind != FRICTION_KIND]


def _half(row: ParameterRow) -> float:
    return 0.5 * (row.upper - row.lower)


def _cost(model: Artifact) -> float:
    return float(str(model.attributes["elastic/costs/total"]))


def _misfit(model: Artifact) -> float:
    return float(str(model.attributes["elastic/misfit"]))
