"""Tables for the end of a run, in the terminal."""

from __future__ import annotations

from rich.table import Table
from rich.text import Text

from robid.report.content import ParameterRow
from robid.report.tables import KIND_TITLES, ParameterLine, parameter_line


def parameter_table(
    rows: tuple[ParameterRow, ...], *, level: float = 0.95, identifiable_relative_std: float | None = None
) -> Table:
    """Lays out parameters with intervals against nominal values, and the truth where it is known.

    Args:
        rows: The parameters, in the order to show.
        level: Level of the intervals.
        identifiable_relative_std: Predicted deviation up to which a parameter counts as identifiable.

    Returns:
        A table with a section per kind; rows that are not identifiable are dim, and the caption says why.
    """
    with_truth = any(row.truth is not None for row in rows)
    table = Table(box=None, pad_edge=False, header_style="dim", caption_justify="left", caption_style="dim")
    table.add_column("parameter", no_wrap=True)
    for header in ("estimate", f"{100 * level:g} % interval"):
        table.add_column(header, justify="right", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    for header in ("±", "nominal", *(("truth", "off truth") if with_truth else ())):
        table.add_column(header, justify="right", no_wrap=True)
    footnotes = ["a: assumed, not published"] if any(row.assumed for row in rows) else []
    for kind in dict.fromkeys(row.kind for row in rows):
        title = KIND_TITLES.get(kind, kind)
        table.add_row(Text(title, style="bold"))
        for row in rows:
            if row.kind == kind:
                line = parameter_line(row, identifiable_relative_std)
                table.add_row(*_cells(line, with_truth=with_truth), style=None if row.identifiable else "dim")
                footnotes += [f"{title}, {line.name}: {line.note}"] if line.note else []
    table.caption = Text("\n".join(footnotes)) if footnotes else None
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
