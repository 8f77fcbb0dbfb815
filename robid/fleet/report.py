"""The page of a fleet with its failures and grades, and a page for each single row that is to have one."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from robid.artifacts.artifact import Provenance, canonical_hash, git_commit, package_versions, utc_now
from robid.artifacts.atomic import read_json
from robid.errors import ArtifactError, RobidError, WorkerError
from robid.fleet.comparison import MOST_SHOWN, Found, listed
from robid.fleet.deadline import LateError, within
from robid.fleet.folders import PAGE, remove, writing
from robid.fleet.ledger import LEDGER, Ledger, causes, read_ledger
from robid.fleet.row import RowTask, Told, load_task
from robid.fleet.sections import drift_sections, outlier_sections, parameter_sections, population_sections
from robid.pipeline.freshness import check_replaceable, read_stamp
from robid.pipeline.graph import Run, asked_for, run_all
from robid.pipeline.report import write_page
from robid.pipeline.stage import counted
from robid.report.page import ReportContent, Verdict
from robid.report.section import ColumnStyle, Folded, Notes, Part, Section, Table
from robid.results.grade import WORDS

if TYPE_CHECKING:
    from robid.backends.map import Progress
    from robid.fleet.run import OpenMap

_STAGE = "reprocess"


def write_report(path: Path, found: Found) -> Literal["made", "fresh"]:
    """Writes the page unless the one that is there says the same."""
    content = report_content(found)
    provenance = provenance_of(found.name, {"content": hashlib.sha256(repr(content).encode()).hexdigest()})
    with suppress(ArtifactError):
        made = read_stamp(path)
        if (made.stage, made.settings_hash, made.inputs) == (_STAGE, provenance.settings_hash, provenance.inputs):
            return "fresh"
    check_report(path)
    write_page(path, content, provenance)
    return "made"


def provenance_of(name: str, inputs: dict[str, str]) -> Provenance:
    """Returns where a page of an experiment's fleet comes from."""
    settings, now = {"name": name}, utc_now()
    return Provenance(
        stage=_STAGE,
        settings=settings,
        settings_hash=canonical_hash(settings),
        inputs=inputs,
        versions=package_versions(),
        git_commit=git_commit(),
        started_utc=now,
        finished_utc=now,
    )


def check_report(path: Path) -> None:
    """Refuses to replace what is no report.

    Raises:
        ArtifactError: If it is none.
    """
    check_replaceable(path, "report", {})


def report_content(found: Found) -> ReportContent:
    """Lays out the page of a fleet."""
    comparison, rows = found.comparison, len(found.ledgers)
    failed = sum(ledger.error is not None for ledger in found.ledgers)
    unusable = sum(any(value == 0 for value, _ in ledger.grades.values()) for ledger in found.ledgers)
    off, changing = len(comparison.off), len(comparison.changing)
    counts = ((failed, "failed"), (off, "off the fleet"), (unusable, "graded do not use"))
    texts = [f"{rows - failed} of {counted(rows, 'row')} done"]
    texts += [f"{count} {what}" for count, what in counts if count]
    texts += [f"{counted(changing, 'robot')} drifting"] if changing else []
    level: Literal["ok", "warn"] = "warn" if failed or unusable or off or changing else "ok"
    robots = len(comparison.robots.names)
    return ReportContent(
        title=found.name,
        verdict=Verdict(f"{'; '.join(texts)}.", level),
        robot=counted(rows, "row") if robots == rows else f"{counted(rows, 'row')} of {counted(robots, 'robot')}",
        sections=(
            *failure_sections(found),
            *outlier_sections(found),
            *drift_sections(found),
            *population_sections(found),
            *parameter_sections(found),
            *grade_sections(found),
        ),
    )


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
            content = failure_content(ledger, read_json(task.folder / LEDGER)["settings"])
            inputs = {name: key.sha256 for name, key in ledger.inputs.items()}
            write_page(task.folder / PAGE, content, provenance_of(task.row.id, inputs))
        else:
            within(task.timeout_s, lambda: _write_report(task))
    except ArtifactError:
        raise
    except LateError:
        return f"row {task.row.id} has no page: it did not end within {task.timeout_s:g} s"
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


def failure_content(ledger: Ledger, settings: dict[str, Any]) -> ReportContent:
    """Lays out the page of a row that has failed."""
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
    stated = Table(("Setting", "Value"), tuple(_flat(settings)), styles=("name", "prose"))
    warned = (Section("Warnings", "What its stages said before it failed.", (Notes(ledger.warnings),)),)
    return ReportContent(
        title=f"Row {ledger.id}",
        verdict=Verdict(f"Failed: {error}", "bad"),
        robot="",
        sections=(
            Section("Failure", "", (wrong,)),
            *(warned if ledger.warnings else ()),
            Section("Files", "What it was made from.", (Table(("File", "SHA-256"), read, styles=("name", "code")),)),
            Section("Settings", "", (Folded("All settings of the row", (stated,)),)),
        ),
    )


def _flat(value: object, name: str = "") -> Iterator[tuple[str, str]]:
    """Settings by dotted name; short lists on a line."""
    if isinstance(value, dict) and value:
        for key, inner in value.items():
            yield from _flat(inner, f"{name}.{key}" if name else str(key))
    elif value is not None:
        yield name, str(value)


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
    rows = [
        (WORDS[value], str(len(ids)), _reasons(value, sentence), listed(ids))
        for (value, sentence), ids in ordered[:MOST_SHOWN]
    ]
    more = f"The first {MOST_SHOWN} of {len(ordered)}; all are in the table." if len(ordered) > MOST_SHOWN else ""
    styles: tuple[ColumnStyle, ...] = ("name", "number", "prose", "prose")
    table = Table(("Grade", "Rows", "Why", "Which"), tuple(rows), styles=styles, caption=more)
    return (Section("Grades", "The worst first.", (table,)),)


def _reasons(value: int, sentence: str) -> str:
    """What a grade's sentence says beyond the grade."""
    rest = sentence[len(WORDS[value]) :].strip(":;, ")
    return f"{rest[:1].upper()}{rest[1:]}" if rest.strip(".") else "Nothing speaks against it."
