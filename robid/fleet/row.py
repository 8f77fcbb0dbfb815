"""One row of a manifest: its chain in a folder aside, which then takes the place of its own, and what it found."""

from __future__ import annotations

import ctypes
import errno
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from robid.artifacts.artifact import utc_now
from robid.artifacts.results import MODEL, VALIDATION, estimate_from_artifact
from robid.artifacts.store import read_artifact, read_header
from robid.errors import ArtifactError, DataError, RobidError, SettingsError
from robid.fleet.deadline import LateError, within
from robid.fleet.folders import aside, begin, check_own, keep_files, new_attempt, put_in_place, remove, writing
from robid.fleet.ledger import FileKey, Ledger, RowError, file_key, write_ledger
from robid.fleet.rows import chain_of, logs_of, settings_hash_of
from robid.interrupts import stop_if_interrupted
from robid.models.family import family_of
from robid.models.known import load_row
from robid.pipeline.graph import Node, Run, run_all
from robid.results.estimate import Estimate
from robid.robot.parameters import owner_of
from robid.settings.base import DATA_VARIABLE, data_path
from robid.settings.load import LoadedExperiment
from robid.settings.placeholders import Row
from robid.settings.problems import raise_problems
from robid.settings.yaml import Document, parse_yaml


def results_of(loaded: LoadedExperiment, folder: Path) -> list[dict[str, Any]]:
    """Reads the parameters of all fits of a row, as entries of columns of `robid.fleet.table.PARAMETER_COLUMNS`."""
    joints = {joint.name: joint.name for joint in loaded.robot.joints}
    joints |= {spring.name: spring.joint for spring in loaded.robot.all_springs if spring.joint is not None}
    found: list[dict[str, Any]] = []
    for fit in loaded.experiment.fits:
        path = folder / "fits" / fit / "model.h5"
        estimate = estimate_from_artifact(read_artifact(path, MODEL))
        digest = read_header(path).content_sha256
        for entry in [*_own(estimate), *_tied(estimate)]:
            owner = owner_of(entry["parameter"], entry["kind"])
            found.append({"fit": fit, **entry, "joint": joints.get(owner, ""), "model_sha256": digest})
    return found


def misfits_of(loaded: LoadedExperiment, folder: Path) -> dict[str, dict[str, float]]:
    """Reads how badly the model of each fit of a row describes data; see `Family.misfits`."""
    found = {}
    for fit in loaded.experiment.fits:
        path = folder / "fits" / fit / "validation.h5"
        validation = read_artifact(path, VALIDATION) if path.exists() else None
        told = family_of(loaded, fit).misfits(read_artifact(path.with_name("model.h5"), MODEL), validation)
        found[fit] = {name: float(value) for name, value in told.items() if np.isfinite(value) and value > 0}
    return found


def _own(estimate: Estimate) -> list[dict[str, Any]]:
    columns: dict[str, Any] = {
        "parameter": estimate.names,
        "kind": estimate.kinds,
        "unit": estimate.units,
        "nominal": estimate.nominal,
        "estimate": estimate.value,
        "standard_deviation": np.sqrt(np.diagonal(estimate.covariance)),
        "effective": estimate.effective_value,
        "effective_low": estimate.effective_lower,
        "effective_high": estimate.effective_upper,
        "physical": estimate.middle,
        "physical_low": estimate.lower,
        "physical_high": estimate.upper,
        "relative_standard_deviation": estimate.relative_std,
        "predicted_relative_standard_deviation": estimate.predicted_relative_std,
        "identifiable": estimate.identifiable,
        "identified": estimate.identified,
    }
    listed = {name: np.asarray(values).tolist() for name, values in columns.items() if values is not None}
    both = {"confidence": estimate.confidence, "tied_to": ""}
    return [dict(zip(listed, values, strict=True)) | both for values in zip(*listed.values(), strict=True)]


def _tied(estimate: Estimate) -> list[dict[str, Any]]:
    """Parameters that follow another one: of its kind and unit."""
    tied, at = estimate.tied, [estimate.names.index(leader) for leader in estimate.tied.to]
    return [
        {
            "parameter": name,
            "kind": estimate.kinds[of],
            "unit": estimate.units[of],
            "nominal": float(tied.nominal[index]),
            "estimate": float(tied.value[index]),
            "physical_low": float(tied.lower[index]),
            "physical_high": float(tied.upper[index]),
            "identifiable": bool(estimate.identifiable[of]),
            "identified": bool(estimate.identified[of]),
            "confidence": estimate.confidence,
            "tied_to": estimate.names[of],
        }
        for index, (name, of) in enumerate(zip(tied.names, at, strict=True))
    ]


_KINDS = {SettingsError: "settings", DataError: "data"}
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)
_TRY_AGAIN = "`--force` tries the row again"


@dataclass(frozen=True)
class RowTask:
    """A row to run."""

    row: Row
    template: Path  # the experiment file
    text: str  # its text when the rows were checked
    rows: Path  # folder of the rows' folders
    keep: bool  # whether records and responses stay
    timeout_s: float | None = None  # time that it may take [s]; any where it is None
    attempt: str = ""  # which attempt at the row it is: none of two writes into the other's folder

    @property
    def label(self) -> str:
        """What messages call it."""
        return f"row {self.row.id}"

    @property
    def folder(self) -> Path:
        """The row's folder."""
        return self.rows / self.row.id

    @property
    def work(self) -> Path:
        """Where this attempt makes it."""
        return aside(self.folder, self.attempt, "work")

    @property
    def page_work(self) -> Path:
        """Where this attempt makes its page."""
        return aside(self.folder, self.attempt, "page")

    def anew(self) -> RowTask:
        """Returns a new attempt."""
        return replace(self, attempt=new_attempt())


@dataclass
class Told:
    """Keeps what the stages of a row warn of."""

    warnings: list[str] = field(default_factory=list)

    def expect(self, total: int, unit: str, done: int = 0) -> None:
        """Leaves it to the progress over the rows."""

    def advance(self) -> None:
        """Leaves it to the progress over the rows."""

    def warn(self, text: str) -> None:
        """Keeps a warning."""
        self.warnings.append(text)

    @contextmanager
    def of(self, _: Node) -> Iterator[Told]:
        """Returns itself for every stage."""
        yield self


@dataclass(frozen=True)
class _Found:
    """What the chain of a row found; `problem` says that a fit has not converged."""

    problem: str = ""
    grades: dict[str, tuple[int, str]] = field(default_factory=dict)
    results: tuple[dict[str, Any], ...] = ()
    misfits: dict[str, dict[str, float]] = field(default_factory=dict)


def run_row(task: RowTask) -> Ledger:
    """Runs the chain of a row and puts its results in place; what is wrong with the row is in its ledger.

    Raises:
        ArtifactError: If the folder cannot be written, or another command took the row over; the row is as it was.
    """
    begun, task = time.monotonic(), task.anew()
    begin(task.work)
    told = Told()
    loaded: LoadedExperiment | None = None
    inputs: dict[str, FileKey] = {}
    found, error = _Found(), None

    def chain() -> _Found:
        nonlocal loaded, inputs
        loaded = load_task(task)
        inputs = _inputs(loaded)
        return _run_chain(loaded, task.work, told)

    try:
        found = within(task.timeout_s, chain)
        error = RowError("fit", "", found.problem, "look at its model.h5") if found.problem else None
    except ArtifactError:
        remove(task.work)
        raise
    except Exception as caught:  # noqa: BLE001  a row that runs into a defect of ours leaves the others alone
        error = _error_of(task, caught)
    if error is not None:
        stop_if_interrupted()
    ledger = _finish(task, loaded, inputs, found, told, error, begun)
    # Free memory goes back, where the C library keeps it otherwise.
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)
    return ledger


def _error_of(task: RowTask, caught: Exception) -> RowError:
    """Says why a row has failed; a disk that cannot be written is no matter of a row, and raised."""
    if isinstance(caught, LateError):
        return _late(task)
    if isinstance(caught, RobidError):
        return RowError(_KINDS.get(type(caught), "data"), caught.where, caught.what, caught.remedy)
    if isinstance(caught, OSError):
        if caught.errno in _FULL:
            with writing(task.work):
                raise caught
        told = f"cannot be read: {caught.strerror or caught}"
        return RowError("data", str(caught.filename or ""), told, _TRY_AGAIN)
    if isinstance(caught, MemoryError):
        return RowError("memory", "", "there is not enough memory for it", f"use fewer --workers; {_TRY_AGAIN}")
    first = (str(caught) or "no message").splitlines()[0]
    told = f"a defect of ours: {type(caught).__name__}: {first}"
    return RowError("defect", "", told, f"report it; {_TRY_AGAIN}")


def _late(task: RowTask) -> RowError:
    message = f"it did not end within {task.timeout_s:g} s, the limit of --row-timeout"
    return RowError("time", "", message, f"look at its log and settings, or allow more time; {_TRY_AGAIN}")


def fail_row(task: RowTask, *, late: bool = False) -> Ledger:
    """Puts a row in place that has killed its worker, alone there, as one that has failed, maybe by its time limit."""
    begun, task = time.monotonic(), task.anew()
    begin(task.work)
    loaded = load_task(task)
    message = "its worker process ended, most often because memory ran out"
    memory = RowError("memory", "", message, f"look at its log, or give it more memory; {_TRY_AGAIN}")
    error = _late(task) if late else memory
    return _finish(task, loaded, _inputs(loaded), _Found(), Told(), error, begun)


def load_task(task: RowTask) -> LoadedExperiment:
    """Returns the experiment of a row.

    Raises:
        SettingsError: If it has a problem.
    """
    loaded, problems = load_row(_template(task.template, task.text), task.row)
    raise_problems(problems)
    if loaded is None:
        message = "a row without a problem has an experiment"
        raise RuntimeError(message)
    return loaded


@lru_cache(maxsize=2)
def _template(path: Path, text: str) -> Document:
    return parse_yaml(path, text)


def _inputs(loaded: LoadedExperiment) -> dict[str, FileKey]:
    robot = {} if loaded.robot_path is None else {"robot": loaded.robot_path}
    return {name: file_key(path) for name, path in {**robot, **logs_of(chain_of(loaded))}.items()}


def _run_chain(loaded: LoadedExperiment, folder: Path, told: Told) -> _Found:
    outputs = [node.output for node in chain_of(loaded)]
    results = run_all(Run(loaded, folder, "serial", 1), told.of, lambda _: None, outputs)
    problem = next((result.problem for result in results if result.problem), "")
    grades = {result.node.owner: (result.grade.value, result.grade.sentence) for result in results if result.grade}
    if problem:
        return _Found(problem, grades)
    return _Found(problem, grades, tuple(results_of(loaded, folder)), misfits_of(loaded, folder))


def _finish(
    task: RowTask,
    loaded: LoadedExperiment | None,
    inputs: dict[str, FileKey],
    found: _Found,
    told: Told,
    error: RowError | None,
    begun: float,
) -> Ledger:
    """Leaves what is to stay, writes the ledger, and puts the folder in place, unless the row was taken over."""
    check_own(task.work)
    with writing(task.work):
        made = keep_files(task.work, all_files=task.keep)
    # What may change the result; a study and how it is computed do not.
    plain = {} if loaded is None else loaded.plain
    settings = {key: value for key, value in plain.items() if key not in ("execution", "study")}
    if error is not None:
        where, message = (_shortened(text, task) for text in (error.where, error.message))
        error = replace(error, where=where, message=message)
    ledger = Ledger(
        id=task.row.id,
        settings_hash="" if loaded is None else settings_hash_of(chain_of(loaded)),
        settings=settings,
        inputs=inputs,
        outputs={str(path.relative_to(task.work)): file_key(path) for path in made},
        status="done" if error is None else "failed",
        error=error,
        warnings=tuple(_shortened(text, task) for text in told.warnings),
        grades=found.grades,
        results=found.results,
        misfits=found.misfits,
        kept=task.keep,
        seconds=round(time.monotonic() - begun, 3),
        finished_utc=utc_now(),
    )
    write_ledger(task.work, ledger)
    check_own(task.work, ledger.outputs)
    put_in_place(task.work, task.folder)
    return ledger.outline


def _shortened(text: str, task: RowTask) -> str:
    """A message without the folders of this machine: the manifest's, the data's, the row's, the experiment file's."""
    data, template = data_path(DATA_VARIABLE, Path()), task.template
    folders: Mapping[str, str] = {
        **{f"{folder}{os.sep}": "" for folder in _spellings(template.parent) if folder.is_absolute()},
        **{f"{folder}{os.sep}": "" for folder in _spellings(task.row.folder)},
        **{f"{folder}{os.sep}": f"{DATA_VARIABLE}/" for folder in _spellings(data) if folder.is_absolute()},
        **{str(path): template.name for path in _spellings(template)},
        **{str(path): task.row.id for path in _spellings(task.work)},
    }
    # A folder within another one goes first.
    for long in sorted(folders, key=len, reverse=True):
        text = text.replace(long, folders[long])
    return text


def _spellings(path: Path) -> tuple[Path, Path, Path]:
    """A path as it is written, from the root on, and with links followed."""
    return path, path.absolute(), path.resolve()
