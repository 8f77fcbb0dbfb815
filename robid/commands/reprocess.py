"""Running an experiment file over the rows of a manifest."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

from robid.arrays import Meaning
from robid.artifacts.atomic import FOLDER_LOCK, locked
from robid.backends.map import make_map
from robid.commands.output import Answer, print_json
from robid.commands.shared import PROBLEM, choose_backend, warn_of_scheduler
from robid.errors import SettingsError
from robid.fleet.comparison import listed
from robid.fleet.ledger import Ledger, RowError, causes
from robid.fleet.population import FEWEST_ROBOTS
from robid.fleet.rows import Fleet, Look, load_fleet, look
from robid.fleet.run import ROWS, Batch, Options, run_fleet
from robid.fleet.table import require_table
from robid.pipeline.stage import counted
from robid.pipeline.terminal import Shell, make_console
from robid.settings.base import DATA_VARIABLE, data_path

_SHOWN_CAUSES = 10
_SHOWN_NAMES = 5
_SHOWN_IDS = 3


@dataclass(frozen=True)
class FitGrade:
    """How far to trust the fit of a row."""

    grade: Annotated[int, Meaning("2 *trust*, 1 *predicts, but single parameters may be off*, 0 *do not use*.")]
    grade_sentence: Annotated[str, Meaning("The grade, why it is no better, and the likeliest cause.")]


@dataclass(frozen=True)
class RowAnswer(Answer, type="reprocess-row"):
    """What became of a row; with `--stream`, on a line as it finishes."""

    id: Annotated[str, Meaning("The row.")]
    status: Annotated[Literal["done", "failed"], Meaning("Whether it was done.")]
    error: Annotated[RowError | None, Meaning("Why it has failed.")]
    grades: Annotated[dict[str, FitGrade], Meaning("Grade of each fit, by its name.")]
    seconds: Annotated[float, Meaning("Time that it took [s].")]
    outcome: Annotated[str, Meaning("`made`, or `fresh` when there was nothing to do.")]


@dataclass(frozen=True, kw_only=True)
class FailedRow(RowError):  # noqa: N818  no exception
    """A row that has failed, now or before."""

    id: Annotated[str, Meaning("The row.")]


@dataclass(frozen=True)
class OffRow:
    """A row that is off the fleet."""

    id: Annotated[str, Meaning("The row.")]
    fit: Annotated[str, Meaning("The fit.")]
    name: Annotated[str, Meaning("The parameter or misfit in which it is farthest off.")]
    away: Annotated[float, Meaning("By how many standard deviations.")]


@dataclass(frozen=True)
class DriftingRobot:
    """A robot that changes over its rows."""

    robot: Annotated[str, Meaning("The robot.")]
    fit: Annotated[str, Meaning("The fit.")]
    name: Annotated[str, Meaning("The parameter or misfit that changes the most clearly.")]
    change: Annotated[
        float, Meaning("Change over all of its measurements: of the logarithm, as +0.1 for +10 %, where it has one.")
    ]


@dataclass(frozen=True)
class BatchAnswer(Answer, type="reprocess"):
    """What became of all rows; with `--stream` the last line."""

    rows: Annotated[int, Meaning("Rows of the manifest.")]
    made: Annotated[int, Meaning("How many of them ran.")]
    fresh: Annotated[int, Meaning("How many had nothing to do.")]
    logs_away: Annotated[
        dict[str, tuple[str, ...]], Meaning("Logs that are not there, of the rows that therefore stay as they are.")
    ]
    failed: Annotated[tuple[FailedRow, ...], Meaning("Rows that have failed.")]
    do_not_use: Annotated[tuple[str, ...], Meaning("Rows with a fit that is graded *do not use*.")]
    outliers: Annotated[tuple[OffRow, ...], Meaning("Rows that are off the fleet.")]
    drifts: Annotated[tuple[DriftingRobot, ...], Meaning("Robots that change.")]
    untold: Annotated[tuple[str, ...], Meaning("Groups with too few robots to tell outliers.")]
    removed: Annotated[tuple[str, ...], Meaning("Rows that are no longer in the manifest, left on the disk.")]
    table: Annotated[str, Meaning("The table of results.")]
    summary: Annotated[str, Meaning("The comparison of the rows, for programs.")]
    report: Annotated[str, Meaning("The page.")]
    outcome: Annotated[Literal["made", "fresh"], Meaning("Whether any of these was written.")]


@dataclass(frozen=True)
class DryRunAnswer(Answer, type="reprocess-dry-run"):
    """What there is to do."""

    fresh: Annotated[int, Meaning("Rows with nothing to do.")]
    logs_away: Annotated[
        dict[str, tuple[str, ...]], Meaning("Logs that are not there, of the rows that therefore stay as they are.")
    ]
    due: Annotated[dict[str, list[str]], Meaning("Rows to be made, by the reason.")]


def reprocess(
    manifest: Path,
    experiment: Path,
    folder: Path | None,
    options: Options,
    backend: Literal["serial", "processes", "dask"] | None,
    workers: int | None,
    scheduler: str | None,
    *,
    strict: bool,
    as_json: bool,
    stream: bool,
    dry_run: bool = False,
) -> int:
    """Runs the rows of a manifest and prints what became of them; returns the exit code.

    A dry run prints what there is to do and writes nothing.
    """
    if stream and not as_json:
        raise SettingsError("S014 `--stream` says how `--json` is printed", where="--stream", remedy="add --json")
    require_table()
    fleet = load_fleet(manifest, experiment)
    execution = fleet.experiment.execution
    chosen = choose_backend(execution, backend, scheduler)
    shell = Shell(make_console(stderr=False), make_console(stderr=True), as_json or execution.log_level == "warning")
    for warning in fleet.warnings:
        shell.warn(warning)

    run_dir = folder or Path("runs") / fleet.experiment.name
    if dry_run:
        found = look(fleet, run_dir / ROWS, keep=options.keep, force=options.force)
        _show_look(shell, found, as_json=as_json, one_line=stream)
        return 0
    address = scheduler or execution.scheduler
    warn_of_scheduler(shell, chosen, address)
    count, inputs = workers or execution.workers or os.cpu_count() or 1, tuple(_folders(fleet))
    mapped = partial(make_map, chosen, scheduler=address, folder=run_dir, inputs=inputs)
    name, does = fleet.experiment.name, f"robid reprocess {manifest} {experiment}"
    with (
        locked(run_dir / FOLDER_LOCK, does),
        shell.progress(name, workers=1 if chosen == "serial" else count) as progress,
    ):
        announce = partial(_announce, shell, name)
        tell = partial(_tell_row, shell, {planned.row.id: planned.row.place for planned in fleet.rows}, stream)
        batch = run_fleet(fleet, run_dir, options, lambda *, one: mapped(1 if one else count), progress, tell, announce)
    if as_json:
        print_json(batch_answer(batch), one_line=stream)
    else:
        _show(shell, batch)
    strictly = batch.not_to_be_used or batch.comparison.off or batch.comparison.changing
    return PROBLEM if batch.failed or (strict and strictly) else 0


def _tell_row(shell: Shell, places: Mapping[str, str], stream: bool, ledger: Ledger, outcome: str) -> None:
    if stream:
        grades = {fit: FitGrade(*graded) for fit, graded in ledger.grades.items()}
        row = RowAnswer(ledger.id, ledger.status, ledger.error, grades, ledger.seconds, outcome)
        print_json(row, one_line=True)
    if ledger.error is not None and outcome == "made":
        shell.warn(f"{places[ledger.id]}: row {ledger.id} failed: {ledger.error}")


def batch_answer(batch: Batch) -> BatchAnswer:
    """Returns what `--json` says of a batch."""
    comparison = batch.comparison
    return BatchAnswer(
        rows=len(batch.ledgers),
        made=batch.made,
        fresh=len(batch.ledgers) - batch.made,
        logs_away=dict(batch.away),
        failed=tuple(FailedRow(**vars(one.error), id=one.id) for one in batch.failed if one.error),
        do_not_use=tuple(ledger.id for ledger in batch.not_to_be_used),
        outliers=tuple(_off(batch, row) for row in comparison.off),
        drifts=tuple(_drift(batch, robot) for robot in comparison.changing),
        untold=tuple(comparison.robots.groups[group] for group in comparison.untold),
        removed=tuple(batch.removed),
        table=str(batch.table),
        summary=str(batch.summary),
        report=str(batch.report),
        outcome=batch.outcome,
    )


def _folders(fleet: Fleet) -> Iterator[Path]:
    """The folders that rows read from: the manifest's, the experiment file's, and the data folder where it is used."""
    yield from dict.fromkeys(planned.row.folder for planned in fleet.rows)
    yield fleet.template.path.parent
    data = data_path(DATA_VARIABLE, Path())
    logs = (log for planned in fleet.rows for log in planned.logs.values())
    if data.is_dir() and (DATA_VARIABLE in fleet.text or any(log.is_relative_to(data) for log in logs)):
        yield data


def _announce(shell: Shell, name: str, found: Look) -> None:
    if found.due:
        told = ", ".join(f"{why} {len(ids)}" for why, ids in found.reasons.items())
        shell.note(name, f"{counted(len(found.due), 'row')} to make: {told}")
    if found.away:
        shell.warn(_away(found))


def _away(found: Look) -> str:
    kept = "stays as it is, because its log is" if len(found.away) == 1 else "stay as they are, because their logs are"
    return (
        f"{counted(len(found.away), 'row')} {kept} not there or may not be read:"
        f" {listed(list(found.away), _SHOWN_IDS)}; bring the logs back, or check that their disk is mounted and"
        " ROBID_DATA is right"
    )


def _show_look(shell: Shell, found: Look, *, as_json: bool, one_line: bool) -> None:
    if as_json:
        print_json(DryRunAnswer(len(found.fresh), dict(found.away), found.reasons), one_line=one_line)
        return
    shell.say(
        f"{counted(len(found.due) + len(found.fresh), 'row')}: {len(found.due)} to make, {len(found.fresh)} fresh"
    )
    for why, ids in found.reasons.items():
        shell.say(f"  {why}, {counted(len(ids), 'row')}: {listed(ids, _SHOWN_IDS)}")
    if found.away:
        shell.warn(_away(found))


def _off(batch: Batch, row: int) -> OffRow:
    first = batch.comparison.off[row][0]
    fit, name = batch.comparison.names(first.trait)
    return OffRow(batch.ledgers[row].id, fit, name, first.away)


def _drift(batch: Batch, robot: int) -> DriftingRobot:
    first = batch.comparison.changing[robot][0]
    fit, name = batch.comparison.names(first.trait)
    return DriftingRobot(batch.comparison.robots.names[robot], fit, name, first.change)


def _show(shell: Shell, batch: Batch) -> None:
    rows, failed = counted(len(batch.ledgers), "row"), len(batch.failed)
    shell.say(f"{rows}: {batch.made} made, {len(batch.ledgers) - batch.made} fresh; {failed} failed")
    for _, message, _, names in causes(batch.failed)[:_SHOWN_CAUSES]:
        shell.say(f"  {listed(names)}: {message}")
    _show_comparison(shell, batch)
    if batch.not_to_be_used:
        shell.say(f"  graded do not use: {listed([ledger.id for ledger in batch.not_to_be_used])}")
    if batch.removed:
        shell.say(f"  no longer in the manifest, left on the disk: {listed(batch.removed)}")
    if failed > 0 and batch.made == 0:
        shell.say("  failed rows are tried again when their settings or logs change, or with --force")
    shell.say(f"{batch.table}  {batch.outcome}")
    shell.say(f"report: {batch.report}")


def _show_comparison(shell: Shell, batch: Batch) -> None:
    """One line each on outliers and drifts."""
    comparison = batch.comparison
    if comparison.off:
        told = [f"{each.id} ({each.name})" for each in map(partial(_off, batch), comparison.off)]
        shell.say(f"  off the fleet: {listed(told, _SHOWN_NAMES)}")
    if comparison.changing:
        told = [f"{each.robot} ({each.name})" for each in map(partial(_drift, batch), comparison.changing)]
        shell.say(f"  drifting: {listed(told, _SHOWN_NAMES)}")
    if comparison.untold:
        of = "" if len(comparison.robots.groups) == 1 else f" in {counted(len(comparison.untold), 'group')}"
        shell.say(f"  outliers cannot be named{of}: fewer than {FEWEST_ROBOTS} robots")
