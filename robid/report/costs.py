"""Sections on the costs of a fit: of each configuration, and of each start of the optimizer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import fmean, median

from robid.report.numbers import MISSING, number_of, percent, significant
from robid.report.page import KeyNumber
from robid.report.section import Bars, Beside, ColumnStyle, Curve, Figure, Section, Table

_MINIMA = 3
_LOGARITHMIC = 10


@dataclass(frozen=True)
class CostRow:
    """The cost in one configuration."""

    campaign: str  # name of the campaign
    configuration: int  # index of the configuration in it
    cost: float  # weighted cost
    expected_cost: float | None = None  # its expectation when the model is exact, or None when no covariance is known
    excess: float | None = None  # cost above the expectation, or None


@dataclass(frozen=True)
class StartRow:
    """One start of the optimizer."""

    index: int  # index of the start; 0 are the robot file's values
    cost: float  # cost where it ended
    iterations: int  # iterations it took
    status: str  # how it ended
    minimum_index: int  # index of the minimum that it ended in; 0 is the best
    evaluations: int | None = None  # points at which the cost was computed; None where they were not counted


@dataclass(frozen=True)
class Effort:
    """What the starts of a fit cost."""

    median: float  # median of the points at which a start computed the cost
    most: int  # largest number of them
    cap_share: float  # share of the starts that the iteration limit ended


def effort(rows: tuple[StartRow, ...]) -> Effort | None:
    """Returns what the starts cost, nothing where it was not counted."""
    counted = [row.evaluations for row in rows if row.evaluations is not None]
    if not counted:
        return None
    capped = sum(row.status == "iteration_limit" for row in rows)
    return Effort(median(counted), max(counted), capped / len(rows))


def effort_text(rows: tuple[StartRow, ...]) -> str:
    """Says how often the starts computed the cost and how many the iteration limit ended; nothing if not counted."""
    found = effort(rows)
    if found is None:
        return ""
    return (
        f"They computed the cost {found.median:.0f} times (median), at most {found.most} times;"
        f" {percent(found.cap_share)} ended at the iteration limit."
    )


def average_and_worst(rows: tuple[CostRow, ...]) -> tuple[float, CostRow] | None:
    """Mean cost over the configurations and the row of the largest, or None without rows."""
    if not rows:
        return None
    return fmean(row.cost for row in rows), max(rows, key=lambda row: row.cost)


def campaign_title(role: str, campaign: str) -> str:
    """Names a campaign by its role, and by its name where that says more."""
    return role if campaign.lower() in {"", role.lower()} else f"{role}: {campaign}"


def cost_section(
    estimation: tuple[CostRow, ...], validation: tuple[CostRow, ...], more: str = ""
) -> tuple[Section, ...]:
    """Lays out the cost of each configuration against its expectation; nothing without any."""
    named = [(role, rows) for role, rows in (("Estimation", estimation), ("Validation", validation)) if rows]
    if not named:
        return ()
    every = [row for _, rows in named for row in rows]
    bars = Bars(
        title="",
        value_title="Cost (mark: expected)",
        labels=tuple(number_of(row.configuration) for row in every),
        parts=(("cost", tuple(row.cost for row in every)),),
        label_title="Configuration",
        groups=tuple((role, len(rows)) for role, rows in named),
        marks=tuple(row.expected_cost for row in every),
        mark_title="expected",
    )
    lead = "A bar at its mark is explained up to the noise; what stands above the mark is model error."
    tables = tuple(_cost_table(role, rows) for role, rows in named)
    return (Section("Cost per configuration", f"{lead} {more}".strip(), (bars, Beside(tables)), "costs"),)


def _cost_table(role: str, rows: tuple[CostRow, ...]) -> Table:
    average, worst = fmean(row.cost for row in rows), max(rows, key=lambda row: row.cost)
    lines = []
    for row in rows:
        expected, excess = significant(row.expected_cost, 4), significant(row.excess, 3)
        lines.append((number_of(row.configuration), significant(row.cost, 4), expected, excess))
    highest = f"{significant(worst.cost, 4)} (configuration {number_of(worst.configuration)})"
    return Table(
        ("Configuration", "Cost", "Expected", "Excess"),
        tuple(lines),
        title=campaign_title(role, rows[0].campaign),
        styles=("text", "strong", "number", "number"),
        footer=(("Average", significant(average, 4)), ("Worst", highest)),
    )


def cost_number(estimation: tuple[CostRow, ...], validation: tuple[CostRow, ...]) -> tuple[KeyNumber, ...]:
    """Picks the cost that says most: of the validation where there is one, over the noise where that is known."""
    label, rows = ("Validation cost", validation) if validation else ("Estimation cost", estimation)
    found = average_and_worst(rows)
    if found is None:
        return ()
    average, worst = found
    expected = [row.expected_cost for row in rows if row.expected_cost]
    if len(expected) == len(rows):
        ratio = significant(average / fmean(expected), 3)
        worst_ratio = max(row.cost / row.expected_cost for row in rows if row.expected_cost)
        return (KeyNumber(f"{label} / noise", ratio, f"average; worst {significant(worst_ratio, 3)}"),)
    return (KeyNumber(label, significant(average, 4), f"average; worst {significant(worst.cost, 4)}"),)


def start_number(rows: tuple[StartRow, ...]) -> tuple[KeyNumber, ...]:
    """Says how many starts ended at the best minimum, where there are several."""
    if len(rows) < 2:
        return ()
    best = sum(row.minimum_index == 0 for row in rows)
    count = len({row.minimum_index for row in rows})
    detail = "one minimum found" if count == 1 else f"{count} minima found"
    return (KeyNumber("Starts at the best", f"{best} of {len(rows)}", detail),)


def start_section(rows: tuple[StartRow, ...]) -> tuple[Section, ...]:
    """Lays out where each start ended; nothing without any."""
    if not rows:
        return ()
    lead = "Where each start of the optimizer ended, by cost. Start 1 is the robot file."
    table = _start_table(rows)
    parts = (Beside((_start_figure(rows), table)) if len(rows) > 1 else table,)
    return (Section("Starts and minima", f"{lead} {effort_text(rows)}".strip(), parts, "starts"),)


def _start_figure(rows: tuple[StartRow, ...]) -> Figure:
    """Points by rising cost, a colour for each of the best minima and one for all others."""
    ordered = sorted(rows, key=lambda row: row.cost if math.isfinite(row.cost) else math.inf)
    costs = [row.cost for row in ordered if math.isfinite(row.cost) and row.cost > 0]
    wide = bool(costs) and max(costs) / min(costs) > _LOGARITHMIC
    minima = sorted({min(row.minimum_index, _MINIMA) for row in rows})
    curves = []
    for minimum in minima:
        chosen = [(at, row) for at, row in enumerate(ordered) if min(row.minimum_index, _MINIMA) == minimum]
        name = "further minima" if minimum == _MINIMA else f"minimum {number_of(minimum)}"
        texts = tuple(
            f"start {number_of(row.index)}: {significant(row.cost, 6)}, minimum {number_of(row.minimum_index)},"
            f" {row.status}"
            for _, row in chosen
        )
        x, y = tuple(float(at) for at, _ in chosen), tuple(row.cost for _, row in chosen)
        curves.append(Curve(name, x, y, texts, points=True))
    return Figure(
        title="",
        x_title="Start, by cost",
        y_title="Cost",
        curves=tuple(curves),
        log_x=False,
        log_y=wide,
        y_range=(0.0, 1.08 * max(costs)) if costs and not wide else None,
        height=270,
        legend=len(curves) > 1,
        x_labels=tuple(number_of(row.index) for row in ordered),
    )


def _start_table(rows: tuple[StartRow, ...]) -> Table:
    lines = []
    for row in sorted(rows, key=lambda row: (row.minimum_index, row.cost)):
        counts = str(row.iterations), MISSING if row.evaluations is None else str(row.evaluations)
        found = number_of(row.index), significant(row.cost, 7), number_of(row.minimum_index)
        lines.append((*found, *counts, row.status))
    heads = ("Start", "Cost", "Minimum", "Iterations", "Evaluations", "Ended")
    styles: tuple[ColumnStyle, ...] = ("text", "strong", "number", "number", "number", "text")
    return Table(heads, tuple(lines), styles=styles, fit="tall")
