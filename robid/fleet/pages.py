"""Pages of single rows: of one that is done its whole report, of one that has failed its error."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from robid.artifacts.atomic import read_json
from robid.errors import ArtifactError, RobidError, WorkerError
from robid.fleet.folders import PAGE, remove, writing
from robid.fleet.ledger import LEDGER, Ledger, read_ledger
from robid.fleet.page.report import provenance_of
from robid.fleet.row import RowTask, Told, load_task
from robid.pipeline.graph import Run, asked_for, run_all
from robid.pipeline.report import write_page
from robid.report.page import ReportContent, Verdict
from robid.report.section import Folded, Notes, Section, Table

if TYPE_CHECKING:
    from robid.backends.map import Progress
    from robid.fleet.run import OpenMap


def make_pages(tasks: Sequence[RowTask], open_map: OpenMap, progress: Progress) -> None:
    """Makes the pages of rows that have none yet; one that cannot be made is told and stops nothing.

    Raises:
        ArtifactError: If a folder cannot be written.
        BackendError: If the scheduler or its workers are lost.
    """
    due = [task for task in tasks if not (task.folder / PAGE).exists()]
    if not due:
        return
    progress.expect(len(due), "pages")

    def finished(_: int, problem: str) -> None:
        progress.advance()
        if problem:
            progress.warn(problem)

    try:
        with open_map(one=False) as parallel_map:
            parallel_map(make_page, due, finished)
    except WorkerError as error:
        progress.warn(f"not all pages of single rows were made: {error.what}")


def make_page(task: RowTask) -> str:
    """Makes the page of a row; returns why it could not be made, empty where it was.

    Raises:
        ArtifactError: If the folder cannot be written.
    """
    task = task.anew()
    try:
        ledger = read_ledger(task.folder)
        if ledger is None:
            return f"row {task.row.id} has no page: its row.json has gone"
        if ledger.error is not None:
            _write_failure(task, ledger)
        else:
            _write_report(task)
    except ArtifactError:
        raise
    except RobidError as error:
        return f"row {task.row.id} has no page: {error.where}: {error.what}"
    except Exception as error:  # noqa: BLE001  the results are there; a page that is missing loses none
        return f"row {task.row.id} has no page, by a defect of ours: {type(error).__name__}: {error}"
    finally:
        remove(task.page_work)
    return ""


def _write_report(task: RowTask) -> None:
    """Runs the chain once more in a folder aside, for what was not kept; models that are there stay as they are."""
    loaded = load_task(task)
    name = f"{loaded.experiment.name}, row {task.row.id}"
    loaded = replace(loaded, experiment=loaded.experiment.model_copy(update={"name": name}))
    work = task.page_work
    with writing(work):
        shutil.copytree(task.folder, work, symlinks=True, ignore=shutil.ignore_patterns(LEDGER, PAGE))
    outputs = [node.output for node in asked_for(loaded)]
    run_all(Run(loaded, work, "serial", 1), Told().of, lambda _: None, outputs)
    with writing(task.folder):
        (work / "report.html").replace(task.folder / PAGE)


def _write_failure(task: RowTask, ledger: Ledger) -> None:
    """Writes what is known of a row that has failed."""
    settings = read_json(task.folder / LEDGER)["settings"]
    inputs = {name: key.sha256 for name, key in ledger.inputs.items()}
    content = failure_content(ledger, settings)
    write_page(task.folder / PAGE, content, provenance_of(task.row.id, inputs))


def failure_content(ledger: Ledger, settings: dict[str, Any]) -> ReportContent:
    """Lays out the page of a row that has failed.

    Args:
        ledger: Its ledger.
        settings: Its settings.
    """
    error = ledger.error
    if error is None:
        message = "the row has not failed"
        raise ValueError(message)
    wrong = Table(
        ("", ""),
        (("Kind", error.kind), ("Where", error.where), ("What is wrong", error.message), ("What to do", error.remedy)),
        styles=("name", "prose"),
    )
    read = tuple((name, key.sha256 or "could not be read") for name, key in ledger.inputs.items())
    stated = tuple(_flat(settings))
    warned = (Section("Warnings", "What its stages said before it failed.", (Notes(ledger.warnings),)),)
    return ReportContent(
        title=f"Row {ledger.id}",
        verdict=Verdict(f"Failed: {error}", "bad"),
        robot="",
        sections=(
            Section("Failure", "", (wrong,)),
            *(warned if ledger.warnings else ()),
            Section("Files", "What it was made from.", (Table(("File", "SHA-256"), read, styles=("name", "code")),)),
            Section(
                "Settings",
                "",
                (Folded("All settings of the row", (Table(("Setting", "Value"), stated, styles=("name", "prose")),)),),
            ),
        ),
    )


def _flat(value: object, name: str = "") -> Iterator[tuple[str, str]]:
    """Settings by dotted name; short lists on a line."""
    if isinstance(value, dict) and value:
        for key, inner in value.items():
            yield from _flat(inner, f"{name}.{key}" if name else str(key))
    elif value is not None:
        yield name, str(value)
