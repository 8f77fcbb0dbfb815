"""A fit's parameters on its page and in the terminal, and the numbers that say how well they are known."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from statistics import median
from typing import TypeAlias

from rich.console import Group
from rich.text import Text

from robid.report.charts import Ratio, RatioChart
from robid.report.numbers import MISSING, engineering, percent
from robid.report.page import KeyNumber
from robid.report.parameters import (
    Estimates,
    ParameterLine,
    ParameterRow,
    bootstrap_sentence,
    effective_sentence,
    kind_title,
    nuisance_lines,
    parameter_groups,
    parameter_line,
    ratio_sentence,
    rule_sentence,
)
from robid.report.section import Cell, ColumnStyle, Folded, Notes, Part, Row, Section, Table
from robid.report.terminal_table import Column, Footnotes, TerminalTable
from robid.robot.parameters import FRICTION_KIND, PARAMETER_KINDS

RATIO_PANELS = tuple(dict.fromkeys(kind.panel for kind in PARAMETER_KINDS.values() if kind.panel))
_LEAVES = (
    "Change",
    "In interval",
    "Bootstrap",
    "Off truth",
    "±",
    "Physical ±",
    "Nominal",
    "Physical",
    "Estimate ±",
    "Truth",
)
"""Columns that leave a narrow page, the first first."""
Groups: TypeAlias = Sequence[tuple[str, Sequence[ParameterLine]]]
_ASSUMED = partial(Cell, badge="a", hint="assumed: no published source")
_NUISANCE = (
    "Estimated with the springs so that their error does not end up there. Level and shape of the friction and the"
    " torque scale: deviation from the robot file in percentage points. Ripple: its sine and cosine part in per cent of"
    " the robot file's amplitude. Lag in samples."
)


def parameter_section(estimates: Estimates, conventions: str = "") -> tuple[Section, ...]:
    """Lays out a fit's parameters: ratios to nominal, table, what is not determined; nothing without any."""
    if not estimates.rows:
        return ()
    truth = " and the truth of the simulated robot" if _with_truth(estimates) else ""
    nominal = ", against the nominal values of the robot file" if estimates.with_nominal else ""
    lead = f"Estimates with {percent(estimates.level)} intervals{nominal}{truth}."
    sentences = (
        effective_sentence(estimates),
        conventions,
        estimates.about,
        ratio_sentence(estimates.torque_unit),
        f"{'Physical ±' if estimates.with_physical else '±'} is half the interval relative to the"
        f" {'physical value' if estimates.with_physical else 'estimate'}.",
        rule_sentence(estimates),
        "Grey rows are not determined by the data: use no more of them than was known beforehand.",
        bootstrap_sentence(estimates),
    )
    caption = " ".join(sentence for sentence in sentences if sentence)
    parts: list[Part] = [*_ratios(estimates), _table(estimates, parameter_groups(estimates), caption)]
    if estimates.undetermined:
        parts.append(Notes(tuple(f"{sentence}." for sentence in estimates.undetermined)))
    along = nuisance_lines(estimates)
    if along:
        table = _table(estimates, (("", along),), _NUISANCE, nuisances=True)
        parts.append(Folded(f"Torque nonlinearities (nuisance), {len(along)}", (table,)))
    return (Section("Parameters", lead, tuple(parts), "parameters"),)


def within(is_within: bool | None) -> str | Cell:
    """Says whether something lies in its interval, if that is known."""
    if is_within is None:
        return MISSING
    return Cell("✓ yes", "good") if is_within else Cell("✗ outside", "bad")


def _with_truth(estimates: Estimates) -> bool:
    return any(row.truth is not None for row in estimates.rows)


def _ratios(estimates: Estimates) -> tuple[RatioChart, ...]:
    shown = [row for row in estimates.rows if row.kind in PARAMETER_KINDS and row.nominal > 0 and row.estimate > 0]
    panels = [
        (title, tuple(_ratio(row) for row in rows))
        for title in RATIO_PANELS
        if (rows := [row for row in shown if PARAMETER_KINDS[row.kind].panel == title])
    ]
    return (RatioChart("", tuple(panels), f"{percent(estimates.level)} interval"),) if panels else ()


def _ratio(row: ParameterRow) -> Ratio:
    return Ratio(
        name=row.name,
        estimate=row.middle / row.nominal,
        lower=row.lower / row.nominal,
        upper=row.upper / row.nominal,
        truth=None if row.truth is None else row.truth / row.nominal,
        identifiable=row.identified,
        text=engineering(row.middle, row.unit, row.near),
    )


def _table(estimates: Estimates, groups: Groups, caption: str, *, nuisances: bool = False) -> Table:
    """Tabulates parameters, or what is estimated along, with those columns that any of them fills."""
    with_truth, own = _with_truth(estimates), not nuisances
    nominal, both = own and estimates.with_nominal, own and estimates.with_effective
    level, whose = percent(estimates.level), "physical " if both and estimates.with_physical else ""
    repeated = own and any(row.bootstrap is not None for row in estimates.rows)
    every: tuple[tuple[bool, str, ColumnStyle, Callable[[ParameterLine], str | Cell]], ...] = (
        (True, "Parameter", "name", lambda line: line.name),
        (True, "Estimate", "strong", lambda line: line.estimate),
        (both, "Estimate ±", "number", lambda line: line.predicts),
        (both and estimates.with_physical, "Physical", "number", lambda line: line.physical),
        (
            True,
            f"{whose}{level} interval".capitalize(),
            "number",
            lambda line: f"{line.lower} … {line.upper}",
        ),
        (repeated, "Bootstrap", "number", lambda line: line.bootstrap),
        (True, "Unit", "unit", lambda line: line.unit),
        (own, f"{whose}±".capitalize(), "number", lambda line: line.half_width),
        (nominal, "Nominal", "number", lambda line: _ASSUMED(line.nominal) if line.assumed else line.nominal),
        (nominal, "Change", "number", lambda line: line.change),
        (with_truth, "Truth", "number", lambda line: line.truth),
        (own and with_truth, "Off truth", "number", lambda line: line.off_truth),
        (with_truth, "In interval", "text", lambda line: within(line.covered)),
    )
    shown = [column for column in every if column[0]]
    rows = tuple(
        Row(tuple(cell(line) for *_, cell in shown), faint=not line.identified, group=title, note=line.note)
        for title, lines in groups
        for line in lines
    )
    heads = tuple(head for _, head, *_ in shown)
    return Table(heads, rows, caption=caption, styles=tuple(style for *_, style, _ in shown), leaves=_LEAVES)


def count_identified(rows: Sequence[ParameterRow]) -> int:
    """Counts the parameters of the model that are identified, as `Estimate.count` does: page, terminal and summary."""
    return sum(row.identified for row in rows if row.kind != FRICTION_KIND)


def parameter_numbers(estimates: Estimates, *, usable: bool = True) -> Iterator[KeyNumber]:
    """Yields what says how well the parameters are known; none of a fit that is of no use counts as identified."""
    rows, springs = estimates.shown, _springs(estimates.rows)
    chosen = springs or rows
    if usable and rows:
        found, every = count_identified(chosen), count_identified(rows)
        detail = "" if len(chosen) == len(rows) else f"{every} of {len(rows)} parameters"
        what = "Springs identified" if springs else "Parameters identified"
        yield KeyNumber(what, f"{found} of {len(chosen)}", detail)
    half_width = _median_half_width(springs)
    if half_width is not None:
        yield KeyNumber("Spring interval", f"± {percent(half_width)}", f"median, {percent(estimates.level)} level")
    errors = [abs(row.estimate / row.truth - 1) for row in springs if row.identifiable and row.truth]
    if errors:
        yield KeyNumber("Springs off truth", percent(median(errors)), f"median; worst {percent(max(errors))}")
    known = [row.covered for row in rows if row.identifiable and row.covered is not None]
    if known:
        yield KeyNumber("Truth in interval", f"{sum(known)} of {len(known)}", "identifiable parameters")


def identified_phrase(estimates: Estimates, *, usable: bool = True) -> str:
    """Says how many springs, or parameters without any, are identified, and how closely."""
    springs = _springs(estimates.rows)
    chosen = springs or estimates.shown
    noun = ("spring" if springs else "parameter") + ("" if len(chosen) == 1 else "s")
    if not usable:
        return f"{len(chosen)} {noun} {'was' if len(chosen) == 1 else 'were'} fitted"
    found = count_identified(chosen)
    text = f"{found} of {len(chosen)} {noun} identified"
    half_width = _median_half_width(springs)
    if half_width is None:
        return text
    level = f"{'median, ' if found > 1 else ''}{percent(estimates.level)}"
    return f"{text} within ±{percent(half_width)} ({level})"


def _springs(rows: tuple[ParameterRow, ...]) -> list[ParameterRow]:
    return [row for row in rows if row.kind == "stiffness"]


def _median_half_width(springs: list[ParameterRow]) -> float | None:
    widths = [(row.upper - row.lower) / 2 / abs(row.middle) for row in springs if row.identifiable and row.middle]
    return median(widths) if widths else None


def parameter_table(estimates: Estimates) -> Group:
    """Lays out parameters, those not identified dim, with intervals, nominal values and the truth where known."""
    rows, columns = estimates.shown, _terminal_columns(estimates)
    table = TerminalTable([column for column, _ in columns], elsewhere="on the page, in `--json`")
    footnotes = [effective_sentence(estimates), estimates.about, ratio_sentence(estimates.torque_unit)]
    for kind in dict.fromkeys(row.kind for row in rows):
        title = kind_title(kind, estimates.torque_unit)
        table.add(Text(title, style="bold"))
        for row in rows:
            if row.kind == kind:
                line = parameter_line(row, estimates.identifiable_relative_std)
                cells = (cell(line) for _, cell in columns)
                table.add(
                    *(Text(cell, "" if row.identified else "dim") if isinstance(cell, str) else cell for cell in cells)
                )
                footnotes += [f"{title}, {line.name}: {line.note}"] if line.note else []
    footnotes += [bootstrap_sentence(estimates), *(f"{sentence}." for sentence in estimates.undetermined)]
    nuisances = len(estimates.rows) - len(rows)
    footnotes += [f"{nuisances} more, of friction and ripple, are in the report"] if nuisances else []
    return with_notes(table, footnotes)


def with_notes(table: TerminalTable, notes: list[str]) -> Group:
    """Puts what there is to say below a table."""
    said = [note for note in notes if note]
    return Group(table, Footnotes(said)) if said else Group(table)


def _terminal_columns(estimates: Estimates) -> list[tuple[Column, Callable[[ParameterLine], str | Text]]]:
    """The columns that any parameter fills, each with how it writes one."""
    both, with_truth = estimates.with_effective, any(row.truth is not None for row in estimates.shown)
    whose = "physical " if both and estimates.with_physical else ""
    assumed = "a: assumed, not published" if any(row.assumed for row in estimates.shown) else ""
    nominal = Column("nominal", leaves=3, note=assumed)
    every: tuple[tuple[bool, Column, Callable[[ParameterLine], str | Text]], ...] = (
        (True, Column("parameter", numbers=False), lambda line: f"  {line.name}"),
        (True, Column("estimate"), lambda line: Text(line.estimate, "bold") if line.identified else line.estimate),
        (both, Column("estimate ±", leaves=5), lambda line: line.predicts),
        # The interval is that of the physical value where there is one.
        (both and estimates.with_physical, Column("physical"), lambda line: line.physical),
        (True, Column(f"{whose}{100 * estimates.level:g} % interval"), lambda line: f"{line.lower} … {line.upper}"),
        (True, Column("unit", numbers=False), lambda line: line.unit),
        (True, Column(f"{whose}±", leaves=2), lambda line: line.half_width),
        (
            estimates.with_nominal,
            nominal,
            lambda line: "a " * line.assumed + line.nominal,
        ),
        (with_truth, Column("truth", leaves=1), lambda line: line.truth),
        (with_truth, Column("off truth", leaves=4), _off_truth),
    )
    return [(column, cell) for is_shown, column, cell in every if is_shown]


def _off_truth(line: ParameterLine) -> str | Text:
    outside = line.covered is False and line.identified
    return Text(f"{line.off_truth} outside", "yellow") if outside else line.off_truth
