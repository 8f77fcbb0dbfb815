"""How large a defect the data of a fit would have shown, on the page and in numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid.models.elastic.fit.solution import ElasticSolution
from robid.models.elastic.judge.power import POWER
from robid.report.numbers import percent
from robid.report.section import Folded, Section, Table
from robid.results.finding import CAUSES


@dataclass(frozen=True)
class PowerRow:
    """A listed defect, and how large it must be to be seen."""

    name: str  # What may be wrong
    cause: str  # Its likely cause
    unit: str  # Unit of its amounts
    shown: float  # Smallest amount that the residual would have shown; infinite where it shows none
    known: float  # How large it may be by what is known beforehand

    @property
    def over_known(self) -> float:
        """How many times as large it must be as what is known beforehand."""
        return self.shown / self.known


def power_rows(solution: ElasticSolution) -> tuple[PowerRow, ...]:
    """Lists the defects, those that data show least beside what is known beforehand first."""
    found = solution.detectable
    if found is None:
        return ()
    known = np.maximum(-found.lower, found.upper)
    columns = found.names, found.causes, found.units, found.amount.tolist(), known.tolist()
    rows = (PowerRow(*row) for row in zip(*columns, strict=True))
    return tuple(sorted(rows, key=lambda row: -row.over_known))


def power_section(rows: Sequence[PowerRow], level: float) -> tuple[Section, ...]:
    """Lays out how large a defect of each kind the data would have shown; nothing where that is unknown."""
    if not rows:
        return ()
    hidden = sum(row.over_known > 1 for row in rows)
    lead = (
        f"How large a defect must be for the fit's residual to show it with a probability of {percent(POWER)}, beyond"
        f" what the parameters follow. As large as it may be by what is known beforehand ({percent(level)}),"
        f" {hidden} of {len(rows)} would stay unseen. Louder noise hides larger ones."
    )
    worst = {row.cause: row for row in reversed(rows)}
    kinds = _table([worst[cause] for cause in CAUSES if cause in worst], "Of each kind the one that is seen least.")
    every = Folded(f"All defects, {len(rows)}", (_table(rows, "To first order about the estimates."),))
    return (Section("Defects that would have been seen", lead, (kinds, every), "power"),)


def _table(rows: Sequence[PowerRow], caption: str) -> Table:
    return Table(
        ("Defect", "Kind", "Seen from", "May be, beforehand", "Unit"),
        tuple((row.name, _kind(row.cause), _amount(row.shown), _amount(row.known), row.unit) for row in rows),
        caption=caption,
        styles=("name", "text", "strong", "number", "text"),
    )


def _kind(cause: str) -> str:
    return CAUSES[cause].partition(" (")[0]


def _amount(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "never"


def power_summary(rows: Sequence[PowerRow]) -> dict[str, float]:
    """The same in numbers: amounts of those that are seen at all, and how many stay unseen inside what is known."""
    found = {f"detectable.{row.name}": row.shown for row in rows if math.isfinite(row.shown)}
    return found | ({"detectable.hidden": float(sum(row.over_known > 1 for row in rows))} if rows else {})
