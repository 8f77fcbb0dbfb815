"""What a study is: tasks, each done once, in steps or in several parts; a stopped one goes on with what is left."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from robid.artifacts.artifact import Artifact, Attribute, Dataset, Provenance, canonical_hash, git_commit, utc_now
from robid.artifacts.kinds import TASK
from robid.artifacts.results import MODEL
from robid.artifacts.store import kind_of, read_artifact, write_artifact
from robid.backends.map import Map, Progress
from robid.errors import ArtifactError
from robid.pipeline.graph import Run
from robid.settings.load import LoadedExperiment
from robid.studies.experiments import Further, missing_log, paper_figures, run_of
from robid.studies.page import Conclusion, PartFound, concluded
from robid.versions import package_versions

TASKS = "tasks"  # Folder of the tasks in the run folder


@dataclass(frozen=True)
class Content:
    """What a task found."""

    datasets: Mapping[str, Dataset]  # Named arrays
    attributes: Mapping[str, Attribute] = field(default_factory=dict)  # Scalars and texts, where there are any


Function = Callable[..., Content]


@dataclass(frozen=True)
class Task:
    """One independent piece of a study."""

    name: str  # Name of its file in the folder of tasks
    decides: dict[str, Any]  # Everything that decides its result, as values that JSON knows
    arguments: tuple[Any, ...]  # What the study's function is given

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
    """Does the tasks that are not done yet, or all by `force`, and returns the results of all in their order.

    Their names differ, and a function of a module does each. Results lie in the folder, one file each; files of other
    tasks are removed once all are done.

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
    try:
        read_artifact(task.path(folder), TASK)
    except ArtifactError:
        task.path(folder).unlink(missing_ok=True)
        return False
    return True


def made_provenance(settings: dict[str, Any], started: str, inputs: dict[str, str] | None = None) -> Provenance:
    """Returns how a result of a study comes about that is finished now."""
    return Provenance(
        stage="study",
        settings=settings,
        settings_hash=canonical_hash(settings),
        inputs=inputs or {},
        versions=package_versions(),
        git_commit=git_commit(),
        started_utc=started,
        finished_utc=utc_now(),
    )


def _do(work: _Work) -> None:
    started = utc_now()
    found = work.function(*work.task.arguments)
    provenance = made_provenance(work.task.decides, started)
    write_artifact(work.path, Artifact(TASK, found.datasets, found.attributes, provenance), alone=False)


Earlier: TypeAlias = "tuple[Results, ...]"  # Results of the steps before

_Kind = TypeVar("_Kind")


@dataclass(frozen=True)
class Step:
    """Tasks of a study that can all be done once the steps before are done."""

    name: str  # Name of its folder below that of the tasks; a study's only step has none
    tasks: Callable[[Run, Earlier], list[Task]]
    function: Function  # Does one of them

    @property
    def folder(self) -> str:
        """Where its results lie in the run folder."""
        return f"{TASKS}/{self.name}" if self.name else TASKS


@dataclass(frozen=True)
class Procedure:
    """What a study needs, does and concludes."""

    needs: Callable[[LoadedExperiment], tuple[str, ...]]  # Outputs of the chain that its tasks read
    steps: tuple[Step, ...]  # Its tasks, once these are there
    conclude: Callable[[Run, Earlier], Conclusion]  # Turns the results of all steps into what the study found
    # Other experiments that it reads, each with outputs of its chain
    further: Callable[[Run], Further] = lambda _run: ()


def study_of(loaded: LoadedExperiment, kind: type[_Kind]) -> _Kind:
    """Returns the study of an experiment that has one of this kind."""
    if not isinstance(study := loaded.experiment.study, kind):
        raise TypeError("the study is of another kind")
    return study


@dataclass(frozen=True)
class Part:
    """A part of a study of several, left out where the file says nothing of it."""

    name: str  # Its name, and that of the folder of its tasks
    # Turns its case and the results of its tasks into what it found; None where there is nothing to say
    conclude: Callable[[Run, Any, Results], PartFound | None]
    # Its tasks, by its case and the results of the parts before it, by their name
    tasks: Callable[[Run, Any, Mapping[str, Results]], list[Task]] = lambda _run, _case, _earlier: []
    function: Function = lambda *_arguments: Content({})  # Does one of them
    # Other experiments that it reads, each with outputs of its chain
    further: Callable[[Run, Any], Further] = lambda _run, _case: ()
    # Field of the study's section that is its case; one of its own name when None, all of it when empty
    field: str | None = None

    def case_of(self, run: Run) -> Any:  # noqa: ANN401
        """Returns what the file says of it; nothing where it is left out."""
        study, name = run.loaded.experiment.study, self.name if self.field is None else self.field
        return getattr(study, name) if name else study


def recorded_part(
    name: str,
    title: str,
    fits: Callable[[Any], Sequence[str]],
    conclude: Callable[[Run, Any, Run, list[Artifact]], PartFound],
) -> Part:
    """Returns a part that shows fits to a recording, in an experiment of its own, and is left out without the logs.

    The title is the subject of a sentence; `conclude` says, by the case, the experiment's run and its models, what was
    found.
    """

    def outputs(case: Any) -> tuple[str, ...]:  # noqa: ANN401
        return tuple(f"fits/{fit}/model.h5" for fit in fits(case))

    def further(run: Run, case: Any) -> Further:  # noqa: ANN401
        own = run_of(run, case.experiment, name)
        return () if missing_log(own) else ((own, outputs(case)),)

    def found(run: Run, case: Any, _results: Results) -> PartFound:  # noqa: ANN401
        own = run_of(run, case.experiment, name)
        if lacking := missing_log(own):
            return PartFound({}, warnings=(f"{title} is left out: there is no {lacking}; set ROBID_DATA.",))
        return conclude(run, case, own, [read_artifact(own.path(output), MODEL) for output in outputs(case)])

    return Part(name, found, further=further)


def joined(
    parts: Sequence[Part], reached: str, prepare: Callable[[LoadedExperiment], object] = paper_figures
) -> Procedure:
    """Returns the procedure of a study of several parts that reads nothing of its own chain."""

    def needs(loaded: LoadedExperiment) -> tuple[str, ...]:
        prepare(loaded)
        return ()

    def further(run: Run) -> Further:
        return tuple(one for part in parts if (case := part.case_of(run)) for one in part.further(run, case))

    def conclude(run: Run, results: Earlier) -> Conclusion:
        each = (
            part.conclude(run, case, done)
            for part, done in zip(parts, results, strict=True)
            if (case := part.case_of(run))
        )
        return concluded([one for one in each if one is not None], reached)

    def step(index: int, part: Part) -> Step:
        def tasks(run: Run, earlier: Earlier) -> list[Task]:
            known = dict(zip([each.name for each in parts[:index]], earlier, strict=True))
            return part.tasks(run, case, known) if (case := part.case_of(run)) else []

        return Step(part.name, tasks, part.function)

    return Procedure(needs, tuple(step(*one) for one in enumerate(parts)), conclude, further)
