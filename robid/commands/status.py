"""Saying what is fresh, stale or missing."""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from robid.arrays import Meaning
from robid.commands.output import Answer, print_json
from robid.commands.shared import Told, findings, told
from robid.errors import SettingsError
from robid.pipeline.freshness import State
from robid.pipeline.graph import Node, Run, asked_for, examine, grade_of, refuse_too_large
from robid.pipeline.terminal import Shell, make_console, status_lines
from robid.report.wrapping import wrap
from robid.settings.base import DATA_VARIABLE, data_path
from robid.settings.checks.configurations import other_units
from robid.settings.robot import MODEL_NOT_THERE, SET_DATA_FOLDER, assumed_names

_BETWEEN = "; "  # two causes
_FOLLOWS = re.compile(r"^input (\S+) will be made again$")
_MOST, _SEVERAL = 3, 3


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
    assumed: Annotated[tuple[str, ...], Meaning("Values of the robot file that are listed as `assumed`.")]


def show_status(run: Run, *, as_json: bool) -> int:
    """Prints the state of every output; returns the exit code.

    Raises:
        SettingsError: If the robot's model could not be read, so that nothing is known of what is fresh, or what is
            to be made needs more than this machine has.
    """
    loaded = run.loaded
    if loaded.robot.lacks_model:
        where = f"{loaded.robot_path}: model: {loaded.robot.model}"
        what = f"{MODEL_NOT_THERE}, as there is no folder {data_path(DATA_VARIABLE, Path())}"
        raise SettingsError(what, where=where, remedy=SET_DATA_FOLDER)
    states = examine(run, asked_for(loaded))
    refuse_too_large(run, [node for node, state in states.items() if state.status != "fresh"])
    looks = other_units(loaded.experiment, loaded.robot)
    if as_json:
        nodes = [_told(run, node, state) for node, state in states.items()]
        print_json(StatusAnswer(str(run.folder), tuple(nodes), tuple(looks), assumed_names(loaded.robot)))
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
    where = "" if run.folder.exists() else ", which is made in the folder in which robid is started"
    lines = [*status_lines(shortened(rows), width), f"run folder: {run.folder}{where}"]
    below = [*_first_cause(rows), *_still_assumed(assumed_names(loaded.robot), loaded.robot_path)]
    print("\n".join([*lines, *(wrap(line, width) for line in below)]))  # noqa: T201
    return 0


def shortened(rows: Sequence[tuple[str, str, str]]) -> list[tuple[str, str, str]]:
    """Says a cause once: what follows from an output above it says so, and a cause that was said is not repeated.

    Args:
        rows: Output, status and why of each, in the order of the chain.
    """
    said: set[str] = set()
    short = []
    for output, status, why in rows:
        reasons = why.split(_BETWEEN) if status == "stale" else [why]
        new = [_few(reason) for reason in reasons if reason not in said and not _FOLLOWS.match(reason)]
        follows = [found[1] for reason in reasons if (found := _FOLLOWS.match(reason))]
        known = "for the same reason" if not follows else f"follows from {follows[0]}"
        short.append((output, status, _BETWEEN.join(new) if new or status != "stale" else known))
        said.update(reasons)
    return short


def _few(reason: str) -> str:
    """A cause with no more than some of the settings that changed."""
    head, changed, names = reason.partition("settings changed: ")
    listed = names.split(", ")
    more = f" and {len(listed) - _MOST} more" if len(listed) > _MOST else ""
    return f"{head}{changed}{', '.join(listed[:_MOST])}{more}" if changed else reason


def _first_cause(rows: Sequence[tuple[str, str, str]]) -> list[str]:
    """How many outputs are stale, and the first cause, where there are several."""
    stale = [why for _, status, why in rows if status == "stale"]
    if len(stale) < _SEVERAL:
        return []
    return [f"{len(stale)} of {len(rows)} stale; first cause: {_few(stale[0].split(_BETWEEN)[0])}"]


def _still_assumed(names: Sequence[str], robot: Path | None) -> list[str]:
    """How many values of the robot file have no source, with the first."""
    if not names or robot is None:
        return []
    more = f" and {len(names) - _MOST} more" if len(names) > _MOST else ""
    return [f"still assumed in {robot.name}, as its lists `assumed` say: {', '.join(names[:_MOST])}{more}"]


def _told(run: Run, node: Node, state: State) -> NodeStatus:
    grade = grade_of(run, node) if state.status == "fresh" else None
    return NodeStatus(**told(node, node.output, state.problem, grade), status=state.status, why=state.why)
