"""Running everything that is not fresh."""

from __future__ import annotations

import dataclasses

from robid.artifacts.lock import FOLDER_LOCK, locked
from robid.commands.output import print_json
from robid.commands.shared import PROBLEM, graded, make_shell, tell
from robid.pipeline.chain import CHAIN
from robid.pipeline.graph import Run, run_all
from robid.pipeline.report_content import gather


def run_experiment(run: Run, *, strict: bool, as_json: bool) -> int:
    """Runs an experiment and prints what it found; returns the exit code."""
    shell = make_shell(run, as_json=as_json)
    with locked(run.path(FOLDER_LOCK), f"robid run {run.loaded.path}"):
        results = run_all(run, lambda node: shell.progress(node.output), lambda result: tell(shell, result))
    present = [path for result in results if result.outcome != "skipped" for path in result.node.plan.outputs]
    gathered = gather(CHAIN, run.loaded, run.folder, present)
    report = str(run.path("report.html"))
    if as_json:
        rows = {fit.headline.name: [dataclasses.asdict(row) for row in fit.parameters] for fit in gathered.fits}
        nodes = [
            {"output": result.node.output, "outcome": result.outcome, "text": result.text, "problem": result.problem}
            | graded(result.grade)
            for result in results
        ]
        verdict = dataclasses.asdict(gathered.content.verdict)
        print_json({"nodes": nodes, "parameters": rows, "verdict": verdict, "report": report})
        return PROBLEM if any(result.fails(strict=strict) for result in results) else 0
    for fit in gathered.fits:
        if len(gathered.fits) > 1:
            shell.say(f"\nfit {fit.headline.name}")
        for table in fit.terminal:
            shell.out.print(table)
        if fit.headline.advice:
            shell.say(f"advice: {fit.headline.advice}")
    for line in gathered.measured:
        shell.say(line)
    shell.say(f"\n{gathered.content.verdict.text}")
    shell.say(f"report: {report}")
    return PROBLEM if any(result.fails(strict=strict) for result in results) else 0
