"""A batch: the rows that are not fresh run, the others stay as they are, and the table is written."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Protocol

from robid.errors import RobidError
from robid.fleet.folders import recover, writing
from robid.fleet.ledger import LEDGER, Ledger, read_ledger, why_stale
from robid.fleet.report import check_report, write_report
from robid.fleet.row import RowTask, fail_row, run_row
from robid.fleet.rows import Fleet, PlannedRow
from robid.fleet.table import check_table, write_table
from robid.stages.stage import check_room

if TYPE_CHECKING:
    from robid.backends.map import Map
    from robid.backends.progress import Progress

ROWS, TABLE, REPORT = "rows", "results.parquet", "report.html"
_SMALL_BYTES = 1e6
Outcome = Literal["made", "fresh"]


class OpenMap(Protocol):
    """Opens a map; of a worker that dies, the map raises a plain `RobidError`."""

    def __call__(self, *, one: bool) -> AbstractContextManager[Map]:
        """Opens it with a single worker, or with as many as were asked for."""


@dataclass(frozen=True)
class Options:
    """How a batch runs.

    Attributes:
        keep: Whether records and responses stay.
        force: Whether rows that have failed are tried again.
    """

    keep: bool = False
    force: bool = False


@dataclass(frozen=True)
class Batch:
    """What became of a batch.

    Attributes:
        ledgers: Of all rows, in the order of the manifest.
        made: How many of them ran.
        removed: Rows that have a folder, but are not in the manifest any more.
        table: The table.
        report: The page.
        outcome: Whether table or page was written.
    """

    ledgers: tuple[Ledger, ...]
    made: int
    removed: tuple[str, ...]
    table: Path
    report: Path
    outcome: Outcome

    @property
    def failed(self) -> tuple[Ledger, ...]:
        """The rows that have failed, now or before."""
        return tuple(ledger for ledger in self.ledgers if ledger.status == "failed")

    @property
    def not_to_be_used(self) -> tuple[Ledger, ...]:
        """The rows with a fit that is graded *do not use*."""
        return tuple(ledger for ledger in self.ledgers if any(value == 0 for value, _ in ledger.grades.values()))


def run_fleet(
    fleet: Fleet,
    folder: Path,
    options: Options,
    open_map: OpenMap,
    progress: Progress,
    tell: Callable[[Ledger, Outcome], None],
) -> Batch:
    """Runs what is not fresh, in any order, and writes the table.

    Args:
        fleet: The rows.
        folder: The run folder, which nobody else works in.
        options: How.
        open_map: Opens what runs the rows, each whole, on one worker or on as many as were asked for.
        progress: Is told how far it is.
        tell: Is told what became of each row, those that are fresh first.

    Raises:
        RobidError: If the batch cannot go on; finished rows stay and are in the table, the others as `pending`.
    """
    rows = folder / ROWS
    check_table(folder / TABLE)
    check_report(folder / REPORT)
    check_room(rows / "row", _SMALL_BYTES)
    with writing(rows):
        recover(rows)
    found = {planned.row.id: read_ledger(rows / planned.row.id) for planned in fleet.rows}
    todo = [planned for planned in fleet.rows if _is_due(planned, found[planned.row.id], rows, options)]
    due = {planned.row.id for planned in todo}
    ledgers = {name: ledger for name, ledger in found.items() if ledger is not None and name not in due}
    for planned in fleet.rows:
        if planned.row.id not in due:
            tell(ledgers[planned.row.id], "fresh")
    progress.expect(len(fleet.rows), "rows", len(fleet.rows) - len(todo))

    def note(ledger: Ledger) -> None:
        ledgers[ledger.id] = ledger
        progress.advance()
        tell(ledger, "made")

    tasks = [RowTask(planned.row, fleet.template.path, fleet.text, rows, options.keep) for planned in todo]
    try:
        _run(tasks, open_map, note)
    except BaseException:
        with suppress(Exception):
            write_table(folder / TABLE, fleet, ledgers)
        raise
    in_order = tuple(ledgers[planned.row.id] for planned in fleet.rows)
    written = (
        write_table(folder / TABLE, fleet, ledgers),
        write_report(folder / REPORT, fleet.experiment.name, in_order),
    )
    outcome: Outcome = "made" if "made" in written else "fresh"
    return Batch(in_order, len(todo), _removed(rows, fleet), folder / TABLE, folder / REPORT, outcome)


def _run(tasks: Sequence[RowTask], open_map: OpenMap, note: Callable[[Ledger], None]) -> None:
    """Runs rows; those at work when a worker died run alone, and one that kills its worker again has failed."""
    done: set[str] = set()

    def finished(_: int, ledger: Ledger) -> None:
        done.add(ledger.id)
        note(ledger)

    try:
        with open_map(one=False) as parallel_map:
            parallel_map(run_row, tasks, finished)
    except RobidError as error:
        if type(error) is not RobidError:
            raise
        left = [task for task in tasks if task.row.id not in done]
        suspects = [task for task in left if task.work.exists()]
        if not suspects:
            raise
        for task in suspects:
            _run_alone(task, open_map, lambda ledger: finished(0, ledger))
        _run([task for task in left if task not in suspects], open_map, note)


def _run_alone(task: RowTask, open_map: OpenMap, note: Callable[[Ledger], None]) -> None:
    with open_map(one=True) as single_map:
        try:
            [ledger] = single_map(run_row, [task])
        except RobidError as error:
            if type(error) is not RobidError:
                raise
            ledger = fail_row(task)
    note(ledger)


def _is_due(planned: PlannedRow, ledger: Ledger | None, rows: Path, options: Options) -> bool:
    folder = rows / planned.row.id
    keep, force = options.keep, options.force
    return bool(why_stale(ledger, planned.settings_hash, planned.logs, folder, keep=keep, force=force))


def _removed(rows: Path, fleet: Fleet) -> tuple[str, ...]:
    """Names of rows on the disk that the manifest does not have."""
    there = {path.parent.name for path in rows.glob(f"*/{LEDGER}")}
    return tuple(sorted(there.difference(planned.row.id for planned in fleet.rows)))
