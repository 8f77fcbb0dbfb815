"""What the commands have in common: the run, the terminal, exit codes."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from robid.artifacts.lock import FOLDER_LOCK
from robid.errors import SettingsError, require_module
from robid.models.known import load_experiment
from robid.pipeline.graph import Result, Run, run_folder
from robid.pipeline.terminal import Shell, make_console
from robid.report.numbers import duration
from robid.settings.checks.configurations import other_units
from robid.settings.experiment import Execution
from robid.settings.load import LoadedExperiment

if TYPE_CHECKING:
    from robid.results.grade import Grade

PROBLEM = 5
_TRUST = 2


def open_run(
    path: Path,
    folder: Path | None,
    backend: Literal["serial", "processes", "dask"] | None,
    workers: int | None,
    scheduler: str | None = None,
    load: Callable[[Path], LoadedExperiment] = load_experiment,
) -> Run:
    """Loads an experiment; backend, workers and scheduler are its own where none are given.

    Args:
        path: The experiment file.
        folder: Run folder; one of its name where None.
        backend: What maps tasks.
        workers: Number of processes.
        scheduler: Address of a Dask scheduler.
        load: Loads and checks the file; the command of studies alone checks its study.

    Raises:
        SettingsError: If the file cannot be used, a scheduler is given to another backend, or the backend is not
            installed.
    """
    loaded = load(path)
    execution = loaded.experiment.execution
    return Run(
        loaded=loaded,
        folder=folder or run_folder(loaded),
        backend=choose_backend(execution, backend, scheduler),
        workers=workers or execution.workers or os.cpu_count() or 1,
        scheduler=scheduler or execution.scheduler,
    )


def choose_backend(
    execution: Execution, backend: Literal["serial", "processes", "dask"] | None, scheduler: str | None
) -> Literal["serial", "processes", "dask"]:
    """Returns the backend that is asked for, an experiment's own where none is.

    Raises:
        SettingsError: If it is not installed, or a scheduler is given to another one.
    """
    chosen = backend or execution.backend
    if chosen == "dask":
        require_module("distributed", "dask", "The backend dask")
    elif scheduler is not None:
        remedy = "add `--backend dask`"
        raise SettingsError(
            f"S015 the backend {chosen} has no scheduler", where=f"--scheduler {scheduler}", remedy=remedy
        )
    return chosen


def make_shell(run: Run, *, as_json: bool) -> Shell:
    """Returns where a command talks to, with the notes on the robot's model said."""
    quiet = as_json or run.loaded.experiment.execution.log_level == "warning"
    shell = Shell(make_console(stderr=False), make_console(stderr=True), quiet)
    for note in run.loaded.robot.model_notes:
        shell.note(run.loaded.robot.name, note)
    for text in other_units(run.loaded.experiment, run.loaded.robot):
        shell.warn(text)
    return shell


def graded(grade: Grade | None) -> dict[str, Any]:
    """What `--json` says of a grade."""
    return {} if grade is None else {"grade": grade.value, "grade_sentence": grade.sentence}


def doubts(grade: Grade | None) -> str:
    """What a grade below the best warns of."""
    return grade.sentence if grade is not None and grade.value < _TRUST else ""


def lock_of(run: Run, target: Path) -> Path:
    """Returns the lock of the run folder, or of a file elsewhere."""
    inside = target.resolve().is_relative_to(run.folder.resolve())
    return run.path(FOLDER_LOCK) if inside else target.with_name(target.name + FOLDER_LOCK)


def tell(shell: Shell, result: Result) -> None:
    """Says what became of a node."""
    seconds = f" ({duration(result.seconds)})" if result.outcome == "made" else ""
    colon = ": " if result.text else ""
    shell.note(result.node.output, f"{result.outcome}{colon}{result.text}{seconds}")
    for warning in filter(None, (result.problem, doubts(result.grade))):
        shell.warn(warning)
