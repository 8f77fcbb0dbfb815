"""What the page of a fleet is made from, and how much of it is shown; failures by cause, and grades."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from robid.fleet.comparison import Collected, Comparison, Key
from robid.fleet.folders import PAGE
from robid.fleet.ledger import Ledger
from robid.fleet.summary import causes
from robid.report.section import Cell, ColumnStyle, Folded, Part, Section, Table
from robid.results.grade import WORDS

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


_MANY_CAUSES = 100


def failure_sections(found: Found) -> tuple[Section, ...]:
    """Says which rows have failed and why, the most frequent cause first."""
    groups = causes(found.ledgers)
    if not groups:
        return ()
    rows = tuple((kind, str(len(ids)), message, remedy, listed(ids)) for kind, message, remedy, ids in groups)
    more = f"The first {_MANY_CAUSES} of {len(rows)} causes; all are in fleet.json." if len(rows) > _MANY_CAUSES else ""
    columns = ("Kind", "Rows", "What is wrong", "What to do", "Which")
    styles: tuple[ColumnStyle, ...] = ("name", "number", "prose", "prose", "prose")
    parts: tuple[Part, ...] = (Table(columns, rows[:_MANY_CAUSES], styles=styles, caption=more),)
    each = _pages(found)
    if each.rows:
        parts = (*parts, Folded("Row by row", (each,)))
    return (Section("Failures by cause", "Where each is wrong stands in its row.json and in the table.", parts),)


def _pages(found: Found) -> Table:
    """The failed rows that have pages, with links."""
    numbers = {ledger.id: row for row, ledger in enumerate(found.ledgers)}
    shown = [numbers[name] for *_, ids in causes(found.ledgers)[:_MANY_CAUSES] for name in ids[:MOST_SHOWN]]
    cells = [(found.cell(row), str(found.ledgers[row].error)) for row in shown[: 2 * MOST_SHOWN]]
    rows = tuple((cell, error) for cell, error in cells if cell.link)
    return Table(("Row", "What is wrong"), rows, styles=("name", "prose"))


def grade_sections(found: Found) -> tuple[Section, ...]:
    """Says how many rows have which grade, and why not a better one."""
    graded: dict[tuple[int, str], list[str]] = {}
    for ledger in found.ledgers:
        for value, sentence in ledger.grades.values():
            graded.setdefault((value, sentence), []).append(ledger.id)
    if not graded:
        return ()
    ordered = sorted(graded.items(), key=lambda item: (item[0][0], -len(item[1])))
    rows = [(WORDS[value], str(len(ids)), sentence, listed(ids)) for (value, sentence), ids in ordered[:MOST_SHOWN]]
    more = f"The first {MOST_SHOWN} of {len(ordered)}; all are in the table." if len(ordered) > MOST_SHOWN else ""
    styles: tuple[ColumnStyle, ...] = ("name", "number", "prose", "prose")
    table = Table(("Grade", "Rows", "Why", "Which"), tuple(rows), styles=styles, caption=more)
    return (Section("Grades", "The worst first.", (table,)),)
