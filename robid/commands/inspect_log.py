"""Describing a log: on the terminal, as JSON, as a page, and as an experiment file to go on with."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from robid.artifacts.atomic import replacing
from robid.commands.inspect import LogInspection
from robid.commands.log_answer import log_answer
from robid.commands.output import print_json
from robid.errors import ArtifactError, SettingsError
from robid.logs.formats.variables import FORMATS
from robid.logs.inspection.excitation import cut_periods
from robid.logs.inspection.findings import Findings, from_end, inspect_log
from robid.logs.inspection.quality import spectra_of_all, spectra_of_periods, thin_out
from robid.logs.inspection.roles import Signal
from robid.logs.inspection.text import describe_period, describe_sampling, remarks, role_text, write_experiment
from robid.pipeline.terminal import Shell, make_console
from robid.report.numbers import engineering, pretty_unit, significant
from robid.report.page import Headline, KeyNumber, ReportContent, Verdict, render
from robid.report.section import Beside, Cell, ColumnStyle, Curve, Figure, Notes, Row, Section, Table
from robid.report.terminal_table import Column, TerminalTable
from robid.signals.log_options import Dialect

_DRAWN = 24
"""Signals that are drawn at most."""

_ROUNDING = 1e-13
"""Amplitudes below this share of the largest are not drawn."""

_STYLES: tuple[ColumnStyle, ...] = ("name", "text", "text", "number", "number", "number", "prose")


def draw_log(found: Findings, proposal: str) -> str:
    """Renders what was found in a log, and the proposed experiment file, as one self-contained page."""
    contents = found.contents
    return render(
        ReportContent(
            title=contents.file.name,
            verdict=_verdict(found, proposal.count("# check:")),
            robot=FORMATS[contents.format].title.partition(" ")[2],
            headlines=(Headline(numbers=_numbers(found)),),
            warnings=contents.notes,
            sections=(_variables(found), _pictures(found), _mapping(proposal)),
        )
    )


def _verdict(found: Findings, checks: int) -> Verdict:
    """Whether the log can be imported, and how much of the mapping is to be checked."""
    if not (found.proposal.inputs and found.proposal.outputs):
        return Verdict("What drives or what moves was not found: complete the proposed mapping.", "bad")
    if not checks:
        return Verdict("The log says all that a mapping needs.", "ok")
    lines = "one line" if checks == 1 else f"{checks} lines"
    return Verdict(f"What drives and what moves was found: check {lines} of the proposed mapping.", "warn")


def _numbers(found: Findings) -> tuple[KeyNumber, ...]:
    step, shared = found.sampling.step_s, found.shared
    rate = KeyNumber("Sampling", engineering(1 / step, "Hz") if step else "unknown", f"{found.n_sample} samples")
    length = KeyNumber("Duration", engineering(found.duration_s, "s") if step else "unknown")
    if shared is None:
        return rate, length, KeyNumber("Period", "none")
    period = KeyNumber("Period", engineering(shared.samples * found.step_s, "s"), f"{shared.held:.4g} periods")
    return rate, length, period, KeyNumber("Lines", str(len(found.lines)), "with energy")


def _variables(found: Findings) -> Section:
    rows = tuple(
        Row(
            (
                signal.name,
                role_text(signal),
                _unit(signal),
                significant(signal.quality.lowest),
                significant(signal.quality.highest),
                significant(signal.quality.resolution),
                Cell("; ".join(remarks(found, signal))),
            ),
            faint=signal.role in ("", "other"),
        )
        for signal in found.signals
    )
    columns = ("Variable", "Taken for", "Unit", "From", "To", "Step", "Remarks")
    told = [describe_sampling(found), describe_period(found)]
    told += [f"{name}: {why}" for name, why in found.contents.unreadable.items()]
    if found.others:
        told.append("Of another length or topic: " + ", ".join(one.key for one in found.others))
    parts = (Table(columns, rows, styles=_STYLES), Notes(tuple(f"{one[:1].upper()}{one[1:]}" for one in told)))
    return Section("Variables", "", parts, "variables")


def _unit(signal: Signal) -> str:
    """The unit that a log states, or with a question mark the one that other signals imply."""
    if signal.states_unit:
        return pretty_unit(signal.column.unit or signal.hint.unit)
    return f"{pretty_unit(signal.implied)}?" if signal.implied else "not stated"


def _pictures(found: Findings) -> Section:
    drawn = [one for one in found.signals if not (one.quality.is_still or one.twin)][:_DRAWN]
    parts = tuple(Beside(_curves(found, one), 2) for one in drawn)
    left = len(found.signals) - len(drawn)
    lead = f"{left} signals that are the same as others or hardly change are not drawn." if left else ""
    return Section("Signals", lead, parts, "signals")


def _curves(found: Findings, signal: Signal) -> tuple[Figure, Figure]:
    """A signal over time and over frequency."""
    places, values = thin_out(signal.column.values)
    curve = Curve(signal.name, tuple((places * found.step_s).tolist()), tuple(values.tolist()))
    unit = signal.column.unit or signal.hint.unit
    title = signal.role if signal.role not in ("", "other") else "value"
    axis = f"{title} [{pretty_unit(unit)}]" if unit else f"{title} (no unit stated)"
    over = Figure(signal.name, "time [s]", axis, (curve,), log_x=False, log_y=False, height=240, legend=False)
    values = np.where(np.isfinite(signal.column.values), signal.column.values, np.nanmean(signal.column.values))
    if found.shared is None or found.shared.held < 2:
        spectra = spectra_of_all(values, found.step_s)
    else:
        blocks = cut_periods(values[found.unbroken], found.shared.whole, last=from_end(found.shared))
        spectra = spectra_of_periods(blocks, found.step_s)
    frequency = tuple(spectra.frequency_hz.tolist())
    has_noise, highest = bool(len(spectra.noise)), float(spectra.amplitude.max(initial=0.0))
    # Below that there is nothing but rounding.
    amplitude, noise = (
        tuple(np.where(each > _ROUNDING * highest, each, np.nan).tolist())
        for each in (spectra.amplitude, spectra.noise)
    )
    curves = [Curve("amplitude", frequency, amplitude, points=has_noise, symbol="small")]
    if has_noise:
        curves.append(Curve("scatter of the periods", frequency, noise))
    return over, Figure(signal.name, "frequency [Hz]", axis, tuple(curves), height=240, legend=has_noise)


def _mapping(proposal: str) -> Section:
    space = "\N{NO-BREAK SPACE}"
    rows = tuple((line.replace("  ", 2 * space) or space,) for line in proposal.splitlines())
    lead = "An experiment file that imports this log; what is marked `check` is a guess."
    return Section("Proposed mapping", lead, (Table(("experiment file",), rows, styles=("code",)),), "mapping")


_MARK = "<!-- page of robid inspect -->"
_COLUMNS = (
    *(Column("variable", numbers=False), Column("taken for", numbers=False), Column("unit", numbers=False)),
    *(Column("from", leaves=2), Column("to", leaves=2), Column("step", leaves=1), Column("remarks", numbers=False)),
)
_SHOWN = 20


def describe_log(paths: Sequence[Path], options: LogInspection, *, as_json: bool) -> int:
    """Prints what is in a log, draws it and proposes how to import it; returns the exit code."""
    check_targets(paths, options)
    shell = Shell(make_console(stderr=False), make_console(stderr=True), quiet=as_json)
    found = inspect_log(
        paths,
        options.format,
        Dialect(**options.dialect),
        options.sampling_period_s,
        lambda step: shell.note("inspect", step),
    )
    name = (options.experiment or paths[0]).name.partition(".")[0]
    text = write_experiment(found, name, pather(options.experiment), options.format, options.dialect)
    if options.experiment is not None:
        write_new(options.experiment, text)
    if options.page is not None:
        with replacing(options.page) as partial:
            partial.write_text(draw_log(found, text) + _MARK, encoding="utf-8")
    if as_json:
        print_json(log_answer(found, text))
    else:
        _print(shell, found, text, options)
    return 0


def pather(experiment: Path | None) -> Callable[[Path], str]:
    """How the experiment file names a log: from its own folder, from the current one where it is not written."""
    folder = Path.cwd() if experiment is None else experiment.absolute().parent

    def path(file: Path) -> str:
        # Far apart, a whole path says more than a climb.
        short = os.path.relpath(file.absolute(), folder)
        return str(file.absolute()) if short.startswith("../../..") else Path(short).as_posix()

    return path


def check_targets(paths: Sequence[Path], options: LogInspection) -> None:
    """Refuses outputs in the place of something else, and a sampling period that is none, before anything is read."""
    if options.sampling_period_s is not None and not options.sampling_period_s > 0:
        what = f"S568 --sampling-period {options.sampling_period_s:g} is no time between samples."
        raise SettingsError(what, remedy="state it in seconds, as in `--sampling-period 1e-3`")
    page = options.page
    is_own = page is not None and page.is_file() and page.read_bytes().endswith(_MARK.encode())
    if page is not None and page.exists() and not is_own:
        what = "A021 The output would take the place of a file that is no page of `robid inspect`."
        raise ArtifactError(what, where=str(page), remedy="name another file by `--output`")
    for target in filter(None, (page, options.experiment)):
        if not target.absolute().parent.is_dir():
            where = str(target.parent)
            raise SettingsError("S012 There is no such folder.", where=where, remedy="make it, or name another")
    if any(path.is_dir() for path in paths) and len(paths) > 1:
        raise SettingsError("S013 A bag is a log of its own.", where=str(paths[0]), remedy="inspect it alone")


def write_new(path: Path, text: str) -> None:
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
    shell.show(_table(found))
    further = {
        "of another length or topic": [f"{one.key} ({len(one.values)} samples)" for one in found.others],
        "further times": [
            f"{name} ({later_s:+.3g} s)" if later_s else name
            for name, later_s in zip(found.sampling.others, found.sampling.later_s, strict=True)
        ],
        "single numbers": [f"{name} = {value:.6g}" for name, value in contents.scalars.items()],
        "texts": list(contents.texts),
        "not read": [f"{name}: {why}" for name, why in contents.unreadable.items()],
    }
    for what, items in further.items():
        more = f" and {len(items) - _SHOWN} more" if len(items) > _SHOWN else ""
        if items:
            shell.say(f"{what}: {', '.join(items[:_SHOWN])}{more}")
    if options.experiment is not None:
        shell.say(f"proposal: {options.experiment}; check what it marks, then `robid run {options.experiment}`")
    else:
        shell.say("\nproposal, to paste into an experiment file (`--propose FILE.yaml` writes it):\n")
        shell.say(text, as_it_is=True)
    if options.page is not None:
        shell.say(f"page: {options.page}")


def _table(found: Findings) -> TerminalTable:
    table = TerminalTable(_COLUMNS, elsewhere="in `--json`, on the page of `--output`")
    for signal in found.signals:
        quality = signal.quality
        ends = significant(quality.lowest), significant(quality.highest)
        step = "" if quality.resolution is None else f"{quality.resolution:.4g}"
        table.add(signal.name, role_text(signal), _unit(signal), *ends, step, "; ".join(remarks(found, signal)))
    return table
