"""What the page of a fleet is made from, and how much of it is shown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from robid.fleet.collected import Collected, Key
from robid.fleet.comparison import Comparison
from robid.fleet.folders import PAGE
from robid.fleet.ledger import Ledger
from robid.fleet.summary import causes
from robid.report.section import Cell

Pages = Literal["all", "none", "flagged"]
MOST_SHOWN = 200
"""Outliers, and failures of one cause, that the page names and that get pages of their own unless asked for."""
_SHOWN_ROWS = 12


@dataclass(frozen=True)
class Found:
    """What a fleet found."""

    name: str  # name of the experiment
    ledgers: Sequence[Ledger]  # what became of each row, in the order of the manifest, in outline
    comparison: Comparison  # the rows against each other
    collected: Mapping[Key, Collected]  # parameters and misfits over the rows
    rows: Path | None = None  # folder of the rows' folders; None where no page leads to them

    def cell(self, row: int) -> Cell:
        """Names a row, with a link to its page where it has one."""
        name = self.ledgers[row].id
        has_page = self.rows is not None and (self.rows / name / PAGE).exists()
        return Cell(name, link=f"{self.rows.name}/{name}/{PAGE}" if has_page and self.rows else "")


def flagged(found: Found) -> list[int]:
    """Returns the rows that get pages: outliers and failures, the first of very many."""
    numbers = {ledger.id: row for row, ledger in enumerate(found.ledgers)}
    failed = [numbers[name] for *_, ids in causes(found.ledgers) for name in ids[:MOST_SHOWN]]
    return [*list(found.comparison.off)[:MOST_SHOWN], *failed]


def listed(ids: Sequence[str], shown: int = _SHOWN_ROWS) -> str:
    """Names some rows, the first of many."""
    more = f" and {len(ids) - shown} more" if len(ids) > shown else ""
    return ", ".join(ids[:shown]) + more
