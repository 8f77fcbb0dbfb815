"""Describing a log: on the terminal, as JSON, as a page, and as an experiment file to go on with."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rich.markup import escape
from rich.table import Table

from robid.artifacts.atomic import replacing
from robid.commands.inspect import LogInspection
from robid.commands.output import print_json
from robid.errors import ArtifactError, SettingsError
from robid.logs.formats.variables import FORMATS
from robid.logs.inspection.findings import Findings, inspect_log
from robid.logs.inspection.roles import Signal
from robid.logs.inspection.text import describe_period, describe_sampling, remarks, role_text, write_experiment
from robid.logs.period import format_lines
from robid.pipeline.terminal import Shell, make_console
from robid.report.numbers import significant
from robid.signals.log_options import Dialect

_MARK = "<!-- page of robid inspect -->"
_COLUMNS = ("variable", "taken for", "unit", "from", "to", "step", "remarks")
_NUMBERS = ("from", "to", "step")
_SHOWN = 20


def describe_log(paths: Sequence[Path], options: LogInspection, *, as_json: bool) -> int:
    """Prints what is in a log, draws it and proposes how to import it; returns the exit code."""
    _check_targets(paths, options)
    shell = Shell(make_console(stderr=False), make_console(stderr=True), quiet=as_json)
    found = inspect_log(
        paths,
        options.format,
        Dialect(**options.dialect),
        options.sampling_period_s,
        lambda step: shell.note("inspect", step),
    )
    name = (options.experiment or paths[0]).name.partition(".")[0]
    text = write_experiment(found, name, _pather(options.experiment), options.format, options.dialect)
    if options.experiment is not None:
        _write_new(options.experiment, text)
    if options.page is not None:
        from robid.commands.log_page import draw_log

        with replacing(options.page) as partial:
            partial.write_text(draw_log(found, text) + _MARK, encoding="utf-8")
    if as_json:
        print_json({**as_plain(found), "proposal": text})
    else:
        _print(shell, found, text, options)
    return 0


def _pather(experiment: Path | None) -> Callable[[Path], str]:
    """How the experiment file names a log: from its own folder, from the current one where it is not written."""
    folder = Path.cwd() if experiment is None else experiment.absolute().parent

    def path(file: Path) -> str:
        # Far apart, a whole path says more than a climb.
        short = os.path.relpath(file.absolute(), folder)
        return str(file.absolute()) if short.startswith("../../..") else Path(short).as_posix()

    return path


def _check_targets(paths: Sequence[Path], options: LogInspection) -> None:
    """Refuses outputs in the place of something else, and a sampling period that is none, before anything is read."""
    if options.sampling_period_s is not None and not options.sampling_period_s > 0:
        what = f"A020 --sampling-period {options.sampling_period_s:g} is no time between samples."
        raise SettingsError(what, remedy="state it in seconds, as in `--sampling-period 1e-3`")
    if options.page is not None and options.page.exists() and not _is_own(options.page):
        what = "A021 The output would take the place of a file that is no page of `robid inspect`."
        raise ArtifactError(what, where=str(options.page), remedy="name another file by `--output`")
    for target in filter(None, (options.page, options.experiment)):
        if not target.absolute().parent.is_dir():
            raise SettingsError(
                "S012 There is no such folder.", where=str(target.parent), remedy="make it, or name another"
            )
    if any(path.is_dir() for path in paths) and len(paths) > 1:
        raise SettingsError("S013 A bag is a log of its own.", where=str(paths[0]), remedy="inspect it alone")


def _is_own(page: Path) -> bool:
    return page.is_file() and page.read_bytes().endswith(_MARK.encode())


def _write_new(path: Path, text: str) -> None:
    """Writes an experiment file; one that is there is somebody's work."""
    if path.exists():
        if path.is_file() and path.read_text("utf-8", errors="replace") == text:
            return
        what = "A022 The experiment file is there, but differs from what would be written."
        raise ArtifactError(what, where=str(path), remedy="name another file by `--propose`, or move this one away")
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8")


def _print(shell: Shell, found: Findings, text: str, options: LogInspection) -> None:
    contents = found.contents
    shell.say(f"{contents.file}: {FORMATS[contents.format].title}")
    for line in (describe_sampling(found), describe_period(found), *contents.notes):
        shell.say(f"  {line}")
    shell.out.print(_table(found))
    others = [f"{one.key} ({len(one.values)} samples)" for one in found.others]
    numbers = [f"{name} = {value:.6g}" for name, value in contents.scalars.items()]
    reasons = [f"{name}: {why}" for name, why in contents.unreadable.items()]
    _say_some(shell, "of another length or topic", others)
    _say_some(shell, "further times", list(found.sampling.others))
    _say_some(shell, "single numbers", numbers)
    _say_some(shell, "texts", list(contents.texts))
    _say_some(shell, "not read", reasons)
    if options.experiment is not None:
        shell.say(f"proposal: {options.experiment}; check what it marks, then `robid run {options.experiment}`")
    else:
        shell.say("\nproposal, to paste into an experiment file (`--propose FILE.yaml` writes it):\n")
        shell.say(text)
    if options.page is not None:
        shell.say(f"page: {options.page}")


def _say_some(shell: Shell, what: str, items: list[str]) -> None:
    """Lists the first items, and how many more there are."""
    if items:
        more = f" and {len(items) - _SHOWN} more" if len(items) > _SHOWN else ""
        shell.say(f"{what}: {', '.join(items[:_SHOWN])}{more}")


def _table(found: Findings) -> Table:
    table = Table(box=None, pad_edge=False, header_style="dim")
    for name in _COLUMNS:
        table.add_column(name, justify="right" if name in _NUMBERS else "left", overflow="fold")
    for signal in found.signals:
        quality = signal.quality
        ends = significant(quality.lowest), significant(quality.highest)
        step = "" if quality.resolution is None else f"{quality.resolution:.4g}"
        unit = signal.column.unit or signal.hint.unit
        cells = (signal.name, role_text(signal), unit, *ends, step, "; ".join(remarks(found, signal)))
        table.add_row(*map(escape, cells))
    return table


def as_plain(found: Findings) -> dict[str, Any]:
    """Returns what was found as plain values."""
    sampling, shared = found.sampling, found.shared
    return {
        "file": str(found.contents.file),
        "format": found.contents.format,
        "samples": found.n_sample,
        "duration_s": None if sampling.step_s is None else found.duration_s,
        "sampling": dict(vars(sampling)),
        "signals": [_plain_signal(found, one) for one in found.signals],
        "others": {one.key: len(one.values) for one in found.others},
        "scalars": dict(found.contents.scalars),
        "texts": list(found.contents.texts),
        "unreadable": dict(found.contents.unreadable),
        "period": None
        if shared is None
        else {
            "samples": shared.samples,
            "std_samples": shared.std_samples,
            "periods": shared.held,
            "signals": list(shared.names),
            "transient": list(shared.transient),
            "lines": found.lines.tolist(),
            "lines_text": format_lines(found.lines),
        },
        "notes": list(found.contents.notes),
    }


def _plain_signal(found: Findings, signal: Signal) -> dict[str, Any]:
    measured = found.periods.get(signal.name)
    return {
        "name": signal.name,
        "unit": signal.column.unit,
        "role": signal.role or None,
        "by": signal.by or None,
        "commanded": signal.commanded,
        "joint": signal.hint.joint or None,
        "reasons": list(signal.reasons),
        "same_as": signal.twin or None,
        "period_samples": None if measured is None else measured.samples,
        **{
            key: value if value is None or math.isfinite(value) else None for key, value in vars(signal.quality).items()
        },
        "remarks": remarks(found, signal),
    }
