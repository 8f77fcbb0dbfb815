"""Tables for the end of a run, in the terminal."""

from __future__ import annotations

from collections.abc import Iterator

from rich.console import Group
from rich.table import Table
from rich.text import Text

from robid.report.content import FitContent
from robid.report.tables import (
    NUISANCE,
    ParameterLine,
    bootstrap_sentence,
    kind_title,
    parameter_line,
    ratio_sentence,
    resonance_line,
)

_FEW_MOTORS = 2


def fit_tables(fit: FitContent) -> Iterator[Group]:
    """Yields what the end of a run shows of a fit: its parameters and, of a small drive, its resonances."""
    yield parameter_table(fit)
    if fit.resonances and len(fit.frf.input_names) <= _FEW_MOTORS:
        yield resonance_table(fit)


def parameter_table(fit: FitContent) -> Group:
    """Lays out parameters with intervals against nominal values, and the truth where it is known.

    Args:
        fit: The fit; what it estimates of the compensated torque is left to the page.

    Returns:
        A table with a section per kind; rows that are not identifiable are dim, and the notes say why.
    """
    rows = [row for row in fit.parameters if row.kind != NUISANCE]
    with_truth = any(row.truth is not None for row in rows)
    table = _table("parameter")
    for header in ("estimate", f"{100 * fit.level:g} % interval"):
        table.add_column(header, justify="right", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    for header in ("±", "nominal", *(("truth", "off truth") if with_truth else ())):
        table.add_column(header, justify="right", no_wrap=True)
    footnotes = [ratio_sentence(fit.frf.torque_unit)]
    footnotes += ["a: assumed, not published"] if any(row.assumed for row in rows) else []
    for kind in dict.fromkeys(row.kind for row in rows):
        title = kind_title(kind, fit.frf.torque_unit)
        table.add_row(Text(title, style="bold"))
        for row in rows:
            if row.kind == kind:
                line = parameter_line(row, fit.identifiable_relative_std)
                table.add_row(*_cells(line, with_truth=with_truth), style=None if row.identifiable else "dim")
                footnotes += [f"{title}, {line.name}: {line.note}"] if line.note else []
    footnotes += [bootstrap_sentence(fit), *(f"{sentence}." for sentence in fit.undetermined)]
    nuisances = len(fit.parameters) - len(rows)
    footnotes += [f"{nuisances} more, of friction and ripple, are in the report"] if nuisances else []
    return _with_notes(table, footnotes)


def resonance_table(fit: FitContent) -> Group:
    """Lays out measured resonances and antiresonances beside the fitted model's own, each with its interval."""
    table = _table("resonances [Hz]")
    for header in ("model", f"{100 * fit.level:g} % interval", "measured", f"{100 * fit.level:g} % interval"):
        table.add_column(header, justify="right", no_wrap=True)
    found = [row for row in fit.resonances if row.mode_hz is not None]
    for row in found:
        line = resonance_line(row)
        place = f", configuration {line.number}" if len(fit.frf.configurations) > 1 else ""
        name = Text(f"  {line.channel} {line.kind}{place}")
        table.add_row(name, Text(line.mode, style="bold"), line.mode_interval, line.measured, line.interval)
    alone = len(fit.resonances) - len(found)
    return _with_notes(table, [f"{alone} more that the model does not have are in the report"] if alone else [])


def _with_notes(table: Table, notes: list[str]) -> Group:
    said = [note for note in notes if note]
    return Group(table, Text("\n".join(said), style="dim")) if said else Group(table)


def _table(first: str) -> Table:
    table = Table(box=None, pad_edge=False, header_style="dim")
    table.add_column(first, no_wrap=True)
    return table


def _cells(line: ParameterLine, *, with_truth: bool) -> list[Text]:
    cells = [
        Text(f"  {line.name}"),
        Text(line.estimate, style="bold" if line.identifiable else ""),
        Text(f"{line.lower} … {line.upper}"),
        Text(line.unit),
        Text(line.half_width),
        Text(("a " if line.assumed else "") + line.nominal),
    ]
    if with_truth:
        outside = line.covered is False and line.identifiable
        off_truth = Text(f"{line.off_truth} outside", style="yellow") if outside else Text(line.off_truth)
        cells += [Text(line.truth), off_truth]
    return cells
