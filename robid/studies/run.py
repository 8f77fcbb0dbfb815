"""Running a study: what each kind does, its chain, its tasks, its figures and its page."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import Any, Literal

from robid.artifacts.artifact import Provenance, canonical_hash, git_commit, utc_now
from robid.artifacts.atomic import write_json
from robid.artifacts.kinds import TASK
from robid.artifacts.store import Header, read_header
from robid.backends.map import Progress
from robid.errors import ArtifactError, SettingsError
from robid.pipeline.freshness import check_replaceable, read_stamp, settings_files
from robid.pipeline.graph import Result, Run, run_all
from robid.pipeline.report import write_page
from robid.pipeline.stage import counted
from robid.report.experiment import StageRow, run_section
from robid.report.numbers import duration, significant
from robid.report.page import ReportContent
from robid.report.section import Section, Table
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import plain_settings
from robid.studies.experiments import Further
from robid.studies.fleet.logs import LOGS, require_packages
from robid.studies.fleet.speed import SCHEDULER, SPEED
from robid.studies.fleet.whole import WHOLE
from robid.studies.frf import report as frf_report
from robid.studies.frf import study as frf
from robid.studies.janot2009.branch import BRANCH
from robid.studies.janot2009.haptic import HAPTIC
from robid.studies.janot2009.recorded import EMPS, KR300, TX40
from robid.studies.mistakes import cases, responses
from robid.studies.mistakes import report as mistakes_report
from robid.studies.mistakes.wrong_units import needed_by_units, read_individual, unit_tasks
from robid.studies.oliveira2019.arm import ARM, POSITION_LOOP
from robid.studies.oliveira2019.plants import PLANTS
from robid.studies.oliveira2019.seeds import COVERAGE_PART, RANDOM_PLANTS
from robid.studies.page import Conclusion
from robid.studies.settings.study import FrfStudy
from robid.studies.simulated import measure, measure_or_refuse
from robid.studies.study import Earlier, Procedure, Step, joined, run_tasks, seconds_of
from robid.studies.trust import linear
from robid.studies.trust import report as trust_report
from robid.studies.trust import responses as trust
from robid.studies.turk2018.moving import TRAVEL
from robid.studies.turk2018.rest import REST
from robid.studies.turk2018.synthetic import KNOWN_STRUCTURE
from robid.studies.wernholt2008 import report as wernholt_report
from robid.studies.wernholt2008 import study as wernholt
from robid.studies.zimmermann2023 import models as zimmermann_models
from robid.studies.zimmermann2023 import report as zimmermann_report
from robid.studies.zimmermann2023 import steps
from robid.versions import package_versions

PROCEDURES: Mapping[str, Procedure] = {
    "frf": Procedure(frf.needs, (Step("", frf.tasks, frf.estimate_chunk),), frf_report.conclude),
    "wernholt2008": Procedure(
        wernholt.needs,
        (
            Step("starts", wernholt.tasks, wernholt.fit_chunk),
            Step("individuals", wernholt.individual_tasks, wernholt.fit_individual),
        ),
        wernholt_report.conclude,
    ),
    "zimmermann2023": Procedure(
        zimmermann_models.needs,
        (
            Step("responses", zimmermann_models.response_tasks, measure),
            Step("models", zimmermann_models.model_tasks, zimmermann_models.fit_model),
            Step("steps", steps.step_tasks, steps.step),
            Step("sets", zimmermann_models.set_tasks, zimmermann_models.fit_model),
        ),
        zimmermann_report.conclude,
    ),
    "mistakes": Procedure(
        responses.needs,
        (
            Step("responses", responses.response_tasks, responses.measure_all),
            Step("models", cases.model_tasks, cases.fit_case),
            Step("cases", cases.case_tasks, cases.judge_case),
            Step("units", unit_tasks, read_individual),
        ),
        mistakes_report.conclude,
        lambda run: (*responses.further(run), *needed_by_units(run)),
    ),
    "janot2009": joined((HAPTIC, BRANCH, EMPS, TX40, KR300), "the verdict on least squares is right"),
    "oliveira2019": joined(
        (PLANTS, COVERAGE_PART, RANDOM_PLANTS, ARM, POSITION_LOOP), "commands explain positions as well as is promised"
    ),
    "turk2018": joined((KNOWN_STRUCTURE, REST, TRAVEL), "one sparse model knows the ball screw wherever its slide is"),
    "trust": Procedure(
        trust.needs,
        (
            Step("responses", trust.response_tasks, measure_or_refuse),
            Step("models", trust.model_tasks, trust.fit_individual),
            Step("linear", linear.linear_tasks, linear.fit_linear),
            Step("grades", trust.grade_tasks, trust.grade_individual),
        ),
        trust_report.conclude,
        trust.further,
    ),
    "fleet": joined(
        (LOGS, WHOLE, SPEED, SCHEDULER), "faults are found in a large fleet, and cores are used", require_packages
    ),
}


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
            "S343 the file has no `study`", where=str(run.loaded.path), remedy="`robid run` runs what it has"
        )
    study, started = PROCEDURES[settings.kind], utc_now()
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
    return _concluded(run, study, results, further, started)


def _concluded(run: Run, study: Procedure, results: Earlier, further: Further, started: str) -> StudyOutcome:
    """Concludes, and writes page and summary anew where they are not what the results say."""
    conclusion = study.conclude(run, results)
    headers = [[read_header(path, TASK) for path in done.paths] for done in results]
    conclusion = replace(conclusion, warnings=(*conclusion.warnings, *_of_several_commits(headers)))
    hashes = {
        f"{step.name}/{path.stem}".lstrip("/"): header.content_sha256
        for step, done, made in zip(study.steps, results, headers, strict=True)
        for path, header in zip(done.paths, made, strict=True)
    }
    # A page may show outputs of other experiments without a task.
    elsewhere = {
        f"{other.folder.name}/{output}": read_header(other.path(output)).content_sha256
        for other, outputs in further
        for output in outputs
    }
    provenance = _provenance(run, {**hashes, **elsewhere}, started)
    if _is_fresh(run, provenance):
        return StudyOutcome("fresh", conclusion)
    rows = tuple(_row(step, [one.provenance for one in made]) for step, made in zip(study.steps, headers, strict=True))
    seconds = sum(seconds_of(one.provenance) for made in headers for one in made)
    write_json(run.path(SUMMARY), {**conclusion.summary, "tasks.count": len(hashes), "tasks.seconds": seconds})
    content = ReportContent(
        title=run.loaded.experiment.name,
        verdict=conclusion.verdict,
        robot=run.loaded.robot.name,
        sections=conclusion.sections + _against_references(run.loaded, conclusion.summary) + run_section(rows),
        warnings=conclusion.warnings,
    )
    write_page(run.path(REPORT), content, provenance)
    return StudyOutcome("made", conclusion)


def _of_several_commits(headers: Iterable[Iterable[Header]]) -> tuple[str, ...]:
    """What to know of a study that went on after robid itself had changed: only settings decide what is done again."""
    commits = sorted({header.provenance.git_commit for made in headers for header in made})
    if len(commits) < 2:
        return ()
    listed = ", ".join(f"{commit[:8]}{commit[40:]}" or "none" for commit in commits)
    return (f"Results come from several commits of robid: {listed}. Where methods differ, `--force` makes all anew.",)


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
    seconds = sum(seconds_of(one) for one in made)
    return StageRow(
        stage="study",
        artifact=f"{step.folder}/",
        settings_hash=made[0].settings_hash[:8] if made else "",
        content_hash="",
        seconds=seconds,
        phrase=f"{counted(len(made), 'task')}, {duration(seconds / max(len(made), 1))} each",
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
