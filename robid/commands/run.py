"""Running a single stage, and everything that is not fresh."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

from robid.arrays import Meaning
from robid.artifacts.atomic import FOLDER_LOCK, locked
from robid.commands.notices import notices
from robid.commands.output import Answer, print_json
from robid.commands.shared import (
    PROBLEM,
    Told,
    choose_node,
    findings,
    fresh_at,
    lock_of,
    make_shell,
    require_inputs,
    tell,
    told,
)
from robid.errors import ArtifactError
from robid.pipeline.chain import CHAIN
from robid.pipeline.freshness import check_outputs
from robid.pipeline.graph import Node, Run, asked_for, execute, grade_of, run_all
from robid.pipeline.report import gather
from robid.pipeline.stage import Stage
from robid.pipeline.terminal import Bar, Shell
from robid.report.design_numbers import DesignNumbers
from robid.report.numbers import duration
from robid.report.page import Verdict
from robid.report.parameters import ParameterRow


@dataclass(frozen=True)
class Done(Told):
    """What became of an output."""

    outcome: Annotated[
        Literal["made", "fresh", "skipped"],
        Meaning("`made`, `fresh` when there was nothing to do, or `skipped` when something it needs went wrong."),
    ]
    text: Annotated[str, Meaning("Its key figures, or why it was skipped.")]


@dataclass(frozen=True)
class StageAnswer(Done, Answer, type="stage"):
    """What a single stage has made."""

    design: Annotated[DesignNumbers | None, Meaning("The choice, of `design-configs` alone.")] = None


@dataclass(frozen=True)
class RunAnswer(Answer, type="run"):
    """What a run has made and found."""

    run_dir: Annotated[str, Meaning("The run folder.")]
    nodes: Annotated[tuple[Done, ...], Meaning("Its outputs, in the order of the chain.")]
    parameters: Annotated[dict[str, tuple[ParameterRow, ...]], Meaning("Parameters of each fit, by its name.")]
    verdict: Annotated[Verdict, Meaning("What it comes to.")]
    report: Annotated[str, Meaning("The page.")]


def run_stage(
    run: Run,
    stage: Stage,
    owner: str | None,
    named: list[Path],
    output: Path | None,
    *,
    force: bool,
    strict: bool,
    as_json: bool,
) -> int:
    """Runs a stage unless its output is fresh; returns the exit code."""
    node = choose_node(run, stage.name, owner)
    shell = make_shell(run, as_json=as_json)
    inputs = require_inputs(run, node, named, goes_on=not stage.takes_what_is_there)
    target = output or run.path(node.output)
    check_outputs(run.loaded, node.stage, node.plan, inputs, target)
    outcome: Literal["made", "fresh"] = "fresh"
    text = "nothing to do"
    if force or fresh_at(node, inputs, target).status != "fresh":
        outcome, text = "made", _make(run, node, inputs, target, shell, force=force)
    problem, grade = node.stage.problem(target), grade_of(run, node, target)
    if as_json:
        about = told(node, str(target), problem, grade)
        print_json(StageAnswer(**about, outcome=outcome, text=text, **node.stage.told(target)))
    else:
        shell.say(f"{target}  {outcome}: {text}")
        if outcome == "made":
            shell.show(node.stage.show(target, run.loaded))
    for warning in filter(None, (problem, findings(grade))):
        shell.warn(warning)
    return PROBLEM if problem or (grade is not None and grade.fails(strict=strict)) else 0


def _make(run: Run, node: Node, inputs: Mapping[str, Path], target: Path, shell: Shell, *, force: bool) -> str:
    """Makes an output and says what it holds and how long it took."""
    with locked(lock_of(run, target), run.command(node)):
        # Another process may have made it meanwhile.
        state = fresh_at(node, inputs, target)
        if state.status == "stale" and not force:
            raise state.unreadable or ArtifactError(
                f"A023 The output is there, but differs ({state.why}).",
                where=str(target),
                remedy="`--force` replaces it; what was made from it is stale then",
            )
        begun = time.monotonic()
        with (
            notices(run, shell),
            run.make_map() as parallel_map,
            shell.progress(node.output, workers=run.at_a_time) as progress,
        ):
            figures = execute(run, node, inputs, target, parallel_map, progress)
    return f"{figures} ({duration(time.monotonic() - begun)})"


def _places(run: Run) -> dict[str, str]:
    """Which of how many each output of a run is."""
    nodes = asked_for(run.loaded)
    return {node.output: f"{number} of {len(nodes)}" for number, node in enumerate(nodes, 1)}


def _progress(run: Run, shell: Shell, places: Mapping[str, str], node: Node) -> AbstractContextManager[Bar]:
    return shell.progress(node.output, places[node.output], run.at_a_time)


def run_experiment(run: Run, *, strict: bool, as_json: bool) -> int:
    """Runs an experiment and prints what it found; returns the exit code."""
    shell = make_shell(run, as_json=as_json)
    with locked(run.path(FOLDER_LOCK), f"robid run {run.loaded.path}"), notices(run, shell):
        results = run_all(run, partial(_progress, run, shell, _places(run)), lambda result: tell(shell, result))
    present = [path for result in results if result.outcome != "skipped" for path in result.node.plan.outputs]
    gathered = gather(CHAIN, run.loaded, run.folder, present)
    report = str(run.path("report.html"))
    if as_json:
        nodes = [
            Done(**told(one.node, one.node.output, one.problem, one.grade), outcome=one.outcome, text=one.text)
            for one in results
        ]
        rows = {fit.headline.name: fit.parameters for fit in gathered.fits}
        print_json(RunAnswer(str(run.folder), tuple(nodes), rows, gathered.content.verdict, report))
        return PROBLEM if any(result.fails(strict=strict) for result in results) else 0
    for fit in gathered.fits:
        if len(gathered.fits) > 1:
            shell.say(f"\nfit {fit.headline.name}")
        for table in fit.terminal:
            shell.show(table)
        if fit.headline.advice:
            shell.say(f"advice: {fit.headline.advice}")
    for line in gathered.measured:
        shell.say(line)
    shell.say(f"\n{gathered.content.verdict.text}")
    shell.say(f"report: {report}")
    return PROBLEM if any(result.fails(strict=strict) for result in results) else 0
