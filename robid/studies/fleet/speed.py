"""The speed of `robid reprocess` on each backend, as a user would start it."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

import numpy as np

from robid.artifacts.artifact import Artifact, Dataset, canonical_hash
from robid.artifacts.atomic import read_json, write_json
from robid.errors import BackendError
from robid.fleet.ledger import FORMATS
from robid.fleet.rows import load_fleet
from robid.pipeline import Run
from robid.studies.fleet.logs import NAME as LOGS_NAME
from robid.studies.fleet.logs import hashes_of, stated_payload, write_manifest
from robid.studies.fleet.page import speed_section
from robid.studies.fleet.robots import fleet_robots, study_of, template_path
from robid.studies.part import Asked, Part, PartFound
from robid.studies.tasks import Content, Results, Task

NAME = "speed"
SERIAL = ("serial", 1)
_FINE = (0, 5)
_BARS = {"processes": 0.9, "dask": 0.85}
_TWO_WORKERS = Asked(lower=1.6)


@dataclass(frozen=True)
class Timing:
    """What is timed.

    Attributes:
        manifest: Manifest of sound robots.
        template: The experiment file.
        folder: Where runs that were timed are noted until all are.
        ways: Backends and numbers of workers, which take turns.
        repeats: How often.
        key: Hash of all that decides the results.
    """

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


def speed_tasks(run: Run, earlier: Mapping[str, Results]) -> list[Task]:
    """Returns the one task, so that nothing else runs meanwhile; none where the study leaves it out."""
    speed = study_of(run.loaded).speed
    if speed is None:
        return []
    sound = [robot for robot in fleet_robots(run) if robot.fault is None][: speed.rows]
    path, template = run.path("manifest_of_speed.csv"), template_path(run)
    write_manifest(path, sound, stated_payload(run))
    decides = {
        "rows": [[planned.row.id, planned.settings_hash] for planned in load_fleet(path, template).rows],
        "logs": canonical_hash(list(hashes_of(list(earlier[LOGS_NAME])))),
        "ways": [list(way) for way in ways(core_count())],
        "repeats": speed.repeats,
        "formats": FORMATS,
    }
    timing = Timing(path, template, run.path(NAME), ways(core_count()), speed.repeats, canonical_hash(decides))
    return [Task(NAME, decides, timing)]


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
    """Returns rows a second between the first and the last finished row.

    The first rows of all workers count as finished with the very first, which is rather too strict.

    Args:
        finished: When each row was finished, in order [s].
        workers: Number of workers.

    Raises:
        BackendError: If there are too few rows to tell.
    """
    if len(finished) <= workers:
        what = f"{len(finished)} rows are too few to time {workers} workers."
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
            what = f"`robid reprocess --backend {backend}` ended with code {process.returncode}: {last}"
            raise BackendError(what, where=str(timing.manifest), remedy="run it by hand and see")
    return finished[:-1]


def conclude_speed(run: Run, results: Sequence[Artifact]) -> PartFound | None:
    """Compares the backends."""
    speed = study_of(run.loaded).speed
    if speed is None:
        return None
    [found] = results
    values = {name: dataset.values for name, dataset in found.datasets.items()}
    timed = zip(values["backend"].tolist(), values["workers"].tolist(), strict=True)
    rates = {way: values["rate"][:, index].tolist() for index, way in enumerate(timed)}
    cores = next(count for name, count in rates if name == "processes")
    figures = efficiencies(rates, cores)
    asked = {f"fleet.efficiency_{name}": Asked(lower=bar) for name, bar in _BARS.items()}
    asked["fleet.two_workers"] = _TWO_WORKERS
    return PartFound(figures, asked, (speed_section(rates, SERIAL, speed.rows, cores),))


def efficiencies(rates: Mapping[tuple[str, int], Sequence[float]], cores: int) -> dict[str, float]:
    """Returns the throughput of each core over that of the serial backend, from medians over the runs.

    Args:
        rates: Rows a second of each run, by backend and number of workers.
        cores: Cores of the machine.
    """
    middle = {way: median(found) for way, found in rates.items()}
    figures = {f"fleet.efficiency_{name}": middle[name, cores] / cores / middle[SERIAL] for name in _BARS}
    return {
        **figures,
        "fleet.two_workers": middle["dask", 2] / middle["dask", 1],
        "fleet.serial_rows_per_second": middle[SERIAL],
        "fleet.cores": float(cores),
    }


SPEED = Part(NAME, conclude_speed, function=time_all, following=speed_tasks)
