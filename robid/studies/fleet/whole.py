"""The whole fleet, reprocessed once by one worker: which faults are found, who is accused, how memory grows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robid.arrays import BoolArray
from robid.artifacts.artifact import Artifact, Dataset
from robid.artifacts.lock import FOLDER_LOCK, locked
from robid.backends.map import Map
from robid.fleet.ledger import FORMATS
from robid.fleet.row import Told
from robid.fleet.rows import load_fleet
from robid.fleet.run import Batch, Options, run_fleet
from robid.pipeline.graph import Run
from robid.studies.fleet.check import KINDS
from robid.studies.fleet.logs import NAME as LOGS_NAME
from robid.studies.fleet.logs import hashes_of, manifest_path, stated_payload, write_manifest
from robid.studies.fleet.memory import watched_worker
from robid.studies.fleet.page import faults_section, memory_section
from robid.studies.fleet.robots import fleet_robots, template_path
from robid.studies.part import Asked, Part, PartFound
from robid.studies.tasks import Content, Results, Task

NAME, FOLDER = "whole", "reprocessed"
_FOUND, _ACCUSED = 28 / 30, 4 / 970
_GROWTH = Asked(upper=1.1)
_SETTLED = 10


@dataclass(frozen=True)
class Whole:
    """What is reprocessed, and where."""

    manifest: Path
    template: Path
    folder: Path


def whole_tasks(run: Run, earlier: Mapping[str, Results]) -> list[Task]:
    """Returns the one task: all rows, of which a stopped study keeps what is done."""
    path, template = manifest_path(run), template_path(run)
    write_manifest(path, fleet_robots(run), stated_payload(run))
    fleet = load_fleet(path, template)
    decides = {
        "rows": [[planned.row.id, planned.settings_hash] for planned in fleet.rows],
        "logs": list(hashes_of(list(earlier[LOGS_NAME]))),
        "formats": FORMATS,
    }
    return [Task(NAME, decides, Whole(path, template, run.path(FOLDER)))]


def reprocess_whole(whole: Whole) -> Content:
    """Reprocesses all rows on one worker, and watches its memory."""
    memory: list[float] = []
    fleet = load_fleet(whole.manifest, whole.template)

    def open_map(*, one: bool) -> AbstractContextManager[Map]:
        del one
        return watched_worker(memory)

    with locked(whole.folder / FOLDER_LOCK, "robid study"):
        batch = run_fleet(fleet, whole.folder, Options(pages="none"), open_map, Told(), lambda *_: None)
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
    """Counts the faults that are found and the sound robots that are accused.

    Args:
        kinds: Kind of each row's fault (n_row,), empty of a sound one.
        failed (n_row,): Whether it failed.
        off (n_row,): Whether it is on the list of outliers.

    Returns:
        Numbers by name; a kind that was not planted has none.
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


def conclude_whole(run: Run, results: Sequence[Artifact]) -> PartFound:
    """Counts what was found, and says how the worker's memory grew."""
    [found] = results
    values = {name: dataset.values for name, dataset in found.datasets.items()}
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


WHOLE = Part(NAME, conclude_whole, function=reprocess_whole, following=whole_tasks)
