"""Running the study of an experiment file."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Annotated, Literal

from robid.arrays import Meaning
from robid.artifacts.atomic import FOLDER_LOCK, locked, read_json
from robid.commands.notices import notices
from robid.commands.output import Answer, print_json
from robid.commands.shared import make_shell, tell
from robid.pipeline.graph import Run
from robid.pipeline.terminal import section_table
from robid.report.page import Verdict
from robid.studies.run import run_study


@dataclass(frozen=True)
class StudyAnswer(Answer, type="study"):
    """What a study has found."""

    outcome: Annotated[Literal["made", "fresh"], Meaning("Whether its page was written, or was so already.")]
    summary: Annotated[dict[str, float], Meaning("Content of `summary.json`: numbers by dotted name.")]
    verdict: Annotated[Verdict, Meaning("What it comes to.")]
    report: Annotated[str, Meaning("The page.")]


def study_experiment(run: Run, *, force: bool, as_json: bool) -> int:
    """Runs a study and prints what it found; returns the exit code."""
    shell = make_shell(run, as_json=as_json)
    with locked(run.path(FOLDER_LOCK), f"robid study {run.loaded.path}"), notices(run, shell):
        made = run_study(
            run, partial(shell.progress, workers=run.at_a_time), lambda result: tell(shell, result), force=force
        )
    report = str(run.path("report.html"))
    if as_json:
        summary = read_json(run.path("summary.json"))
        print_json(StudyAnswer(made.outcome, summary, made.conclusion.verdict, report))
        return 0
    for warning in made.conclusion.warnings:
        shell.warn(warning)
    for section in made.conclusion.sections:
        for table in section.tables:
            shell.say("")
            shell.show(section_table(table.title or section.title, table.columns, table.texts, "on the page"))
    shell.say(f"\n{made.conclusion.verdict.text}\n{report}  {made.outcome}")
    return 0
