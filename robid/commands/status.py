"""Saying what is fresh, stale or missing."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from robid.commands.output import print_json
from robid.commands.shared import findings, graded
from robid.errors import SettingsError
from robid.pipeline.graph import Run, asked_for, examine, grade_of
from robid.pipeline.terminal import Shell, make_console, status_lines
from robid.settings.base import DATA_VARIABLE, data_path
from robid.settings.checks.configurations import other_units
from robid.settings.robot import MODEL_NOT_THERE, SET_DATA_FOLDER


def show_status(run: Run, *, as_json: bool) -> int:
    """Prints the state of every output; returns the exit code.

    Raises:
        SettingsError: If the robot's model could not be read, so that nothing is known of what is fresh.
    """
    loaded = run.loaded
    if loaded.robot.lacks_model:
        where = f"{loaded.robot_path}: model: {loaded.robot.model}"
        what = f"{MODEL_NOT_THERE}, as there is no folder {data_path(DATA_VARIABLE, Path())}"
        raise SettingsError(what, where=where, remedy=SET_DATA_FOLDER)
    states, looks = examine(run, asked_for(loaded)), other_units(loaded.experiment, loaded.robot)
    if as_json:
        nodes = [
            {"stage": node.stage.name, "for": node.owner, "output": node.output}
            | {"status": state.status, "why": state.why, "problem": state.problem}
            | graded(grade_of(run, node) if state.status == "fresh" else None)
            for node, state in states.items()
        ]
        print_json({"run_dir": str(run.folder), "nodes": nodes, "warnings": looks})
        return 0
    rows = [
        (node.output, state.status, state.why or state.problem or findings(grade_of(run, node)).partition(":")[0])
        if state.status == "fresh"
        else (node.output, state.status, state.why or state.problem)
        for node, state in states.items()
    ]
    if looks:
        shell = Shell(make_console(stderr=False), make_console(stderr=True), quiet=False)
        for text in looks:
            shell.warn(text)
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    print("\n".join(status_lines(rows, width)))  # noqa: T201
    return 0
