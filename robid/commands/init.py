"""Making a folder with the files of a first experiment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from robid.arrays import Meaning
from robid.commands.output import Answer, print_json
from robid.errors import SettingsError
from robid.later import later
from robid.models.known import load_experiment
from robid.pipeline.terminal import Shell, make_console
from robid.scaffold.examples import EXAMPLES, example_files
from robid.scaffold.folders import check_folder, write_folder

with later(__name__):
    from robid.commands.inspect_log import pather
    from robid.logs.inspection.findings import inspect_log
from robid.scaffold.foreign import Log, begin


@dataclass(frozen=True)
class InitAnswer(Answer, type="init"):
    """What was begun."""

    folder: Annotated[str, Meaning("The folder.")]
    files: Annotated[tuple[str, ...], Meaning("What was written into it.")]
    steps: Annotated[tuple[str, ...], Meaning("What is to be done by hand, in order.")]
    next: Annotated[tuple[str, ...], Meaning("The commands that follow.")]


def start(folder: Path, example: str | None, model: Path | None, log: Path | None, *, as_json: bool) -> int:
    """Writes an example, or the files of a robot with a rigid model, into a new folder; returns the exit code."""
    if log is not None and model is None:
        remedy = f"add `--model`, or `robid inspect {log} --propose FILE.yaml` for an experiment without a robot"
        raise SettingsError("S559 a log alone does not say which robot it is of", where=f"--log {log}", remedy=remedy)
    if example is not None and model is not None:
        what = "S557 an example has a robot of its own"
        raise SettingsError(what, where=f"--model {model}", remedy="leave out `--example` or `--model`")
    if model is not None:
        return _start_from_model(folder, model, log, as_json=as_json)
    if example is None:
        what = "S555 says nothing of what to begin with"
        remedy = f"add `--example {'|'.join(EXAMPLES)}`, or `--model` with a URDF or MJCF of your robot"
        raise SettingsError(what, where=f"robid init {folder}", remedy=remedy)
    check_folder(folder)
    files = example_files(example, folder.name)
    write_folder(folder, files)
    _tell(folder, list(files), [], as_json=as_json)
    return 0


def _start_from_model(folder: Path, model: Path, log: Path | None, *, as_json: bool) -> int:
    check_folder(folder)
    read = None
    if log is not None:
        path = pather(folder / f"{folder.name}.yaml")
        read = Log(log, inspect_log([log]), path)
    begun = begin(folder.name, model, load_experiment, read)
    write_folder(folder, begun.files)
    _tell(folder, list(begun.files), begun.steps, as_json=as_json)
    return 0


def _tell(folder: Path, files: Sequence[str], steps: Sequence[str], *, as_json: bool) -> None:
    """Says what was written, what is to be done by hand, in order, and the commands that follow."""
    experiment = (folder / f"{folder.name}.yaml").as_posix()
    commands = [f"robid status {experiment}", f"robid run {experiment}"]
    if as_json:
        print_json(InitAnswer(str(folder), tuple(files), tuple(steps), tuple(commands)))
        return
    shell = Shell(make_console(stderr=False), make_console(stderr=True), quiet=False)
    shell.say(f"{folder}: {', '.join(files)}")
    if steps:
        shell.say("to be done by hand, in this order:")
    for number, step in enumerate(steps, 1):
        shell.say(f"  {number}. {step}")
    shell.say("next:")
    for command in commands:
        shell.say(f"  {command}")
