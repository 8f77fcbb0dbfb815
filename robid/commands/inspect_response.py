"""Describing a file of frequency responses: on the terminal, as JSON, and as an experiment file to go on with."""

from __future__ import annotations

import os
from pathlib import Path

from robid.commands.inspect import LogInspection
from robid.commands.inspect_log import check_targets, write_new
from robid.commands.output import print_json
from robid.commands.response_answer import ResponseAnswer
from robid.errors import SettingsError
from robid.logs.responses.proposing import Recognised, proposal, recognise
from robid.pipeline.terminal import Shell, make_console


def found_response(files: list[Path], options: LogInspection) -> Recognised | None:
    """Recognises frequency responses in a single file that nothing is said of; None of logs."""
    if len(files) != 1 or options.format or options.sampling_period_s or options.dialect or not files[0].is_file():
        return None
    return recognise(files[0])


def describe_response(found: Recognised, options: LogInspection, *, as_json: bool) -> int:
    """Prints what the responses are and how to read them, and writes the proposal where asked.

    Raises:
        ArtifactError: If another proposal is there already.
        SettingsError: If a page is asked for, or the proposal's folder does not exist.
    """
    if options.page is not None:
        what, remedy = "S608 A page is drawn of logs, and this is a file of responses.", "leave `--output` out"
        raise SettingsError(what, where=str(found.file), remedy=f"{remedy}; `robid run` of the proposal draws a page")
    check_targets([found.file], options)
    target = options.experiment
    text = proposal(found, _relative(found.file, target))
    if target is not None:
        write_new(target, text)
    if as_json:
        print_json(_answer(found, text))
        return 0
    shell = Shell(make_console(stderr=False), make_console(stderr=True), quiet=False)
    for line in _lines(found):
        shell.say(line)
    shell.say(f"{target}  made" if target is not None else f"\n{text}")
    return 0


def _relative(file: Path, target: Path | None) -> str:
    """The file's path from the folder of the experiment file."""
    return os.path.relpath(file, target.parent if target is not None else Path())


def _error(found: Recognised) -> str:
    return "deviation" if found.deviation else "coherence" if found.coherence else "neighbours"


_TOLD = {
    "deviation": "with deviations",
    "coherence": "with coherence: state `averages`",
    "neighbours": "without coherence or deviations: its error is taken from neighbouring lines",
}


def _lines(found: Recognised) -> list[str]:
    size = f"{len(found.outputs)} x {len(found.inputs)} frequency response"
    of = f" of {found.configurations} configurations" if found.configurations > 1 else ""
    return [
        f"{found.file}: {size}{of}, {found.lines} lines from {found.lowest_hz:.4g} to {found.highest_hz:.4g} Hz",
        f"outputs {', '.join(found.outputs)}; inputs {', '.join(found.inputs)}; {_TOLD[_error(found)]}",
    ]


def _answer(found: Recognised, text: str) -> ResponseAnswer:
    return ResponseAnswer(
        file=str(found.file),
        format=found.format,
        configurations=found.configurations,
        inputs=found.inputs,
        outputs=found.outputs,
        lines=found.lines,
        lowest_hz=found.lowest_hz,
        highest_hz=found.highest_hz,
        error=_error(found),
        sampling_period_s=found.sampling_period_s,
        proposal=text,
    )
