"""Which rows are to be made, and why; which stay as they are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from robid.fleet.ledger import Ledger, logs_away, read_ledger, why_stale
from robid.fleet.rows import Fleet, PlannedRow


@dataclass(frozen=True)
class Look:
    """What a batch has to do."""

    due: tuple[tuple[PlannedRow, str], ...]  # the rows to be made, in the order of the manifest, each with the reason
    fresh: Mapping[str, Ledger]  # the others' ledgers in outline, by id
    away: Mapping[str, tuple[str, ...]]  # which logs are away of those that therefore stay as they are, by id

    @property
    def reasons(self) -> dict[str, list[str]]:
        """Ids of the rows to be made by reason, the most frequent first."""
        found: dict[str, list[str]] = {}
        for planned, why in self.due:
            found.setdefault(why, []).append(planned.row.id)
        return dict(sorted(found.items(), key=lambda item: -len(item[1])))


def look(fleet: Fleet, rows: Path, *, keep: bool, force: bool) -> Look:
    """Tells the rows that are to be made from those that are fresh; writes nothing.

    Args:
        fleet: The rows.
        rows: Folder of their folders.
        keep: Whether records and responses are to stay.
        force: Whether rows that have failed are tried again.

    Raises:
        ArtifactError: If a folder in the place of a row's is none.
    """
    due, fresh, away = [], {}, {}
    for planned in fleet.rows:
        folder = rows / planned.row.id
        ledger = read_ledger(folder)
        why = why_stale(ledger, planned.settings_hash, planned.logs, folder, keep=keep, force=force)
        if ledger is None or why:
            due.append((planned, why))
            continue
        fresh[planned.row.id] = ledger.outline
        gone = logs_away(ledger, planned.logs)
        if gone:
            away[planned.row.id] = gone
    return Look(tuple(due), fresh, away)
