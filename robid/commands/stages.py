"""The commands of the stages: each has the options that its stage knows, and no others."""

import inspect
from collections.abc import Callable
from typing import Annotated

import typer

from robid.commands.options import (
    AsJson,
    Backend,
    Debug,
    ExperimentFile,
    RunFolder,
    Scheduler,
    Strict,
    Workers,
    names_in,
)
from robid.commands.own_options import ForceOutput, Inputs, NextAfter, Output, Try
from robid.pipeline.stage import Stage


def stage_command(stage: Stage) -> Callable[..., int]:
    """Returns what runs a stage; its signature has the options that the stage knows."""
    owner_option = typer.Option(
        f"--{stage.owned_by}",
        metavar="NAME",
        help=f"Name of the {stage.owned_by}; may be left out when there is only one.",
        autocompletion=names_in(f"{stage.owned_by}s"),
    )

    def command(
        experiment: ExperimentFile,
        owner: Annotated[str | None, owner_option] = None,
        run_dir: RunFolder = None,
        inputs: Inputs = None,
        output: Output = None,
        force: ForceOutput = False,
        strict: Strict = False,
        tried: Try = None,
        after: NextAfter = None,
        as_json: AsJson = False,
        backend: Backend = None,
        workers: Workers = None,
        scheduler: Scheduler = None,
        _debug: Debug = False,
    ) -> int:
        from robid.commands.shared import open_run

        if tried:
            from robid.commands.fit_try import check_try, try_freeing

            check_try({"--input": inputs, "--strict": strict})
            opened = open_run(experiment, run_dir, backend, workers, scheduler)
            return try_freeing(opened, owner, tried, output, force=force, as_json=as_json)
        if after:
            from robid.commands.next_visit import check_next, propose_next

            check_next({"--input": inputs, "--output": output, "--force": force})
            return propose_next(
                open_run(experiment, run_dir, backend, workers, scheduler), owner, after, as_json=as_json
            )
        from robid.commands.run import run_stage

        run = open_run(experiment, run_dir, backend, workers, scheduler)
        return run_stage(run, stage, owner, inputs or [], output, force=force, strict=strict, as_json=as_json)

    whole = inspect.signature(command)
    kept = [option for name, option in whole.parameters.items() if name not in _foreign_to(stage)]
    command.__signature__ = whole.replace(parameters=kept)  # type: ignore[attr-defined]
    return command


def _foreign_to(stage: Stage) -> set[str]:
    """Options that a stage does not know: what is the whole experiment's has one owner, only fits are graded."""
    foreign = {"owner"} if stage.owned_by == "experiment" else set()
    foreign |= {"strict"} if stage.owned_by != "fit" else set()
    foreign |= {"after"} if stage.owned_by != "design" else set()
    return foreign | ({"tried"} if stage.name != "fit" else set())
