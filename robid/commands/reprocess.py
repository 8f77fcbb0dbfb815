"""Running an experiment file over the rows of a manifest."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any, Literal

from robid.artifacts.atomic import FOLDER_LOCK, locked
from robid.backends.map import make_map
from robid.commands.output import print_json
from robid.commands.shared import PROBLEM, choose_backend
from robid.errors import SettingsError
from robid.fleet.comparison import listed
from robid.fleet.ledger import Ledger, causes
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
    count, inputs = workers or execution.workers or os.cpu_count() or 1, tuple(_folders(fleet))
    mapped = partial(make_map, chosen, scheduler=scheduler or execution.scheduler, folder=run_dir, inputs=inputs)
    name, does = fleet.experiment.name, f"robid reprocess {manifest} {experiment}"
    with (
        locked(run_dir / FOLDER_LOCK, does),
        shell.progress(name, workers=1 if chosen == "serial" else count) as progress,
    ):
        announce = partial(_announce, shell, name)
        tell = partial(_tell_row, shell, {planned.row.id: planned.row.place for planned in fleet.rows}, stream)
        batch = run_fleet(fleet, run_dir, options, lambda *, one: mapped(1 if one else count), progress, tell, announce)
    if as_json:
        print_json(summary(batch), one_line=stream)
    else:
        _show(shell, batch)
    strictly = batch.not_to_be_used or batch.comparison.off or batch.comparison.changing
    return PROBLEM if batch.failed or (strict and strictly) else 0


def _tell_row(shell: Shell, places: Mapping[str, str], stream: bool, ledger: Ledger, outcome: str) -> None:
    if stream:
        print_json({**row_summary(ledger), "outcome": outcome}, one_line=True)
    if ledger.error is not None and outcome == "made":
        shell.warn(f"{places[ledger.id]}: row {ledger.id} failed: {ledger.error}")


def row_summary(ledger: Ledger) -> dict[str, Any]:
    """What `--stream` says of a row."""
    error = None if ledger.error is None else asdict(ledger.error)
    grades = {fit: {"grade": value, "grade_sentence": sentence} for fit, (value, sentence) in ledger.grades.items()}
    return {"id": ledger.id, "status": ledger.status, "error": error, "grades": grades, "seconds": ledger.seconds}


def summary(batch: Batch) -> dict[str, Any]:
    """What `--json` says of a batch."""
    return {
        "rows": len(batch.ledgers),
        "made": batch.made,
        "fresh": len(batch.ledgers) - batch.made,
        "logs_away": {name: list(logs) for name, logs in batch.away.items()},
        "failed": [{"id": ledger.id, **asdict(ledger.error)} for ledger in batch.failed if ledger.error],
        "do_not_use": [ledger.id for ledger in batch.not_to_be_used],
        "outliers": [_off(batch, row) for row in batch.comparison.off],
        "drifts": [_drift(batch, robot) for robot in batch.comparison.changing],
        "untold": [batch.comparison.robots.groups[group] for group in batch.comparison.untold],
        "removed": list(batch.removed),
        "table": str(batch.table),
        "summary": str(batch.summary),
        "report": str(batch.report),
        "outcome": batch.outcome,
    }


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
        away = {name: list(logs) for name, logs in found.away.items()}
        print_json({"fresh": len(found.fresh), "logs_away": away, "due": found.reasons}, one_line=one_line)
        return
    shell.say(
        f"{counted(len(found.due) + len(found.fresh), 'row')}: {len(found.due)} to make, {len(found.fresh)} fresh"
    )
    for why, ids in found.reasons.items():
        shell.say(f"  {why}, {counted(len(ids), 'row')}: {listed(ids, _SHOWN_IDS)}")
    if found.away:
        shell.warn(_away(found))


def _off(batch: Batch, row: int) -> dict[str, Any]:
    first = batch.comparison.off[row][0]
    fit, name = batch.comparison.names(first.trait)
    return {"id": batch.ledgers[row].id, "fit": fit, "name": name, "away": first.away}


def _drift(batch: Batch, robot: int) -> dict[str, Any]:
    first = batch.comparison.changing[robot][0]
    fit, name = batch.comparison.names(first.trait)
    return {"robot": batch.comparison.robots.names[robot], "fit": fit, "name": name, "change": first.change}


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
        told = [f"{each['id']} ({each['name']})" for each in map(partial(_off, batch), comparison.off)]
        shell.say(f"  off the fleet: {listed(told, _SHOWN_NAMES)}")
    if comparison.changing:
        told = [f"{each['robot']} ({each['name']})" for each in map(partial(_drift, batch), comparison.changing)]
        shell.say(f"  drifting: {listed(told, _SHOWN_NAMES)}")
    if comparison.untold:
        of = "" if len(comparison.robots.groups) == 1 else f" in {counted(len(comparison.untold), 'group')}"
        shell.say(f"  outliers cannot be told{of}: fewer than {FEWEST_ROBOTS} robots")
