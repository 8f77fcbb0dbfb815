"""What a study is, and running one: its chain, its tasks, its figures and its page."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Literal

from robid.artifacts.artifact import Artifact, Provenance
from robid.artifacts.atomic import write_json
from robid.artifacts.provenance import canonical_hash, git_commit, package_versions, utc_now
from robid.artifacts.store import read_header
from robid.artifacts.task import TASK
from robid.backends.map import make_map
from robid.errors import ArtifactError, SettingsError
from robid.pipeline import Result, Run, run_all
from robid.report.content import ReportContent, StageRow
from robid.report.numbers import duration, significant
from robid.report.section import Section, Table
from robid.settings.load import LoadedExperiment
from robid.settings.slices import to_plain
from robid.settings.study import FrfStudy
from robid.stages.report import read_stamp, write_page
from robid.stages.stage import Progress, counted
from robid.studies import frf, frf_report, wernholt2008, wernholt2008_report
from robid.studies.conclusion import Conclusion
from robid.studies.tasks import Function, Task, run_tasks

REPORT, SUMMARY, TASKS = "report.html", "summary.json", "tasks"


@dataclass(frozen=True)
class Study:
    """A kind of study.

    Attributes:
        needs: Outputs of the chain that its tasks read.
        tasks: Its tasks, once these are there.
        function: Does one task.
        conclude: Turns the tasks' results, in their order, into what the study found.
    """

    needs: Callable[[LoadedExperiment], tuple[str, ...]]
    tasks: Callable[[Run], list[Task]]
    function: Function
    conclude: Callable[[Run, list[Artifact]], Conclusion]


STUDIES = {
    "frf": Study(frf.needs, frf.tasks, frf.estimate_chunk, frf_report.conclude),
    "wernholt2008": Study(wernholt2008.needs, wernholt2008.tasks, wernholt2008.fit_chunk, wernholt2008_report.conclude),
}


@dataclass(frozen=True)
class Outcome:
    """What became of a study: whether its page was written anew, and what it says."""

    outcome: Literal["made", "fresh"]
    conclusion: Conclusion


def run_study(
    run: Run,
    progress: Callable[[str], AbstractContextManager[Progress]],
    tell: Callable[[Result], None],
    *,
    force: bool = False,
) -> Outcome:
    """Runs a study: what is done stays, so that a stopped one goes on where it was.

    Args:
        run: The experiment with the study, and its run folder.
        progress: Shows how far something is.
        tell: Is told what became of each node of the chain.
        force: Whether to do the tasks again that are done.

    Raises:
        SettingsError: If the experiment file has no study.
        RobidError: What a stage or a task raised.
    """
    settings = run.loaded.experiment.study
    if settings is None:
        raise SettingsError(
            "the file has no `study`", where=str(run.loaded.path), remedy="`robid run` runs what it has"
        )
    study, folder, started = STUDIES[settings.kind], run.path(TASKS), utc_now()
    run_all(run, lambda node: progress(node.output), tell, study.needs(run.loaded))
    tasks = study.tasks(run)
    with make_map(run.backend, run.workers) as parallel_map, progress(TASKS) as shown:
        results = run_tasks(folder, study.function, tasks, parallel_map, shown, force=force)
    conclusion = study.conclude(run, results)
    provenance = _provenance(run, tasks, started)
    if _is_fresh(run, provenance):
        return Outcome("fresh", conclusion)
    seconds = sum(_seconds(result.provenance) for result in results)
    summary = {**conclusion.summary, "tasks.count": len(tasks), "tasks.seconds": seconds}
    write_json(run.path(SUMMARY), summary)
    write_page(run.path(REPORT), _content(run.loaded, conclusion, results), provenance)
    return Outcome("made", conclusion)


def _provenance(run: Run, tasks: list[Task], started: str) -> Provenance:
    settings: dict[str, Any] = {
        "name": run.loaded.experiment.name,
        "robot.name": run.loaded.robot.name,
        "study": to_plain(run.loaded.experiment.study),
        "tasks": {task.name: canonical_hash(task.decides) for task in tasks},
    }
    paths = {task.name: task.path(run.path(TASKS)) for task in tasks}
    return Provenance(
        stage="study",
        settings=settings,
        settings_hash=canonical_hash(settings),
        inputs={name: read_header(path, TASK).content_sha256 for name, path in paths.items()},
        versions=package_versions(),
        git_commit=git_commit(),
        started_utc=started,
        finished_utc=utc_now(),
    )


def _is_fresh(run: Run, now: Provenance) -> bool:
    if not (run.path(REPORT).exists() and run.path(SUMMARY).exists()):
        return False
    try:
        made = read_stamp(run.path(REPORT))
    except ArtifactError:
        return False
    return (made.stage, made.settings_hash, made.inputs) == (now.stage, now.settings_hash, now.inputs)


def _content(loaded: LoadedExperiment, conclusion: Conclusion, results: list[Artifact]) -> ReportContent:
    references = _against_references(loaded, conclusion.summary)
    seconds = sum(_seconds(result.provenance) for result in results)
    made = results[0].provenance
    row = StageRow(
        stage="study",
        artifact=f"{TASKS}/",
        settings_hash=made.settings_hash[:8],
        content_hash="",
        seconds=seconds,
        figures=f"{counted(len(results), 'task')}, {duration(seconds / len(results))} each",
    )
    return ReportContent(
        title=loaded.experiment.name,
        verdict=conclusion.verdict,
        robot=loaded.robot.name,
        sections=conclusion.sections + references,
        stages=(row,),
        warnings=conclusion.warnings,
    )


def _against_references(loaded: LoadedExperiment, summary: dict[str, float]) -> tuple[Section, ...]:
    """The table of reference figures, where the study names any."""
    study = loaded.experiment.study
    if not isinstance(study, FrfStudy) or not study.references:
        return ()
    rows = []
    for name, reference in study.references.items():
        ours = summary.get(name)
        ratio = None if ours is None or reference == 0 else ours / reference
        rows.append((name, significant(reference), significant(ours), significant(ratio)))
    table = Table(("Figure", "Reference", "Ours", "Ours over reference"), tuple(rows))
    return (Section("Against reference figures", "By their name in summary.json.", (table,)),)


def _seconds(made: Provenance) -> float:
    begun, ended = (datetime.fromisoformat(at) for at in (made.started_utc, made.finished_utc))
    return (ended - begun).total_seconds()
