"""Making a folder with the files of a first experiment."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from robid.commands.output import print_json
from robid.errors import SettingsError
from robid.models.known import load_experiment
from robid.pipeline.terminal import Shell, make_console
from robid.scaffold.examples import EXAMPLES, example_files
from robid.scaffold.folders import check_folder, write_folder
from robid.scaffold.foreign import begin


def start(folder: Path, example: str | None, model: Path | None, *, as_json: bool) -> int:
    """Writes an example, or the files of a robot with a rigid model, into a new folder; returns the exit code."""
    if example is not None and model is not None:
        what = "S557 an example has a robot of its own"
        raise SettingsError(what, where=f"--model {model}", remedy="leave out `--example` or `--model`")
    if model is not None:
        return _start_from_model(folder, model, as_json=as_json)
    if example is None:
        what = "S555 says nothing of what to begin with"
        remedy = f"add `--example {'|'.join(EXAMPLES)}`, or `--model` with a URDF or MJCF of your robot"
        raise SettingsError(what, where=f"robid init {folder}", remedy=remedy)
    check_folder(folder)
    files = example_files(example, folder.name)
    write_folder(folder, files)
    _tell(folder, list(files), [], as_json=as_json)
    return 0


def _start_from_model(folder: Path, model: Path, *, as_json: bool) -> int:
    check_folder(folder)
    begun = begin(folder.name, model, load_experiment)
    write_folder(folder, begun.files)
    _tell(folder, list(begun.files), begun.steps, as_json=as_json)
    return 0


def _tell(folder: Path, files: Sequence[str], steps: Sequence[str], *, as_json: bool) -> None:
    """Says what was written, what is to be done by hand, in order, and the commands that follow."""
    experiment = (folder / f"{folder.name}.yaml").as_posix()
    commands = [f"robid status {experiment}", f"robid run {experiment}"]
    if as_json:
        print_json({"folder": str(folder), "files": list(files), "steps": list(steps), "next": commands})
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
