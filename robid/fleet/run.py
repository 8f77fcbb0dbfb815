"""A batch: the rows that are not fresh run, the others stay as they are, and the table is written."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Protocol

from robid.artifacts.atomic import check_folders
from robid.errors import WorkerError
from robid.fleet.comparison import Comparison, Found, Pages, collect, compare, flagged
from robid.fleet.folders import at_work, recover, writing
from robid.fleet.ledger import LEDGER, Ledger, read_ledger
from robid.fleet.report import check_report, make_pages, write_report
from robid.fleet.row import RowTask, fail_row, run_row
from robid.fleet.rows import Fleet, Look, PlannedRow, look
from robid.fleet.summary import check_summary, write_summary
from robid.fleet.table import check_table, write_table
from robid.pipeline.stage import check_room

if TYPE_CHECKING:
    from robid.backends.map import Map, Progress

ROWS, TABLE, SUMMARY, REPORT = "rows", "results.parquet", "fleet.json", "report.html"
_SMALL_BYTES = 1e6
Outcome = Literal["made", "fresh"]


class OpenMap(Protocol):
    """Opens a map; of a worker that dies, the map raises a `WorkerError`."""

    def __call__(self, *, one: bool) -> AbstractContextManager[Map]:
        """Opens it with a single worker, or with as many as were asked for."""


@dataclass(frozen=True)
class Options:
    """How a batch runs."""

    keep: bool = False  # whether records and responses stay
    force: bool = False  # whether rows that have failed are tried again
    timeout_s: float | None = None  # time that a row may take [s]
    pages: Pages = "flagged"  # which rows get a page of their own: `flagged` are outliers and failures


@dataclass(frozen=True)
class Batch:
    """What became of a batch."""

    ledgers: tuple[Ledger, ...]  # of all rows, in the order of the manifest, in outline
    comparison: Comparison  # the rows against each other
    made: int  # how many of them ran
    away: Mapping[str, tuple[str, ...]]  # which logs are away of those that therefore stayed as they are, by id
    removed: tuple[str, ...]  # rows that have a folder, but are not in the manifest any more
    table: Path
    summary: Path  # the same for programs
    report: Path  # the page
    outcome: Outcome  # whether any of these was written

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
    announce: Callable[[Look], None] = lambda _: None,
) -> Batch:
    """Runs what is not fresh, in any order, each row whole on one worker, and writes the table.

    Raises:
        RobidError: If the batch cannot go on; finished rows stay and are in the table, the others as `pending`. Where
            none was finished, a table that is there stays as it was.
    """
    rows = folder / ROWS
    check_table(folder / TABLE)
    check_summary(folder / SUMMARY)
    check_report(folder / REPORT)
    check_folders(folder, (rows / planned.row.id / LEDGER for planned in fleet.rows))
    check_room(rows / "row", _SMALL_BYTES)
    with writing(rows):
        recover(rows)
    found = look(fleet, rows, keep=options.keep, force=options.force)
    announce(found)
    ledgers = dict(found.fresh)
    for ledger in found.fresh.values():
        tell(ledger, "fresh")
    progress.expect(len(fleet.rows), "rows", len(found.fresh))

    def note(ledger: Ledger) -> None:
        ledgers[ledger.id] = ledger.outline
        progress.advance()
        tell(ledger, "made")

    def whole() -> Iterator[Ledger | None]:
        for planned in fleet.rows:
            yield read_ledger(rows / planned.row.id) if planned.row.id in ledgers else None

    try:
        _run([_task(fleet, planned, rows, options) for planned, _ in found.due], open_map, note)
        with writing(rows):
            recover(rows)
        collected = collect(whole())
        comparison = compare(collected, fleet.robots)
        written = [write_table(folder / TABLE, fleet, whole, comparison)]
    except BaseException:
        if len(ledgers) > len(found.fresh) or not (folder / TABLE).exists():
            with suppress(Exception):
                write_table(folder / TABLE, fleet, whole)
        raise
    in_order = tuple(ledgers[planned.row.id] for planned in fleet.rows)
    written.append(write_summary(folder / SUMMARY, fleet.experiment.name, in_order, comparison))
    on_page = Found(fleet.experiment.name, in_order, comparison, collected, rows)
    every = range(len(in_order)) if options.pages == "all" else ()
    paged = flagged(on_page) if options.pages == "flagged" else every
    make_pages([_task(fleet, fleet.rows[row], rows, options) for row in paged], open_map, progress)
    written.append(write_report(folder / REPORT, on_page))
    outcome: Outcome = "made" if "made" in written else "fresh"
    paths = folder / TABLE, folder / SUMMARY, folder / REPORT
    there = {path.parent.name for path in rows.glob(f"*/{LEDGER}")}
    removed = tuple(sorted(there.difference(planned.row.id for planned in fleet.rows)))
    return Batch(in_order, comparison, len(found.due), found.away, removed, *paths, outcome)


def _task(fleet: Fleet, planned: PlannedRow, rows: Path, options: Options) -> RowTask:
    return RowTask(planned.row, fleet.template.path, fleet.text, rows, options.keep, options.timeout_s)


def _run(tasks: Sequence[RowTask], open_map: OpenMap, note: Callable[[Ledger], None]) -> None:
    """Runs rows; those at work when a worker died run alone, and one that kills its worker again has failed."""
    if not tasks:
        return
    done: set[str] = set()

    def finished(_: int, ledger: Ledger) -> None:
        done.add(ledger.id)
        note(ledger)

    try:
        with open_map(one=False) as parallel_map:
            parallel_map(run_row, tasks, finished)
    except WorkerError:
        left = [task for task in tasks if task.row.id not in done]
        begun = at_work(tasks[0].rows)
        suspects = [task for task in left if task.row.id in begun]
        if not suspects:
            raise
        for task in suspects:
            _run_alone(task, open_map, lambda ledger: finished(0, ledger))
        _run([task for task in left if task not in suspects], open_map, note)


def _run_alone(task: RowTask, open_map: OpenMap, note: Callable[[Ledger], None]) -> None:
    with open_map(one=True) as single_map:
        begun = time.monotonic()
        try:
            [ledger] = single_map(run_row, [task])
        except WorkerError:
            late = task.timeout_s is not None and time.monotonic() - begun > task.timeout_s
            ledger = fail_row(task, late=late)
    note(ledger)
