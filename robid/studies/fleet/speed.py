"""The speed of `robid reprocess` on each backend, and what Dask bears in rows without work."""

from __future__ import annotations

import json
import os
import pickle
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

import numpy as np

from robid.artifacts.artifact import Dataset, canonical_hash
from robid.artifacts.atomic import read_json, write_json
from robid.backends.map import make_map
from robid.errors import BackendError, DataError
from robid.fleet.ledger import FORMATS, Ledger, read_ledger
from robid.fleet.row import RowTask
from robid.fleet.rows import load_fleet
from robid.pipeline.graph import Run
from robid.report.numbers import significant
from robid.report.section import Section
from robid.studies.fleet.logs import NAME as LOGS_NAME
from robid.studies.fleet.logs import (
    fleet_robots,
    hashes_of,
    manifest_path,
    stated_payload,
    template_path,
    write_manifest,
)
from robid.studies.fleet.whole import FOLDER, resident_mib
from robid.studies.fleet.whole import NAME as WHOLE_NAME
from robid.studies.page import Asked, PartFound, table
from robid.studies.settings.study import FleetSpeed
from robid.studies.study import Content, Part, Results, Task, values_of

NAME = "speed"
SERIAL = ("serial", 1)
_FINE = (0, 5)
_BARS = {"processes": 0.9, "dask": 0.85}
_TWO_WORKERS = Asked(lower=1.6)


@dataclass(frozen=True)
class Timing:
    """What is timed."""

    manifest: Path
    template: Path
    folder: Path
    ways: tuple[tuple[str, int], ...]
    repeats: int
    key: str


def core_count() -> int:
    """Returns the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def ways(cores: int) -> tuple[tuple[str, int], ...]:
    """Returns the backends to time, with their numbers of workers, each once."""
    return tuple(dict.fromkeys([SERIAL, ("processes", cores), ("dask", cores), ("dask", 1), ("dask", 2)]))


def _speed_tasks(run: Run, speed: FleetSpeed, earlier: Mapping[str, Results]) -> list[Task]:
    sound = [robot for robot in fleet_robots(run) if robot.fault is None][: speed.rows]
    path, template = run.path("manifest_of_speed.csv"), template_path(run)
    write_manifest(path, sound, stated_payload(run))
    decides = {
        "rows": [[planned.row.id, planned.settings_hash] for planned in load_fleet(path, template).rows],
        "logs": canonical_hash(list(hashes_of(earlier[LOGS_NAME]))),
        "ways": [list(way) for way in ways(core_count())],
        "repeats": speed.repeats,
        "formats": FORMATS,
    }
    timing = Timing(path, template, run.path(NAME), ways(core_count()), speed.repeats, canonical_hash(decides))
    return [Task(NAME, decides, (timing,))]


def time_all(timing: Timing) -> Content:
    """Times every backend in turn; runs that a stopped study has timed are not timed again."""
    rates = np.array([[_rate(timing, repeat, way) for way in timing.ways] for repeat in range(timing.repeats)])
    shutil.rmtree(timing.folder, ignore_errors=True)
    return Content(
        {
            "rate": Dataset(rates, "1/s", ("repeat", "way"), "Rows a second"),
            "backend": Dataset(np.array([name for name, _ in timing.ways]), "1", ("way",)),
            "workers": Dataset(np.array([count for _, count in timing.ways]), "1", ("way",)),
        }
    )


def _rate(timing: Timing, repeat: int, way: tuple[str, int]) -> float:
    note = timing.folder / f"{repeat}_{way[0]}_{way[1]}.json"
    if note.exists():
        held = read_json(note, made_by="robid study")
        if held["key"] == timing.key:
            return float(held["rate"])
    rate = rate_of(finish_times(timing, way), way[1])
    write_json(note, {"key": timing.key, "rate": rate})
    return rate


def rate_of(finished: Sequence[float], workers: int) -> float:
    """Returns rows a second between the first and the last of the rows, finished at these times in order [s].

    The first rows of all workers count as finished with the very first, which is rather too strict.

    Raises:
        BackendError: If there are too few rows to tell.
    """
    if len(finished) <= workers:
        what = f"B011 {len(finished)} rows are too few to time {workers} workers."
        raise BackendError(what, where="study.speed.rows", remedy="ask for more rows than cores")
    return (len(finished) - workers) / (finished[-1] - finished[0])


def finish_times(timing: Timing, way: tuple[str, int]) -> list[float]:
    """Reprocesses the rows in a folder of its own, by a command of its own; returns when each was finished [s].

    Raises:
        BackendError: If the command does not end as it should.
    """
    backend, workers = way
    timing.folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=timing.folder) as scratch, (Path(scratch) / "messages").open("w+") as messages:
        command = [sys.executable, "-m", "robid", "reprocess", str(timing.manifest), str(timing.template)]
        command += ["--run-dir", f"{scratch}/run", "--backend", backend, "--workers", str(workers)]
        command += ["--pages", "none", "--json", "--stream"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=messages, text=True) as process:
            try:
                finished = [time.monotonic() for line in process.stdout or () if "outcome" in json.loads(line)]
            except BaseException:
                process.kill()
                raise
        if process.returncode not in _FINE:
            messages.seek(0)
            last = (messages.read().strip().splitlines() or ["it says nothing"])[-1]
            what = f"B012 `robid reprocess --backend {backend}` ended with code {process.returncode}: {last}"
            raise BackendError(what, where=str(timing.manifest), remedy="run it by hand and see")
    return finished[:-1]


def _conclude_speed(_run: Run, speed: FleetSpeed, results: Results) -> PartFound:
    [found] = results
    values = values_of(found)
    timed = zip(values["backend"].tolist(), values["workers"].tolist(), strict=True)
    rates = {way: values["rate"][:, index].tolist() for index, way in enumerate(timed)}
    cores = next(count for name, count in rates if name == "processes")
    asked = {f"fleet.efficiency_{name}": Asked(lower=bar) for name, bar in _BARS.items()}
    asked["fleet.two_workers"] = _TWO_WORKERS
    columns = (
        ("Backend", lambda way: way[0]),
        ("Workers", lambda way: str(way[1])),
        ("Rows a second, median", lambda way: significant(median(rates[way]))),
        ("Lowest", lambda way: significant(min(rates[way]))),
        ("Highest", lambda way: significant(max(rates[way]))),
        ("Each worker over serial", lambda way: significant(median(rates[way]) / way[1] / median(rates[SERIAL]))),
    )
    lead = (
        f"`robid reprocess` on {speed.rows} sound rows as a user would start it, backends in turn, on {cores} cores."
        " Rows a second between the first and the last finished row: the start of the command and of its workers is not"
        " in it; of w workers, w rows count as finished with the first, which is rather too strict."
    )
    section = Section("Speed", lead, (table(columns, rates, fit="compact"),))
    return PartFound(efficiencies(rates, cores), asked, (section,))


def efficiencies(rates: Mapping[tuple[str, int], Sequence[float]], cores: int) -> dict[str, float]:
    """Returns the throughput of each core over that of the serial backend, from medians over the runs."""
    middle = {way: median(found) for way, found in rates.items()}
    return {
        **{f"fleet.efficiency_{name}": middle[name, cores] / cores / middle[SERIAL] for name in _BARS},
        "fleet.two_workers": middle["dask", 2] / middle["dask", 1],
        "fleet.serial_rows_per_second": middle[SERIAL],
        "fleet.cores": float(cores),
    }


SPEED = Part(NAME, _conclude_speed, _speed_tasks, time_all)


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


def _scheduler_tasks(run: Run, count: int, earlier: Mapping[str, Results]) -> list[Task]:
    fleet = load_fleet(manifest_path(run), template_path(run))
    rows = run.path(FOLDER) / "rows"
    sound = next(index for index, robot in enumerate(fleet_robots(run)) if robot.fault is None)
    row = fleet.rows[sound].row
    first = Fed(RowTask(row, fleet.template.path, fleet.text, rows, keep=False), rows / row.id)
    workers = core_count()
    decides = {"rows": count, "workers": workers, "like": earlier[WHOLE_NAME].paths[0].name}
    return [Task("scheduler", decides, (first, count, workers, run.folder))]


def feed(first: Fed, count: int, workers: int, folder: Path) -> Content:
    """Feeds a local cluster with so many rows and says what that took."""
    digits = len(str(count))
    names = [f"x{number:0{digits}d}" for number in range(count)]
    rows = [replace(first, task=replace(first.task, row=replace(first.task.row, id=name))) for name in names]
    with make_map("dask", workers, folder=folder) as mapped:
        mapped(answer, rows[:workers])
        before, begun = resident_mib(), time.monotonic()
        answers = mapped(answer, rows)
        seconds, after = time.monotonic() - begun, resident_mib()
    grown = float("nan") if before is None or after is None else (after - before) * 2**20 / count
    found = {
        "rows": float(len(answers)),
        "seconds": seconds,
        "bytes_out": float(len(pickle.dumps((answer, rows[-1])))),
        "bytes_back": float(len(pickle.dumps(answers[-1]))),
        "memory_bytes": grown,
    }
    return Content({name: Dataset(np.array(value), "1", (), _MEANINGS[name]) for name, value in found.items()})


def answer(fed: Fed) -> Ledger:
    """Answers as a row does that is done."""
    return replace(_outline(fed.answer), id=fed.task.row.id)


@lru_cache(maxsize=1)
def _outline(folder: Path) -> Ledger:
    ledger = read_ledger(folder)
    if ledger is None:
        raise DataError("D219 the row has no ledger", where=str(folder), remedy="run the study again")
    return ledger.outline


def _conclude_scheduler(_run: Run, _count: int, results: Results) -> PartFound:
    """Tabulates what a row costs scheduler and command."""
    [found] = results
    values = {name: float(dataset.values) for name, dataset in found.datasets.items()}
    values["rows_per_second"] = values["rows"] / values["seconds"]
    meanings = {**_MEANINGS, "rows_per_second": "Rows a second"}
    shown = table((("", lambda name: meanings[name]), ("Value", lambda name: significant(values[name]))), values)
    lead = "A local Dask cluster on all cores, fed with rows like those of the fleet, but without work."
    figures = {f"fleet.scheduled.{name}": value for name, value in values.items() if np.isfinite(value)}
    return PartFound(figures, {}, (Section("Very many rows", lead, (shown,)),))


SCHEDULER = Part("scheduler", _conclude_scheduler, _scheduler_tasks, feed, field="scheduled")
