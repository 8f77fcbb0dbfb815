"""Running a study: what each kind does, its chain, its tasks, its figures and its page."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import Any, Literal

from robid.artifacts.artifact import Provenance, utc_now
from robid.artifacts.atomic import write_json
from robid.artifacts.kinds import TASK
from robid.artifacts.store import read_header
from robid.backends.map import Progress
from robid.errors import ArtifactError, SettingsError
from robid.pipeline.freshness import check_replaceable, read_stamp, settings_files
from robid.pipeline.graph import Result, Run, run_all
from robid.pipeline.report import write_page
from robid.pipeline.stage import counted
from robid.report.experiment import StageRow, run_section
from robid.report.numbers import duration, significant
from robid.report.page import ReportContent
from robid.report.section import Section
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import plain_settings
from robid.studies.encoders.report import GEARS
from robid.studies.experiments import Further
from robid.studies.fleet.logs import LOGS, require_packages
from robid.studies.fleet.reprocessed import SCHEDULER, SPEED, WHOLE
from robid.studies.frf import study as frf
from robid.studies.janot2009.branch import BRANCH
from robid.studies.janot2009.haptic import HAPTIC
from robid.studies.janot2009.recorded import EMPS, KR300, TX40
from robid.studies.mistakes import cases
from robid.studies.mistakes import report as mistakes_report
from robid.studies.mistakes.wrong_units import needed_by_units, read_individual, unit_tasks
from robid.studies.oliveira2019.arm import ARM, POSITION_LOOP
from robid.studies.oliveira2019.plants import PLANTS
from robid.studies.oliveira2019.seeds import COVERAGE_PART, RANDOM_PLANTS
from robid.studies.page import Conclusion, table
from robid.studies.responses.random_plants import RANDOM_RESPONSES
from robid.studies.rough import cutoffs, individuals
from robid.studies.rough import report as rough_report
from robid.studies.settings.rough import ROUNDS
from robid.studies.settings.study import FrfStudy
from robid.studies.simulated import measure, measure_or_refuse
from robid.studies.study import Earlier, Procedure, Step, joined, made_provenance, run_tasks, seconds_of
from robid.studies.trust import effects, linear
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

PROCEDURES: Mapping[str, Procedure] = {
    "frf": Procedure(frf.needs, (Step("", frf.tasks, frf.estimate_chunk),), frf.conclude),
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
        cases.needs,
        (
            Step("responses", cases.response_tasks, cases.measure_all),
            Step("models", cases.model_tasks, cases.fit_case),
            Step("cases", cases.case_tasks, cases.judge_case),
            Step("units", unit_tasks, read_individual),
        ),
        mistakes_report.conclude,
        lambda run: (*cases.further(run), *needed_by_units(run)),
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
            Step("effects", effects.effect_tasks, effects.tell_effect),
        ),
        trust_report.conclude,
        trust.further,
    ),
    "rough": Procedure(
        lambda _loaded: (),
        (
            *(Step(f"robots_{1 + at}", individuals.individual_tasks, individuals.identify) for at in range(1 + ROUNDS)),
            Step("cutoffs", cutoffs.cut_off_tasks, cutoffs.compare),
        ),
        rough_report.conclude,
        cutoffs.further,
    ),
    "responses": joined((RANDOM_RESPONSES,), "transfer functions come back from their responses", lambda _loaded: None),
    "encoders": joined((GEARS,), "two encoders tell what a gear is", lambda _loaded: None),
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
    """Runs a study: what is done stays, so that a stopped one goes on where it was, unless `force` does it again.

    It shows how far something is, and tells what became of each node of the chain.

    Raises:
        SettingsError: If the experiment file has no study.
        RobidError: What a stage or a task raised.
    """
    settings = run.loaded.experiment.study
    if settings is None:
        where, remedy = str(run.loaded.path), "`robid run` runs what it has"
        raise SettingsError("S343 the file has no `study`", where=where, remedy=remedy)
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
    conclusion, loaded = study.conclude(run, results), run.loaded
    headers = [[read_header(path, TASK) for path in done.paths] for done in results]
    made = [[header.provenance for header in some] for some in headers]
    conclusion = replace(conclusion, warnings=(*conclusion.warnings, *_of_several_commits(made)))
    # Content hashes are by the name of the task's file, which tells the settings that it was made with.
    hashes = {
        f"{step.name}/{path.stem}".lstrip("/"): header.content_sha256
        for step, done, some in zip(study.steps, results, headers, strict=True)
        for path, header in zip(done.paths, some, strict=True)
    }
    # A page may show outputs of other experiments without a task.
    elsewhere = {
        f"{other.folder.name}/{output}": read_header(other.path(output)).content_sha256
        for other, outputs in further
        for output in outputs
    }
    inputs = {**hashes, **elsewhere}
    settings: dict[str, Any] = {
        **{"name": loaded.experiment.name, "robot.name": loaded.robot.name},
        **{"study": plain_settings(loaded.experiment.study), "tasks": sorted(inputs)},
    }
    provenance = made_provenance(settings, started, inputs)
    if _made_before(run) == (provenance.stage, provenance.settings_hash, inputs):
        return StudyOutcome("fresh", conclusion)
    rows = tuple(_row(step, some) for step, some in zip(study.steps, made, strict=True))
    totals = {"tasks.count": len(hashes), "tasks.seconds": sum(row.seconds or 0.0 for row in rows)}
    write_json(run.path(SUMMARY), {**conclusion.summary, **totals})
    sections = conclusion.sections + _against_references(loaded, conclusion.summary) + run_section(rows)
    names, warnings = (loaded.experiment.name, conclusion.verdict, loaded.robot.name), conclusion.warnings
    write_page(run.path(REPORT), ReportContent(*names, warnings=warnings, sections=sections), provenance)
    return StudyOutcome("made", conclusion)


def _row(step: Step, made: Sequence[Provenance]) -> StageRow:
    seconds, settings = sum(map(seconds_of, made)), made[0].settings_hash[:8] if made else ""
    phrase = f"{counted(len(made), 'task')}, {duration(seconds / max(len(made), 1))} each"
    return StageRow("study", f"{step.folder}/", settings, "", seconds, phrase)


def _made_before(run: Run) -> tuple[str, str, dict[str, str]] | None:
    """What the page that is there was made of; None where there is no sound one, or no summary."""
    try:
        made = read_stamp(run.path(REPORT)) if run.path(REPORT).exists() and run.path(SUMMARY).exists() else None
    except ArtifactError:
        return None
    return None if made is None else (made.stage, made.settings_hash, made.inputs)


def _of_several_commits(made: Iterable[Iterable[Provenance]]) -> tuple[str, ...]:
    """What to know of a study that went on after robid itself had changed: only settings decide what is done again."""
    commits = sorted({one.git_commit for some in made for one in some})
    if len(commits) < 2:
        return ()
    listed = ", ".join(f"{commit[:8]}{commit[40:]}" or "none" for commit in commits)
    return (f"Results come from several commits of robid: {listed}. Where methods differ, `--force` makes all anew.",)


def _against_references(loaded: LoadedExperiment, summary: dict[str, float]) -> tuple[Section, ...]:
    study = loaded.experiment.study
    if not isinstance(study, FrfStudy) or not (known := study.references):
        return ()
    ratios = {name: summary[name] / known[name] for name in known if name in summary and known[name] != 0}
    columns = (
        ("Figure", lambda name: name),
        ("Reference", lambda name: significant(known[name])),
        ("Ours", lambda name: significant(summary.get(name))),
        ("Ours over reference", lambda name: significant(ratios.get(name))),
    )
    return (Section("Against reference figures", "By their name in summary.json.", (table(columns, known),)),)
