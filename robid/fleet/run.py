"""A batch: the rows that are not fresh run, the others stay as they are, and the table is written."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Protocol

from robid.errors import WorkerError
from robid.fleet.collected import collect
from robid.fleet.comparison import Comparison, compare
from robid.fleet.folders import recover, writing
from robid.fleet.ledger import LEDGER, Ledger, read_ledger, why_stale
from robid.fleet.page.found import Found, Pages, flagged
from robid.fleet.page.report import check_report, write_report
from robid.fleet.pages import make_pages
from robid.fleet.row import RowTask, fail_row, run_row
from robid.fleet.rows import Fleet, PlannedRow
from robid.fleet.summary import check_summary, write_summary
from robid.fleet.table import check_table, write_table
from robid.stages.stage import check_room

if TYPE_CHECKING:
    from robid.backends.map import Map
    from robid.backends.progress import Progress

ROWS, TABLE, SUMMARY, REPORT = "rows", "results.parquet", "fleet.json", "report.html"
_SMALL_BYTES = 1e6
Outcome = Literal["made", "fresh"]


class OpenMap(Protocol):
    """Opens a map; of a worker that dies, the map raises a `WorkerError`."""

    def __call__(self, *, one: bool) -> AbstractContextManager[Map]:
        """Opens it with a single worker, or with as many as were asked for."""


@dataclass(frozen=True)
class Options:
    """How a batch runs.

    Attributes:
        keep: Whether records and responses stay.
        force: Whether rows that have failed are tried again.
        pages: Which rows get a page of their own: `flagged` are outliers and failures.
    """

    keep: bool = False
    force: bool = False
    pages: Pages = "flagged"


@dataclass(frozen=True)
class Batch:
    """What became of a batch.

    Attributes:
        ledgers: Of all rows, in the order of the manifest, in outline.
        comparison: The rows against each other.
        made: How many of them ran.
        removed: Rows that have a folder, but are not in the manifest any more.
        table: The table.
        summary: The same for programs.
        report: The page.
        outcome: Whether any of these was written.
    """

    ledgers: tuple[Ledger, ...]
    comparison: Comparison
    made: int
    removed: tuple[str, ...]
    table: Path
    summary: Path
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
    check_summary(folder / SUMMARY)
    check_report(folder / REPORT)
    check_room(rows / "row", _SMALL_BYTES)
    with writing(rows):
        recover(rows)
    todo, ledgers = _look(fleet, rows, options)
    for ledger in ledgers.values():
        tell(ledger, "fresh")
    progress.expect(len(fleet.rows), "rows", len(fleet.rows) - len(todo))

    def note(ledger: Ledger) -> None:
        ledgers[ledger.id] = ledger.outline
        progress.advance()
        tell(ledger, "made")

    def whole() -> Iterator[Ledger | None]:
        for planned in fleet.rows:
            yield read_ledger(rows / planned.row.id) if planned.row.id in ledgers else None

    try:
        _run([_task(fleet, planned, rows, options) for planned in todo], open_map, note)
    except BaseException:
        with suppress(Exception):
            write_table(folder / TABLE, fleet, whole)
        raise
    in_order = tuple(ledgers[planned.row.id] for planned in fleet.rows)
    collected = collect(whole())
    comparison = compare(collected, fleet.robots)
    found = Found(fleet.experiment.name, in_order, comparison, collected, rows)
    written = [
        write_table(folder / TABLE, fleet, whole, comparison),
        write_summary(folder / SUMMARY, fleet.experiment.name, in_order, comparison),
    ]
    paged = flagged(found) if options.pages == "flagged" else range(len(in_order)) if options.pages == "all" else ()
    make_pages([_task(fleet, fleet.rows[row], rows, options) for row in paged], open_map, progress)
    written.append(write_report(folder / REPORT, found))
    outcome: Outcome = "made" if "made" in written else "fresh"
    removed = _removed(rows, fleet)
    paths = folder / TABLE, folder / SUMMARY, folder / REPORT
    return Batch(in_order, comparison, len(todo), removed, *paths, outcome)


def _look(fleet: Fleet, rows: Path, options: Options) -> tuple[list[PlannedRow], dict[str, Ledger]]:
    """Tells the rows that are to be made from those that are fresh, with the outlines of the latter's ledgers."""
    todo, fresh = [], {}
    for planned in fleet.rows:
        ledger = read_ledger(rows / planned.row.id)
        if ledger is None or _is_due(planned, ledger, rows, options):
            todo.append(planned)
        else:
            fresh[planned.row.id] = ledger.outline
    return todo, fresh


def _task(fleet: Fleet, planned: PlannedRow, rows: Path, options: Options) -> RowTask:
    return RowTask(planned.row, fleet.template.path, fleet.text, rows, options.keep)


def _run(tasks: Sequence[RowTask], open_map: OpenMap, note: Callable[[Ledger], None]) -> None:
    """Runs rows; those at work when a worker died run alone, and one that kills its worker again has failed."""
    done: set[str] = set()

    def finished(_: int, ledger: Ledger) -> None:
        done.add(ledger.id)
        note(ledger)

    try:
        with open_map(one=False) as parallel_map:
            parallel_map(run_row, tasks, finished)
    except WorkerError:
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
        except WorkerError:
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
