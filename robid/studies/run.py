"""Running a study: its chain, its tasks, its figures and its page."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any, Literal

from robid.artifacts.artifact import Provenance, canonical_hash, git_commit, package_versions, utc_now
from robid.artifacts.atomic import write_json
from robid.artifacts.kinds import TASK
from robid.artifacts.store import Header, read_header
from robid.backends.progress import Progress
from robid.errors import ArtifactError, SettingsError
from robid.pipeline import Result, Run, run_all
from robid.report.content import ReportContent
from robid.report.experiment import StageRow, run_section
from robid.report.numbers import duration, significant
from robid.report.section import Section, Table
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import plain_settings
from robid.stages.replacing import check_replaceable, settings_files
from robid.stages.report import write_page
from robid.stages.stage import counted
from robid.stages.stamp import read_stamp
from robid.studies.conclusion import Conclusion
from robid.studies.known import STUDIES
from robid.studies.settings.study import FrfStudy
from robid.studies.study import Earlier, Step
from robid.studies.tasks import run_tasks

REPORT, SUMMARY = "report.html", "summary.json"


@dataclass(frozen=True)
class StudyOutcome:
    """What became of a study: whether its page was written anew, and what it says."""

    outcome: Literal["made", "fresh"]
    conclusion: Conclusion


def run_study(
    run: Run,
    progress: Callable[[str], AbstractContextManager[Progress]],
    tell: Callable[[Result], None],
    *,
    force: bool = False,
) -> StudyOutcome:
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
    study, started = STUDIES[settings.kind].procedure(), utc_now()
    for name, kind in ((REPORT, "report"), (SUMMARY, "summary")):
        check_replaceable(run.path(name), kind, settings_files(run.loaded))
    further = study.further(run)
    for other, outputs in ((run, study.needs(run.loaded)), *further):
        run_all(other, lambda node: progress(node.output), tell, outputs)
    results: Earlier = ()
    with run.make_map() as parallel_map:
        for step in study.steps:
            tasks = step.tasks(run, results)
            with progress(step.folder) as shown:
                done = run_tasks(run.path(step.folder), step.function, tasks, parallel_map, shown, force=force)
            results = (*results, done)
    conclusion = study.conclude(run, results)
    headers = [[read_header(path, TASK) for path in done.paths] for done in results]
    rows = tuple(
        _row(step, [each.provenance for each in made]) for step, made in zip(study.steps, headers, strict=True)
    )
    hashes = {
        f"{step.name}/{path.stem}".lstrip("/"): header.content_sha256
        for step, done, made in zip(study.steps, results, headers, strict=True)
        for path, header in zip(done.paths, made, strict=True)
    }
    conclusion = replace(conclusion, warnings=(*conclusion.warnings, *_of_several_commits(headers)))
    provenance = _provenance(run, {**hashes, **_read_elsewhere(further)}, started)
    if _is_fresh(run, provenance):
        return StudyOutcome("fresh", conclusion)
    seconds = sum(_seconds(header.provenance) for made in headers for header in made)
    write_json(run.path(SUMMARY), {**conclusion.summary, "tasks.count": len(hashes), "tasks.seconds": seconds})
    write_page(run.path(REPORT), _content(run.loaded, conclusion, rows), provenance)
    return StudyOutcome("made", conclusion)


def _of_several_commits(headers: Iterable[Iterable[Header]]) -> tuple[str, ...]:
    """What to know of a study that went on after robid itself had changed: only settings decide what is done again."""
    commits = sorted({header.provenance.git_commit for made in headers for header in made})
    if len(commits) < 2:
        return ()
    listed = ", ".join(f"{commit[:8]}{commit[40:]}" or "none" for commit in commits)
    return (f"Results come from several commits of robid: {listed}. Where methods differ, `--force` makes all anew.",)


def _read_elsewhere(further: Iterable[tuple[Run, tuple[str, ...]]]) -> dict[str, str]:
    """Content hashes of the outputs of other experiments, which a page may show without a task."""
    return {
        f"{other.folder.name}/{output}": read_header(other.path(output)).content_sha256
        for other, outputs in further
        for output in outputs
    }


def _provenance(run: Run, hashes: dict[str, str], started: str) -> Provenance:
    """Content hashes are by the name of the task's file, which tells the settings that it was made with."""
    settings: dict[str, Any] = {
        "name": run.loaded.experiment.name,
        "robot.name": run.loaded.robot.name,
        "study": plain_settings(run.loaded.experiment.study),
        "tasks": sorted(hashes),
    }
    return Provenance(
        stage="study",
        settings=settings,
        settings_hash=canonical_hash(settings),
        inputs=hashes,
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


def _row(step: Step, made: list[Provenance]) -> StageRow:
    seconds = sum(_seconds(one) for one in made)
    return StageRow(
        stage="study",
        artifact=f"{step.folder}/",
        settings_hash=made[0].settings_hash[:8] if made else "",
        content_hash="",
        seconds=seconds,
        phrase=f"{counted(len(made), 'task')}, {duration(seconds / max(len(made), 1))} each",
    )


def _content(loaded: LoadedExperiment, conclusion: Conclusion, rows: tuple[StageRow, ...]) -> ReportContent:
    references = _against_references(loaded, conclusion.summary)
    return ReportContent(
        title=loaded.experiment.name,
        verdict=conclusion.verdict,
        robot=loaded.robot.name,
        sections=conclusion.sections + references + run_section(rows),
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
