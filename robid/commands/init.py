"""Making a folder with the files of a first experiment."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from robid.commands.output import print_json
from robid.errors import SettingsError
from robid.pipeline.terminal import Shell, make_console
from robid.scaffold.examples import EXAMPLES, example_files
from robid.scaffold.folders import check_folder, write_folder


def start_from_example(folder: Path, example: str | None, *, as_json: bool) -> int:
    """Writes an example into a new folder; returns the exit code."""
    if example is None:
        what = "S555 says nothing of what to begin with"
        remedy = f"add `--example {'|'.join(EXAMPLES)}`, or `--model` with a URDF or MJCF of your robot"
        raise SettingsError(what, where=f"robid init {folder}", remedy=remedy)
    check_folder(folder)
    files = example_files(example, folder.name)
    write_folder(folder, files)
    _tell(folder, list(files), [], as_json=as_json)
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
    for number, step in enumerate(steps, 1):
        shell.say(f"  {number}. {step}")
    shell.say("next:")
    for command in commands:
        shell.say(f"  {command}")
