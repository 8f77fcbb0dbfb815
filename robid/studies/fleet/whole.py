"""The whole fleet, reprocessed once by one worker: which faults are found, who is accused, how its memory grows."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.artifacts.artifact import Dataset
from robid.artifacts.atomic import FOLDER_LOCK, locked
from robid.backends.map import Map, make_map
from robid.fleet.ledger import FORMATS
from robid.fleet.row import Told
from robid.fleet.rows import load_fleet
from robid.fleet.run import Batch, Options, run_fleet
from robid.pipeline.graph import Run
from robid.report.section import Cell, Section, Table
from robid.studies.fleet.logs import NAME as LOGS_NAME
from robid.studies.fleet.logs import (
    Fault,
    FleetRobot,
    fleet_robots,
    hashes_of,
    manifest_path,
    stated_payload,
    template_path,
    write_manifest,
)
from robid.studies.page import Asked, PartFound, figure, table
from robid.studies.settings.study import KINDS, FleetStudy
from robid.studies.study import Content, Part, Results, Task, values_of

_STATM = Path("/proc/self/statm")


@contextmanager
def watched_worker(series: list[float]) -> Iterator[Map]:
    """Yields a map with a single worker process, as `robid reprocess --backend processes --workers 1` has it.

    The series gets the worker's memory after each task [MiB]; nothing where the system does not tell it.
    """

    def mapped(
        function: Callable[[Any], Any], tasks: Sequence[Any], on_done: Callable[[int, Any], None] | None = None
    ) -> list[Any]:
        def done(index: int, pair: tuple[Any, float | None]) -> None:
            if pair[1] is not None:
                series.append(pair[1])
            if on_done is not None:
                on_done(index, pair[0])

        return [result for result, _ in one_worker(partial(_measured, function), tasks, done)]

    with make_map("processes", 1) as one_worker:
        yield mapped


def _measured(function: Callable[[Any], Any], task: Any) -> tuple[Any, float | None]:  # noqa: ANN401
    return function(task), resident_mib()


def resident_mib() -> float | None:
    """Returns the resident memory of this process [MiB]; None where there is no /proc."""
    if not _STATM.exists():
        return None
    return int(_STATM.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


_TITLES = {
    "spring": "A softened spring",
    "sign": "A wrong sign",
    "dead": "A dead channel",
    "gap": "Lost samples",
    "payload": "A wrong payload",
    "file": "A damaged file",
}


def faults_section(robots: Sequence[FleetRobot], values: Mapping[str, Any], figures: Mapping[str, float]) -> Section:
    """What became of each fault, and which sound robots are accused; `values` (n_row,) are those of the task."""
    counts = (
        ("Fault", lambda kind: _TITLES[kind]),
        ("Robots", lambda kind: str(sum(robot.kind == kind for robot in robots))),
        ("Found", lambda kind: f"{figures[f'fleet.{kind}.found']:.0f}"),
        ("of them failed", lambda kind: f"{figures[f'fleet.{kind}.failed']:.0f}"),
    )
    planted = [kind for kind in KINDS if f"fleet.{kind}.found" in figures]
    rows = []
    for index, robot in enumerate(robots):
        named = bool(values["failed"][index] or values["off"][index])
        if robot.fault is None and not named:
            continue
        what = "sound" if robot.fault is None else said(robot.fault)
        became = "failed" if values["failed"][index] else "an outlier" if named else "not found"
        good = named == (robot.fault is not None)
        rows.append((robot.name, what, Cell(became, "" if good else "bad"), str(values["told"][index])))
    heads = ("Robot", "What is wrong", "It is", "What is said")
    title = "Robots with a fault, and sound ones that are accused"
    each = Table(heads, tuple(rows), title=title, prose=True, fit="tall")
    lead = (
        "Found is a fault whose row failed or is on the list of outliers; accused is a sound robot of which that is"
        " true. A grade accuses nobody."
    )
    return Section("Faults", lead, (table(counts, planted, title="By kind", fit="compact"), each))


def said(fault: Fault) -> str:
    """Says what is wrong with a robot or its log."""
    channel = f"{fault.channel} of joint {fault.joint + 1}"
    return {
        "spring": f"transmission of joint {fault.joint + 1} softened",
        "sign": f"sign of the {channel}",
        "dead": f"{channel} dead, {fault.variant}",
        "gap": f"{fault.samples} samples lost",
        "payload": "another payload mounted",
        "file": f"file {fault.variant}",
    }[fault.kind]


def memory_section(memory: FloatArray, settled: int) -> tuple[Section, ...]:
    """How the memory of the worker (n_done,) [MiB] grew from so many rows on; nothing where it was not watched."""
    if len(memory) <= settled:
        return ()
    axes = "Row", "Resident memory [MiB]"
    shown = figure("Memory after each row", axes, None, {"worker": memory}, log_x=False, log_y=False)
    lead = f"Of the one worker process that reprocessed the fleet; growth is counted from the {settled}th row on."
    return (Section("Memory", lead, (shown,)),)


NAME, FOLDER = "whole", "reprocessed"
_FOUND, _ACCUSED = 28 / 30, 4 / 970
_GROWTH = Asked(upper=1.1)
_SETTLED = 10


def _whole_tasks(run: Run, _study: FleetStudy, earlier: Mapping[str, Results]) -> list[Task]:
    """Returns the one task: all rows, of which a stopped study keeps what is done."""
    path, template = manifest_path(run), template_path(run)
    write_manifest(path, fleet_robots(run), stated_payload(run))
    fleet = load_fleet(path, template)
    decides = {
        "rows": [[planned.row.id, planned.settings_hash] for planned in fleet.rows],
        "logs": list(hashes_of(earlier[LOGS_NAME])),
        "formats": FORMATS,
    }
    return [Task(NAME, decides, (path, template, run.path(FOLDER)))]


def reprocess_whole(manifest: Path, template: Path, folder: Path) -> Content:
    """Reprocesses all rows on one worker, and watches its memory."""
    memory: list[float] = []
    fleet = load_fleet(manifest, template)

    def open_map(*, one: bool) -> AbstractContextManager[Map]:
        del one
        return watched_worker(memory)

    with locked(folder / FOLDER_LOCK, "robid study"):
        batch = run_fleet(fleet, folder, Options(pages="none"), open_map, Told(), lambda *_: None)
    failed = np.array([ledger.status == "failed" for ledger in batch.ledgers])
    off = np.array([row in batch.comparison.off for row in range(len(batch.ledgers))])
    told = np.array([_told(batch, row) for row in range(len(batch.ledgers))])
    return Content(
        {
            "failed": Dataset(failed, "1", ("row",), "Whether the row failed"),
            "off": Dataset(off, "1", ("row",), "Whether it is off its fleet"),
            "told": Dataset(told, "1", ("row",), "What is said of it"),
            "memory": Dataset(np.array(memory), "MiB", ("done",), "Memory of the worker after each row"),
            "seconds": Dataset(np.array([ledger.seconds for ledger in batch.ledgers]), "s", ("row",), "Time of each"),
        }
    )


def _told(batch: Batch, row: int) -> str:
    """The cause of a failure, or what the row is off in most; empty of the others."""
    error = batch.ledgers[row].error
    if error is not None:
        return f"{error.kind}: {error.message}"[:200]
    if row not in batch.comparison.off:
        return ""
    first = batch.comparison.off[row][0]
    return f"{batch.comparison.names(first.trait)[1]}, {first.away:+.1f} deviations"


def count_found(kinds: Sequence[str], failed: BoolArray, off: BoolArray) -> dict[str, float]:
    """Counts the faults that are found and the sound robots that are accused, of rows that failed or are off (n_row,).

    A sound robot's kind is empty; a kind that was not planted has no numbers.
    """
    named = failed | off
    of = np.array(kinds)
    figures = {
        "fleet.planted": float((of != "").sum()),
        "fleet.found": float(named[of != ""].sum()),
        "fleet.sound": float((of == "").sum()),
        "fleet.false_alarms": float(named[of == ""].sum()),
    }
    for kind in KINDS:
        own = of == kind
        if own.any():
            figures[f"fleet.{kind}.found"] = float(named[own].sum())
            figures[f"fleet.{kind}.failed"] = float(failed[own].sum())
    return figures


def _conclude_whole(run: Run, _study: FleetStudy, results: Results) -> PartFound:
    """Counts what was found, and says how the worker's memory grew."""
    [found] = results
    values = values_of(found)
    robots = fleet_robots(run)
    figures = count_found([robot.kind for robot in robots], values["failed"], values["off"])
    figures["fleet.row_seconds"] = float(np.median(values["seconds"]))
    asked = {
        "fleet.found": Asked(lower=_FOUND * figures["fleet.planted"]),
        "fleet.false_alarms": Asked(upper=_ACCUSED * figures["fleet.sound"]),
    }
    memory, warnings = values["memory"], []
    if len(memory) > _SETTLED:
        figures["fleet.memory_rows"] = float(len(memory))
        figures["fleet.memory_mib"] = float(memory[-1])
        figures["fleet.memory_growth"] = float(memory[-1] / memory[_SETTLED - 1])
        asked["fleet.memory_growth"] = _GROWTH
    if len(memory) < len(robots):
        warnings.append(
            f"Memory was watched over {len(memory)} of {len(robots)} rows, those since the study last went on;"
            f" without {FOLDER}/ and tasks/{NAME}/ in the run folder it watches all."
        )
    sections = (faults_section(robots, values, figures), *memory_section(memory, _SETTLED))
    return PartFound(figures, asked, sections, tuple(warnings))


WHOLE = Part(NAME, _conclude_whole, _whole_tasks, reprocess_whole, field="")
