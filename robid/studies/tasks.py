"""The tasks of a study: each is done once, and a stopped study goes on with those that are left."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

from robid.artifacts.artifact import Artifact, Attribute, Dataset, Provenance, canonical_hash, git_commit, utc_now
from robid.artifacts.kinds import TASK
from robid.artifacts.store import kind_of, read_artifact, write_artifact
from robid.backends.map import Map, Progress
from robid.errors import ArtifactError
from robid.versions import package_versions

TASKS = "tasks"
"""Folder of the tasks in the run folder."""


@dataclass(frozen=True)
class Content:
    """What a task found."""

    datasets: Mapping[str, Dataset]  # Named arrays
    attributes: Mapping[str, Attribute] = field(default_factory=dict)  # Scalars and texts, where there are any


Function = Callable[[Any], Content]


@dataclass(frozen=True)
class Task:
    """One independent piece of a study."""

    name: str  # Name of its file in the folder of tasks
    decides: dict[str, Any]  # Everything that decides its result, as values that JSON knows
    argument: Any  # What the study's function is given

    def path(self, folder: Path) -> Path:
        """Returns where its result lies; one that other settings gave lies elsewhere."""
        return folder / f"{self.name}.{canonical_hash(self.decides)[:16]}.h5"


@dataclass(frozen=True)
class Results:
    """The results of tasks in their order, each read when it is asked for."""

    paths: tuple[Path, ...]  # Where they lie

    @property
    def by_name(self) -> dict[str, Path]:
        """Where they lie, by the names of the tasks."""
        return {path.name.split(".")[0]: path for path in self.paths}

    def __len__(self) -> int:
        """Returns how many there are."""
        return len(self.paths)

    def __getitem__(self, index: int) -> Artifact:
        """Reads one."""
        return read_artifact(self.paths[index], TASK)

    def __iter__(self) -> Iterator[Artifact]:
        """Reads one after the other."""
        return (read_artifact(path, TASK) for path in self.paths)


def values_of(held: Artifact) -> dict[str, Any]:
    """Returns the arrays that a task kept, by name."""
    return {name: dataset.values for name, dataset in held.datasets.items()}


def seconds_of(made: Provenance) -> float:
    """Returns how long a task took [s]."""
    begun, ended = (datetime.fromisoformat(at) for at in (made.started_utc, made.finished_utc))
    return (ended - begun).total_seconds()


def in_chunks(first: int, count: int, size: int) -> list[range]:
    """Returns seeds, one after the other from the first on, in chunks of a size."""
    return [range(start, min(start + size, first + count)) for start in range(first, first + count, size)]


@dataclass(frozen=True)
class _Work:
    function: Function
    task: Task
    path: Path

    @property
    def label(self) -> str:
        """What messages call it."""
        return self.task.name


def run_tasks(
    folder: Path,
    function: Function,
    tasks: Sequence[Task],
    parallel_map: Map,
    progress: Progress,
    *,
    force: bool = False,
) -> Results:
    """Does the tasks that are not done yet, and returns the results of all in their order.

    Args:
        folder: Where the results lie, one file each; files of other tasks are removed once all are done.
        function: Does one task; a function of a module.
        tasks: The tasks, their names different.
        parallel_map: Runs them.
        progress: Is told how far it is.
        force: Whether to do again what is done.

    Raises:
        RobidError: What the first failing task raised; what is finished stays.
    """
    if force:
        for task in tasks:
            task.path(folder).unlink(missing_ok=True)
    todo = [task for task in tasks if not is_done(folder, task)]
    progress.expect(len(tasks), "tasks", len(tasks) - len(todo))
    work = [_Work(function, task, task.path(folder)) for task in todo]
    parallel_map(_do, work, lambda _index, _result: progress.advance())
    paths = tuple(task.path(folder) for task in tasks)
    for path in set(folder.glob("*.h5")).difference(paths):
        if kind_of(path) == TASK.name:
            path.unlink()
    return Results(paths)


def is_done(folder: Path, task: Task) -> bool:
    """Tells whether a task's result is there and sound; a damaged one is removed."""
    path = task.path(folder)
    if not path.exists():
        return False
    try:
        read_artifact(path, TASK)
    except ArtifactError:
        path.unlink()
        return False
    return True


def _do(work: _Work) -> None:
    started = utc_now()
    found = work.function(work.task.argument)
    provenance = Provenance(
        stage="study",
        settings=work.task.decides,
        settings_hash=canonical_hash(work.task.decides),
        versions=package_versions(),
        git_commit=git_commit(),
        started_utc=started,
        finished_utc=utc_now(),
    )
    write_artifact(work.path, Artifact(TASK, found.datasets, found.attributes, provenance), alone=False)
