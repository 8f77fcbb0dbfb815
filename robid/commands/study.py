"""Running the study of an experiment file."""

from __future__ import annotations

import dataclasses
from functools import partial

from robid.artifacts.atomic import FOLDER_LOCK, locked, read_json
from robid.commands.notices import tell_notices
from robid.commands.output import print_json
from robid.commands.shared import make_shell, tell
from robid.pipeline.graph import Run
from robid.pipeline.terminal import section_table
from robid.studies.run import run_study


def study_experiment(run: Run, *, force: bool, as_json: bool) -> int:
    """Runs a study and prints what it found; returns the exit code."""
    shell = make_shell(run, as_json=as_json)
    with locked(run.path(FOLDER_LOCK), f"robid study {run.loaded.path}"):
        tell_notices(run, shell)
        made = run_study(
            run, partial(shell.progress, workers=run.at_a_time), lambda result: tell(shell, result), force=force
        )
    report = str(run.path("report.html"))
    if as_json:
        summary = read_json(run.path("summary.json"))
        verdict = dataclasses.asdict(made.conclusion.verdict)
        print_json({"outcome": made.outcome, "summary": summary, "verdict": verdict, "report": report})
        return 0
    for warning in made.conclusion.warnings:
        shell.warn(warning)
    for section in made.conclusion.sections:
        for table in section.tables:
            shell.say("")
            shell.show(section_table(table.title or section.title, table.columns, table.texts, "on the page"))
    shell.say(f"\n{made.conclusion.verdict.text}\n{report}  {made.outcome}")
    return 0
