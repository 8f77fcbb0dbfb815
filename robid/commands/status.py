"""Saying what is fresh, stale or missing."""

from __future__ import annotations

from robid.commands.output import print_json
from robid.commands.shared import doubts, graded
from robid.pipeline import Run, asked_for, examine, grade_of
from robid.stages.terminal import make_console, status_table


def show_status(run: Run, *, as_json: bool) -> int:
    """Prints the state of every output; returns the exit code."""
    states = examine(run, asked_for(run.loaded))
    if as_json:
        nodes = [
            {"stage": node.stage.name, "for": node.owner, "output": node.output}
            | {"status": state.status, "why": state.why, "problem": state.problem}
            | graded(grade_of(run, node) if state.status == "fresh" else None)
            for node, state in states.items()
        ]
        print_json({"run_dir": str(run.folder), "nodes": nodes})
        return 0
    rows = [
        (node.output, state.status, state.why or state.problem or doubts(grade_of(run, node)).partition(":")[0])
        if state.status == "fresh"
        else (node.output, state.status, state.why or state.problem)
        for node, state in states.items()
    ]
    make_console(stderr=False).print(status_table(rows))
    return 0
