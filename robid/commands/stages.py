"""The commands of the stages: each has the options that its stage knows, and no others."""

import inspect
from collections.abc import Callable
from pathlib import Path
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
from robid.pipeline.stage import Stage

_TRY = (
    "Refit from the minimum found with this in `free` too, and show both side by side; writes nothing unless"
    " --output says where. Can be repeated."
)

_NEXT = "Say which candidate to visit next after this fit, and what that would bring; writes nothing."


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
        inputs: Annotated[
            list[Path] | None,
            typer.Option(
                "--input", metavar="FILE", help="Read this artifact instead of the run folder's. Can be repeated."
            ),
        ] = None,
        output: Annotated[Path | None, typer.Option("--output", metavar="FILE", help="Write here instead.")] = None,
        force: Annotated[bool, typer.Option("--force", help="Replace an output that differs.")] = False,
        strict: Strict = False,
        tried: Annotated[list[str] | None, typer.Option("--try", metavar="NAME", help=_TRY)] = None,
        after: Annotated[
            str | None, typer.Option("--next", metavar="FIT", help=_NEXT, autocompletion=names_in("fits"))
        ] = None,
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
