"""How Dask, and the command that feeds it, bear very many rows: rows like those of the fleet, but without work."""

from __future__ import annotations

import pickle
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from robid.artifacts.artifact import Artifact, Dataset
from robid.backends.map import make_map
from robid.errors import DataError
from robid.fleet.ledger import Ledger, read_ledger
from robid.fleet.row import RowTask
from robid.fleet.rows import load_fleet
from robid.pipeline.graph import Run
from robid.report.numbers import significant
from robid.report.section import Section, Table
from robid.studies.fleet.logs import manifest_path
from robid.studies.fleet.memory import resident_mib
from robid.studies.fleet.robots import fleet_robots, study_of, template_path
from robid.studies.fleet.speed import core_count
from robid.studies.fleet.whole import FOLDER
from robid.studies.fleet.whole import NAME as WHOLE_NAME
from robid.studies.part import Part, PartFound
from robid.studies.tasks import Content, Results, Task

NAME = "scheduler"
_MEANINGS = {
    "rows": "Rows",
    "seconds": "Time that they took [s]",
    "bytes_out": "Bytes of a row's task",
    "bytes_back": "Bytes of a row's answer",
    "memory_bytes": "Memory that a row leaves in command and scheduler together [bytes]",
}


@dataclass(frozen=True)
class Fed:
    """A row without work, answered with the ledger of another one."""

    task: RowTask
    answer: Path


@dataclass(frozen=True)
class Feeding:
    """What a scheduler is fed with.

    Attributes:
        first: A row.
        count: How many rows like it.
        workers: Workers of the local cluster.
        folder: A folder that all of them see.
    """

    first: Fed
    count: int
    workers: int
    folder: Path


def scheduler_tasks(run: Run, earlier: Mapping[str, Results]) -> list[Task]:
    """Returns the one task; none where the study leaves it out."""
    count = study_of(run.loaded).scheduled
    if not count:
        return []
    fleet = load_fleet(manifest_path(run), template_path(run))
    rows = run.path(FOLDER) / "rows"
    sound = next(index for index, robot in enumerate(fleet_robots(run)) if robot.fault is None)
    row = fleet.rows[sound].row
    first = Fed(RowTask(row, fleet.template.path, fleet.text, rows, keep=False), rows / row.id)
    workers = core_count()
    decides = {"rows": count, "workers": workers, "like": earlier[WHOLE_NAME].paths[0].name}
    return [Task(NAME, decides, Feeding(first, count, workers, run.folder))]


def feed(feeding: Feeding) -> Content:
    """Feeds a local cluster and says what that took."""
    first, digits = feeding.first, len(str(feeding.count))
    rows = [_like(first, f"x{number:0{digits}d}") for number in range(feeding.count)]
    with make_map("dask", feeding.workers, folder=feeding.folder) as mapped:
        mapped(answer, rows[: feeding.workers])
        before, begun = resident_mib(), time.monotonic()
        answers = mapped(answer, rows)
        seconds, after = time.monotonic() - begun, resident_mib()
    grown = float("nan") if before is None or after is None else (after - before) * 2**20 / feeding.count
    found = {
        "rows": float(len(answers)),
        "seconds": seconds,
        "bytes_out": float(len(pickle.dumps((answer, rows[-1])))),
        "bytes_back": float(len(pickle.dumps(answers[-1]))),
        "memory_bytes": grown,
    }
    return Content({name: Dataset(np.array(value), "1", (), _MEANINGS[name]) for name, value in found.items()})


def _like(first: Fed, name: str) -> Fed:
    return replace(first, task=replace(first.task, row=replace(first.task.row, id=name)))


def answer(fed: Fed) -> Ledger:
    """Answers as a row does that is done."""
    return replace(_outline(fed.answer), id=fed.task.row.id)


@lru_cache(maxsize=1)
def _outline(folder: Path) -> Ledger:
    ledger = read_ledger(folder)
    if ledger is None:
        raise DataError("the row has no ledger", where=str(folder), remedy="run the study again")
    return ledger.outline


def conclude_scheduler(run: Run, results: Sequence[Artifact]) -> PartFound | None:
    """Tabulates what a row costs scheduler and command."""
    if not study_of(run.loaded).scheduled:
        return None
    [found] = results
    values = {name: float(dataset.values) for name, dataset in found.datasets.items()}
    values["rows_per_second"] = values["rows"] / values["seconds"]
    meanings = {**_MEANINGS, "rows_per_second": "Rows a second"}
    table = Table(("", "Value"), tuple((meanings[name], significant(value)) for name, value in values.items()))
    lead = "A local Dask cluster on all cores, fed with rows like those of the fleet, but without work."
    figures = {f"fleet.scheduled.{name}": value for name, value in values.items() if np.isfinite(value)}
    return PartFound(figures, {}, (Section("Very many rows", lead, (table,)),))


SCHEDULER = Part(NAME, conclude_scheduler, function=feed, following=scheduler_tasks)
