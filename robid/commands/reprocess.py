"""Running an experiment file over the rows of a manifest."""

from __future__ import annotations

import os
from contextlib import AbstractContextManager
from dataclasses import asdict
from pathlib import Path
from typing import Any, Literal

from robid.artifacts.lock import FOLDER_LOCK, locked
from robid.backends.map import Map, make_map
from robid.commands.output import print_json
from robid.commands.shared import PROBLEM
from robid.errors import SettingsError
from robid.fleet.ledger import Ledger
from robid.fleet.report import causes, listed
from robid.fleet.rows import load_fleet
from robid.fleet.run import Batch, Options, run_fleet
from robid.fleet.table import require_table
from robid.stages.stage import counted
from robid.stages.terminal import Shell, make_console

_SHOWN_CAUSES = 10


def reprocess(
    manifest: Path,
    experiment: Path,
    folder: Path | None,
    options: Options,
    backend: Literal["serial", "processes"] | None,
    workers: int | None,
    *,
    strict: bool,
    as_json: bool,
    stream: bool,
) -> int:
    """Runs the rows of a manifest and prints what became of them; returns the exit code."""
    if stream and not as_json:
        raise SettingsError("`--stream` says how `--json` is printed", where="--stream", remedy="add --json")
    require_table()
    fleet = load_fleet(manifest, experiment)
    execution = fleet.experiment.execution
    shell = Shell(make_console(stderr=False), make_console(stderr=True), as_json or execution.log_level == "warning")
    for warning in fleet.warnings:
        shell.warn(warning)

    def tell(ledger: Ledger, outcome: str) -> None:
        if stream:
            print_json({**row_summary(ledger), "outcome": outcome}, one_line=True)
        if ledger.error is not None and outcome == "made":
            shell.warn(f"row {ledger.id} failed: {ledger.error}")

    run_dir = folder or Path("runs") / fleet.experiment.name
    count = workers or execution.workers or os.cpu_count() or 1

    def open_map(*, one: bool) -> AbstractContextManager[Map]:
        return make_map(backend or execution.backend, 1 if one else count)

    does = f"robid reprocess {manifest} {experiment}"
    with locked(run_dir / FOLDER_LOCK, does), shell.progress(fleet.experiment.name) as progress:
        batch = run_fleet(fleet, run_dir, options, open_map, progress, tell)
    if as_json:
        print_json(summary(batch), one_line=stream)
    else:
        _show(shell, batch)
    return PROBLEM if batch.failed or (strict and batch.not_to_be_used) else 0


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
        "failed": [{"id": ledger.id, **asdict(ledger.error)} for ledger in batch.failed if ledger.error],
        "do_not_use": [ledger.id for ledger in batch.not_to_be_used],
        "removed": list(batch.removed),
        "table": str(batch.table),
        "report": str(batch.report),
        "outcome": batch.outcome,
    }


def _show(shell: Shell, batch: Batch) -> None:
    rows, failed = counted(len(batch.ledgers), "row"), len(batch.failed)
    shell.say(f"{rows}: {batch.made} made, {len(batch.ledgers) - batch.made} fresh; {failed} failed")
    for _, message, _, names in causes(batch.failed)[:_SHOWN_CAUSES]:
        shell.say(f"  {listed(names)}: {message}")
    if batch.not_to_be_used:
        shell.say(f"  graded do not use: {listed([ledger.id for ledger in batch.not_to_be_used])}")
    if batch.removed:
        shell.say(f"  no longer in the manifest, left on the disk: {listed(batch.removed)}")
    if failed > 0 and batch.made == 0:
        shell.say("  failed rows are tried again when their settings or logs change, or with --force")
    shell.say(f"{batch.table}  {batch.outcome}")
    shell.say(f"report: {batch.report}")
