"""Tables for the end of a run, in the terminal."""

from __future__ import annotations

from rich.console import Group
from rich.table import Table
from rich.text import Text

from robid.report.parameters import (
    Estimates,
    ParameterLine,
    bootstrap_sentence,
    effective_sentence,
    kind_title,
    parameter_line,
    ratio_sentence,
)


def parameter_table(estimates: Estimates) -> Group:
    """Lays out parameters with intervals against nominal values, and the truth where it is known.

    Args:
        estimates: The parameters; those of the compensated torque are left to the page.

    Returns:
        A table with a section per kind; rows that are not identifiable are dim, and the notes say why.
    """
    rows = estimates.shown
    with_truth = any(row.truth is not None for row in rows)
    table = open_table("parameter")
    both = ("predicts ±", "physical") if estimates.with_effective else ()
    for header in ("estimate", *both, f"{100 * estimates.level:g} % interval"):
        table.add_column(header, justify="right", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    nominal = ("nominal",) if estimates.with_nominal else ()
    for header in ("±", *nominal, *(("truth", "off truth") if with_truth else ())):
        table.add_column(header, justify="right", no_wrap=True)
    footnotes = [ratio_sentence(estimates.torque_unit), effective_sentence(estimates)]
    footnotes += ["a: assumed, not published"] if any(row.assumed for row in rows) else []
    for kind in dict.fromkeys(row.kind for row in rows):
        title = kind_title(kind, estimates.torque_unit)
        table.add_row(Text(title, style="bold"))
        for row in rows:
            if row.kind == kind:
                line = parameter_line(row, estimates.identifiable_relative_std)
                cells = _cells(line, with_both=bool(both), with_nominal=estimates.with_nominal, with_truth=with_truth)
                table.add_row(*cells, style=None if row.identifiable else "dim")
                footnotes += [f"{title}, {line.name}: {line.note}"] if line.note else []
    footnotes += [bootstrap_sentence(estimates), *(f"{sentence}." for sentence in estimates.undetermined)]
    nuisances = len(estimates.rows) - len(rows)
    footnotes += [f"{nuisances} more, of friction and ripple, are in the report"] if nuisances else []
    return with_notes(table, footnotes)


def with_notes(table: Table, notes: list[str]) -> Group:
    """Puts what there is to say below a table."""
    said = [note for note in notes if note]
    return Group(table, Text("\n".join(said), style="dim")) if said else Group(table)


def open_table(first: str) -> Table:
    """Begins a table whose first column names the row."""
    table = Table(box=None, pad_edge=False, header_style="dim")
    table.add_column(first, no_wrap=True)
    return table


def _cells(line: ParameterLine, *, with_both: bool, with_nominal: bool, with_truth: bool) -> list[Text]:
    cells = [
        Text(f"  {line.name}"),
        Text(line.estimate, style="bold" if line.identifiable else ""),
        *((Text(line.predicts), Text(line.physical)) if with_both else ()),
        Text(f"{line.lower} … {line.upper}"),
        Text(line.unit),
        Text(line.half_width),
    ]
    if with_nominal:
        cells.append(Text(("a " if line.assumed else "") + line.nominal))
    if with_truth:
        outside = line.covered is False and line.identifiable
        off_truth = Text(f"{line.off_truth} outside", style="yellow") if outside else Text(line.off_truth)
        cells += [Text(line.truth), off_truth]
    return cells
