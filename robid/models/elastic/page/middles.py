"""Why the middle of a physical interval is not the estimate, in a sentence and on the page."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median

from robid.models.elastic.judge.middles import MiddleRow
from robid.report.numbers import percent
from robid.report.section import Section, Table

_NAMED = 3


def middle_sentence(rows: Sequence[MiddleRow]) -> str:
    """Says below the parameters why intervals of springs do not lie around their estimates; empty where they do."""
    springs = [row for row in rows if row.kind == "stiffness"]
    causes = dict.fromkeys(row.by[0][1] for row in springs)
    told = [_of_cause([row for row in springs if row.by[0][1] == cause]) for cause in causes]
    return f"Where physical value and estimate differ: {'; '.join(told)}." if told else ""


def _of_cause(rows: Sequence[MiddleRow]) -> str:
    """Parameters whose middles one kind of nuisance moves most, and by how much in the median."""
    first, more = rows[0], len(rows) - _NAMED
    names = ", ".join(row.name for row in rows[:_NAMED]) + (f" and {more} more" if more > 0 else "")
    settled = f"; {first.settled_by} would show it" if first.settled_by else ""
    moved = median(row.moved for row in rows)
    size = f"{percent(abs(moved))} {'above' if moved > 0 else 'below'} the estimate"
    outside = ", ".join(row.name for row in rows if row.outside)
    apart = f"; the estimate of {outside} lies outside its interval" if outside else ""
    return (
        f"{names}, {size}, because the robot file allows for {first.by[0][0]} and the like, which the data do not"
        f" show{settled}{apart}"
    )


def middle_section(rows: Sequence[MiddleRow]) -> tuple[Section, ...]:
    """Lays out what moves the middles of physical intervals; nothing where nothing does."""
    if not rows:
        return ()
    lead = (
        "The estimate is what the data say by themselves. The interval of the parameter itself also weighs what is"
        " known of the robot beforehand, one-sided for what gears do beside springs; so its middle may lie elsewhere."
    )
    table = Table(
        ("Parameter", "Middle less estimate", "Estimate", "Moved by", "What would tell"),
        tuple(
            (
                row.name,
                percent(row.moved, signed=True),
                "outside" if row.outside else "inside",
                row.reason.replace(" -", " \N{MINUS SIGN}"),
                row.settled_by,
            )
            for row in rows
        ),
        styles=("name", "number", "text", "text", "text"),
    )
    return (Section("Middles of intervals", lead, (table,), "middles"),)
