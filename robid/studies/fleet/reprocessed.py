"""The fleet reprocessed: once by one watched worker, timed on each backend, and rows without work that Dask bears."""

from __future__ import annotations

import json
import os
import pickle
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from robid.arrays import BoolArray
from robid.artifacts.artifact import Dataset, canonical_hash
from robid.artifacts.atomic import FOLDER_LOCK, locked, read_json, write_json
from robid.backends.map import Map, make_map
from robid.errors import BackendError, DataError
from robid.fleet.ledger import FORMATS, Ledger, read_ledger
from robid.fleet.row import RowTask, Told
from robid.fleet.rows import load_fleet
from robid.fleet.run import Batch, Options, run_fleet
from robid.pipeline.graph import Run
from robid.report.numbers import significant
from robid.report.section import Cell, Section, Table
from robid.studies.fleet import logs
from robid.studies.page import Asked, PartFound, figure, table
from robid.studies.settings.study import KINDS, FleetSpeed, FleetStudy
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


def faults_section(
    robots: Sequence[logs.FleetRobot], values: Mapping[str, Any], figures: Mapping[str, float]
) -> Section:
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


def said(fault: logs.Fault) -> str:
    """Says what is wrong with a robot or its log."""
    joint = f"joint {fault.joint + 1}"
    channel = f"{fault.channel} of {joint}"
    return {
        "spring": f"transmission of {joint} softened",
        "sign": f"sign of the {channel}",
        "dead": f"{channel} dead, {fault.variant}",
        "gap": f"{fault.samples} samples lost",
        "payload": "another payload mounted",
        "file": f"file {fault.variant}",
    }[fault.kind]


WHOLE_NAME, FOLDER = "whole", "reprocessed"
_FOUND, _ACCUSED = 28 / 30, 4 / 970
_GROWTH = Asked(upper=1.1)
_SETTLED = 10


def _whole_tasks(run: Run, _study: FleetStudy, earlier: Mapping[str, Results]) -> list[Task]:
    # One task: all rows, of which a stopped study keeps what is done.
    path, template = logs.manifest_path(run), logs.template_path(run)
    logs.write_manifest(path, logs.fleet_robots(run), logs.stated_payload(run))
    fleet = load_fleet(path, template)
    decides = {
        "rows": [[planned.row.id, planned.settings_hash] for planned in fleet.rows],
        "logs": logs.hashes_of(earlier[logs.NAME]),
        "formats": FORMATS,
    }
    return [Task(WHOLE_NAME, decides, (path, template, run.path(FOLDER)))]


def reprocess_whole(manifest: Path, template: Path, folder: Path) -> Content:
    """Reprocesses all rows on one worker, and watches its memory."""
    memory: list[float] = []
    fleet = load_fleet(manifest, template)

    def open_map(*, one: bool) -> AbstractContextManager[Map]:
        del one
        return watched_worker(memory)

    with locked(folder / FOLDER_LOCK, "robid study"):
        batch = run_fleet(fleet, folder, Options(pages="none"), open_map, Told(), lambda *_: None)
    rows, off = list(enumerate(batch.ledgers)), batch.comparison.off
    found = (
        ("failed", [one.status == "failed" for _, one in rows], "1", "row", "Whether the row failed"),
        ("off", [row in off for row, _ in rows], "1", "row", "Whether it is off its fleet"),
        ("told", [_told(batch, row) for row, _ in rows], "1", "row", "What is said of it"),
        ("memory", memory, "MiB", "done", "Memory of the worker after each row"),
        ("seconds", [one.seconds for _, one in rows], "s", "row", "Time of each"),
    )
    return Content({name: Dataset(np.array(values), unit, (axis,), what) for name, values, unit, axis, what in found})


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
    [found], robots = results, logs.fleet_robots(run)
    values = values_of(found)
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
            f" without {FOLDER}/ and tasks/{WHOLE_NAME}/ in the run folder it watches all."
        )
    sections = [faults_section(robots, values, figures)]
    if len(memory) > _SETTLED:
        axes = "Row", "Resident memory [MiB]"
        shown = figure("Memory after each row", axes, None, {"worker": memory}, log_x=False, log_y=False)
        lead = f"Of the one worker process that reprocessed the fleet; growth is counted from the {_SETTLED}th row on."
        sections.append(Section("Memory", lead, (shown,)))
    return PartFound(figures, asked, tuple(sections), tuple(warnings))


WHOLE = Part(WHOLE_NAME, _conclude_whole, _whole_tasks, reprocess_whole, field="")


SPEED_NAME = "speed"
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
    sound = [robot for robot in logs.fleet_robots(run) if robot.fault is None][: speed.rows]
    path, template = run.path("manifest_of_speed.csv"), logs.template_path(run)
    logs.write_manifest(path, sound, logs.stated_payload(run))
    decides = {
        "rows": [[planned.row.id, planned.settings_hash] for planned in load_fleet(path, template).rows],
        "logs": canonical_hash(logs.hashes_of(earlier[logs.NAME])),
        "ways": [list(way) for way in ways(core_count())],
        "repeats": speed.repeats,
        "formats": FORMATS,
    }
    timing = Timing(path, template, run.path(SPEED_NAME), ways(core_count()), speed.repeats, canonical_hash(decides))
    return [Task(SPEED_NAME, decides, (timing,))]


def time_all(timing: Timing) -> Content:
    """Times every backend in turn; runs that a stopped study has timed are not timed again."""
    rates = np.array([[_rate(timing, repeat, way) for way in timing.ways] for repeat in range(timing.repeats)])
    shutil.rmtree(timing.folder, ignore_errors=True)
    backend, workers = (Dataset(np.array(each), "1", ("way",)) for each in zip(*timing.ways, strict=True))
    rate = Dataset(rates, "1/s", ("repeat", "way"), "Rows a second")
    return Content({"rate": rate, "backend": backend, "workers": workers})


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


SPEED = Part(SPEED_NAME, _conclude_speed, _speed_tasks, time_all)


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
    fleet = load_fleet(logs.manifest_path(run), logs.template_path(run))
    rows = run.path(FOLDER) / "rows"
    sound = next(index for index, robot in enumerate(logs.fleet_robots(run)) if robot.fault is None)
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
    if (ledger := read_ledger(folder)) is None:
        raise DataError("D219 the row has no ledger", where=str(folder), remedy="run the study again")
    return ledger.outline


def _conclude_scheduler(_run: Run, _count: int, results: Results) -> PartFound:
    [found] = results
    values = {name: float(dataset.values) for name, dataset in found.datasets.items()}
    values["rows_per_second"] = values["rows"] / values["seconds"]
    meanings = {**_MEANINGS, "rows_per_second": "Rows a second"}
    shown = table((("", lambda name: meanings[name]), ("Value", lambda name: significant(values[name]))), values)
    lead = "A local Dask cluster on all cores, fed with rows like those of the fleet, but without work."
    figures = {f"fleet.scheduled.{name}": value for name, value in values.items() if np.isfinite(value)}
    return PartFound(figures, {}, (Section("Very many rows", lead, (shown,)),))


SCHEDULER = Part("scheduler", _conclude_scheduler, _scheduler_tasks, feed, field="scheduled")
