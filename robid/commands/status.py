"""Saying what is fresh, stale or missing."""

from __future__ import annotations

import shutil
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from robid.arrays import Meaning
from robid.commands.output import Answer, print_json
from robid.commands.shared import Told, findings, told
from robid.errors import SettingsError
from robid.pipeline.freshness import State
from robid.pipeline.graph import Node, Run, asked_for, examine, grade_of
from robid.pipeline.terminal import Shell, make_console, status_lines
from robid.settings.base import DATA_VARIABLE, data_path
from robid.settings.checks.configurations import other_units
from robid.settings.robot import MODEL_NOT_THERE, SET_DATA_FOLDER


@dataclass(frozen=True)
class NodeStatus(Told):
    """What is known of an output."""

    status: Annotated[Literal["fresh", "stale", "missing"], Meaning("Whether it is there and up to date.")]
    why: Annotated[str, Meaning("What has changed since it was made, or why it is missing; empty when fresh.")]


@dataclass(frozen=True)
class StatusAnswer(Answer, type="status"):
    """What is fresh, stale or missing."""

    run_dir: Annotated[str, Meaning("The run folder.")]
    nodes: Annotated[tuple[NodeStatus, ...], Meaning("The outputs of the chain, in its order.")]
    warnings: Annotated[tuple[str, ...], Meaning("Values of the files that look as if they were in another unit.")]


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
        nodes = [_told(run, node, state) for node, state in states.items()]
        print_json(StatusAnswer(str(run.folder), tuple(nodes), tuple(looks)))
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


def _told(run: Run, node: Node, state: State) -> NodeStatus:
    grade = grade_of(run, node) if state.status == "fresh" else None
    return NodeStatus(**told(node, node.output, state.problem, grade), status=state.status, why=state.why)
