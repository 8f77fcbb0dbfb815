"""A log as a page: what is in it, how it looks over time and frequency, and the proposed mapping."""

from __future__ import annotations

import numpy as np

from robid.logs.formats.variables import FORMATS
from robid.logs.inspection.excitation import cut_periods
from robid.logs.inspection.findings import Findings, from_end
from robid.logs.inspection.quality import spectra_of_all, spectra_of_periods, thin_out
from robid.logs.inspection.roles import Signal
from robid.logs.inspection.text import describe_period, describe_sampling, remarks, role_text
from robid.report.numbers import engineering, pretty_unit, significant
from robid.report.page import Headline, KeyNumber, ReportContent, Verdict, render
from robid.report.section import Beside, Cell, ColumnStyle, Curve, Figure, Notes, Row, Section, Table

_DRAWN = 24
"""Signals that are drawn at most."""

_STYLES: tuple[ColumnStyle, ...] = ("name", "text", "text", "number", "number", "number", "prose")


def draw_log(found: Findings, proposal: str) -> str:
    """Renders what was found in a log as one self-contained page.

    Args:
        found: What was found.
        proposal: The proposed experiment file.
    """
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
                pretty_unit(signal.column.unit),
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


def _pictures(found: Findings) -> Section:
    drawn = [one for one in found.signals if not (one.quality.is_still or one.twin)][:_DRAWN]
    parts = tuple(Beside((_over_time(found, one), _over_frequency(found, one)), 2) for one in drawn)
    left = len(found.signals) - len(drawn)
    lead = f"{left} signals that are the same as others or hardly change are not drawn." if left else ""
    return Section("Signals", lead, parts, "signals")


def _over_time(found: Findings, signal: Signal) -> Figure:
    places, values = thin_out(signal.column.values)
    time = tuple((places * found.step_s).tolist())
    curve = Curve(signal.name, time, tuple(values.tolist()))
    return Figure(signal.name, "time [s]", _axis(signal), (curve,), log_x=False, log_y=False, height=240, legend=False)


def _over_frequency(found: Findings, signal: Signal) -> Figure:
    values = np.where(np.isfinite(signal.column.values), signal.column.values, np.nanmean(signal.column.values))
    if found.shared is None or found.shared.held < 2:
        spectra = spectra_of_all(values, found.step_s)
    else:
        blocks = cut_periods(values[found.unbroken], found.shared.whole, last=from_end(found.shared))
        spectra = spectra_of_periods(blocks, found.step_s)
    frequency = tuple(spectra.frequency_hz.tolist())
    curves = [
        Curve(
            "amplitude", frequency, tuple(spectra.amplitude.tolist()), points=bool(len(spectra.noise)), symbol="small"
        )
    ]
    if len(spectra.noise):
        curves.append(Curve("scatter of the periods", frequency, tuple(spectra.noise.tolist())))
    return Figure(signal.name, "frequency [Hz]", _axis(signal), tuple(curves), height=240, legend=len(curves) > 1)


def _axis(signal: Signal) -> str:
    unit = signal.column.unit or signal.hint.unit
    title = signal.role if signal.role not in ("", "other") else "value"
    return f"{title} [{pretty_unit(unit)}]" if unit else f"{title} (no unit stated)"


def _mapping(proposal: str) -> Section:
    rows = tuple(
        (line.replace("  ", "\N{NO-BREAK SPACE}" * 2) or "\N{NO-BREAK SPACE}",) for line in proposal.splitlines()
    )
    lead = "An experiment file that imports this log; what is marked `check` is a guess."
    return Section("Proposed mapping", lead, (Table(("experiment file",), rows, styles=("code",)),), "mapping")
