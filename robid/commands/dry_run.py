"""Saying what a run would make and what each stage needs; nothing is made or written."""

from __future__ import annotations

import shutil
import sys
from dataclasses import dataclass
from typing import Annotated, Literal

from robid.arrays import Meaning
from robid.commands.output import Answer, print_json
from robid.pipeline.estimates import Estimate, estimate, size_text, time_text
from robid.pipeline.freshness import State
from robid.pipeline.graph import Node, Run, asked_for, examine, refuse_too_large
from robid.pipeline.terminal import status_lines

_LITTLE_BYTES = 10e6
_HEAD = ("output", "status", "needs")


@dataclass(frozen=True)
class Need:
    """What an output needs while it is made."""

    stage: Annotated[str, Meaning("Command that makes it.")]
    name: Annotated[str, Meaning("Campaign, design, fit or experiment that it is for.")]
    output: Annotated[str, Meaning("Its main file, in `run_dir`.")]
    status: Annotated[
        Literal["fresh", "stale", "missing"], Meaning("Whether it is there and up to date; `fresh` is left alone.")
    ]
    memory_bytes: Annotated[float | None, Meaning("Memory of tasks that run at a time, about; null of small ones.")]
    disk_bytes: Annotated[float | None, Meaning("Room on the disk, about; null of small ones.")]
    seconds: Annotated[float | None, Meaning("Time that it takes, about [s]; null where it depends on the data.")]
    driver: Annotated[str, Meaning("Setting that has most part in these, with its number; empty of small ones.")]


@dataclass(frozen=True)
class RunDryRunAnswer(Answer, type="run-dry-run"):
    """What a run would make, and what it needs."""

    run_dir: Annotated[str, Meaning("The run folder.")]
    nodes: Annotated[tuple[Need, ...], Meaning("Its outputs, in the order of the chain.")]


def dry_run(run: Run, *, as_json: bool) -> int:
    """Prints what a run would make and what each output needs; returns the exit code.

    Raises:
        SettingsError: If one needs more than this machine has.
    """
    states = examine(run, asked_for(run.loaded))
    refuse_too_large(run, [node for node, state in states.items() if state.status != "fresh"])
    needs = [(node, state, _estimate(run, node, state)) for node, state in states.items()]
    if as_json:
        print_json(RunDryRunAnswer(str(run.folder), tuple(_need(*each) for each in needs)))
        return 0
    rows = [(node.output, state.status, _told(state, needed)) for node, state, needed in needs]
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    print("\n".join([*status_lines(rows, width, _HEAD), f"run folder: {run.folder}; nothing was made"]))  # noqa: T201
    return 0


def _estimate(run: Run, node: Node, state: State) -> Estimate | None:
    due = state.status != "fresh"
    return estimate(run.loaded, node.stage.name, node.owner, run.at_a_time) if due else None


def _told(state: State, needed: Estimate | None) -> str:
    if needed is None:
        return "nothing to do" if state.status == "fresh" else "little"
    time = f", ~{time_text(needed.seconds)}" if needed.seconds is not None else ""
    if max(needed.memory_bytes, needed.disk_bytes) < _LITTLE_BYTES:
        return f"little{time}"
    disk = f", {size_text(needed.disk_bytes)} on the disk" if needed.disk_bytes else ""
    return f"~{size_text(needed.memory_bytes)} of memory{disk}{time}; most by {needed.driver}"


def _need(node: Node, state: State, needed: Estimate | None) -> Need:
    about = (node.stage.name, node.owner, node.output, state.status)
    if needed is None:
        return Need(*about, None, None, None, "")
    return Need(*about, needed.memory_bytes, needed.disk_bytes, needed.seconds, needed.driver)
