"""Resonances on the page of a fit: their tables, and repeats of one resonance as one."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median

import numpy as np
from rich.console import Group
from rich.text import Text

from robid.frf.frf import Frf
from robid.models.elastic.judge.modes import ArmModes
from robid.models.elastic.judge.resonances import SAME_CONFIGURATION
from robid.models.elastic.page.gather import FitContent, RepeatRow, ResonanceRow
from robid.models.elastic.page.modes import mode_anchor, mode_of, resonance_anchor
from robid.report.charts import configuration_label
from robid.report.numbers import MISSING, number_of, percent, significant
from robid.report.page import KeyNumber
from robid.report.parameter_section import with_notes, within
from robid.report.section import Cell, Row, Section, Table
from robid.report.terminal_table import Column, TerminalTable

_REPEAT_CAPTION = (
    "What campaigns that measured the same robot configuration found, pooled. An interval is where another campaign's"
    " would be found: it contains what theirs scatter, and their own intervals."
)


def repeat_tables(rows: tuple[ResonanceRow, ...], level: float) -> tuple[Table, ...]:
    """Lays out resonances that several measurements show; nothing without any."""
    found = [(row, row.repeat) for row in rows if row.repeat is not None]
    if not found:
        return ()
    interval = f"{percent(level)} interval of another"
    peaks = ("Mean peak or dip [Hz]", "Lowest … highest", interval)
    columns = ("Conf.", "Channel", "Kind", "Measured by", *peaks, "Mean pole or zero [Hz]", interval)
    return (
        Table(
            columns,
            tuple(_repeat_row(row, repeat) for row, repeat in found),
            title="Measured more than once",
            caption=_REPEAT_CAPTION,
            styles=("text", "name", "text", "text", "strong", "number", "number", "strong", "number"),
            fit="tall",
        ),
    )


def measured_by(repeat: RepeatRow) -> str:
    """Names the campaigns behind a resonance, with how often each measured it."""
    counts = {name: repeat.campaigns.count(name) for name in dict.fromkeys(repeat.campaigns)}
    return ", ".join(name if count == 1 else f"{name} ({count} times)" for name, count in counts.items())


def repeat_sentence(rows: tuple[ResonanceRow, ...]) -> str:
    """Says which campaigns measured a configuration again; empty where one did alone."""
    campaigns = dict.fromkeys(name for row in rows if row.repeat is not None for name in row.repeat.campaigns)
    return f"what {', '.join(campaigns)} scatter in the same configuration" if len(campaigns) > 1 else ""


def repeat_summary(repeat: RepeatRow) -> dict[str, float]:
    """Returns the numbers of what several measurements show."""
    found = {"repeats": float(len(repeat.campaigns)), "mean_peak_hz": repeat.peak_hz}
    found |= {"mean_peak_lower_hz": repeat.peak_interval_hz[0], "mean_peak_upper_hz": repeat.peak_interval_hz[1]}
    if repeat.pole_hz is not None and repeat.pole_interval_hz is not None:
        lower, upper = repeat.pole_interval_hz
        found |= {"mean_measured_hz": repeat.pole_hz, "mean_measured_lower_hz": lower, "mean_measured_upper_hz": upper}
    return found


def _repeat_row(row: ResonanceRow, repeat: RepeatRow) -> Row:
    cells = (
        number_of(row.configuration),
        row.channel,
        _kind(row),
        measured_by(repeat),
        significant(repeat.peak_hz, 4),
        interval_text((repeat.lowest_hz, repeat.highest_hz)),
        interval_text(repeat.peak_interval_hz),
        significant(repeat.pole_hz, 4),
        interval_text(repeat.pole_interval_hz),
    )
    return Row(cells)


def _kind(row: ResonanceRow) -> str:
    return f"{'▲' if row.kind == 'resonance' else '▽'} {row.kind}"


def interval_text(low_high: tuple[float, float] | None) -> str:
    """Writes an interval to four digits, or more where its ends would look the same."""
    if low_high is None:
        return MISSING
    for digits in (4, 5):
        low, high = (significant(value, digits) for value in low_high)
        if low != high:
            break
    return f"{low} … {high}"


_CAPTION = (
    "A peak or dip is where the magnitude is largest or smallest: of the measurement, by a local model between its"
    " lines, and of the model, read in the same way, so that both compare and what neighbouring modes add cancels."
    " A pole or zero is that of the local model, none where modes crowd, beside the fitted model's own, with the"
    " interval that its parameters leave, and its damping ratio. Neighbouring bumps that do not stand out of what the"
    " lines scatter are one resonance. "
)
_ALONE = (
    "There is one realization: the intervals of what was measured hold its noise and what its lines scatter, but not"
    " what another measurement of the same robot would find. Friction and temperature may move a resonance by more:"
    " record several realizations, or measure a configuration more than once."
)


def resonance_errors(rows: tuple[ResonanceRow, ...]) -> list[tuple[float, ResonanceRow]]:
    """Relative distance of model from measurement, for the rows that have both."""
    return [
        (row.model_hz / row.measured_hz - 1, row)
        for row in rows
        if row.measured_hz is not None and row.model_hz is not None and row.measured_hz > 0
    ]


def resonance_sentence(rows: tuple[ResonanceRow, ...]) -> str:
    """Says how far the model's resonances are from the measured ones."""
    errors = resonance_errors(rows)
    if not errors:
        return ""
    worst, row = max(errors, key=lambda item: abs(item[0]))
    middle = median(abs(error) for error, _ in errors)
    return (
        f"{len(errors)} pairs of peaks and dips; the model is off by {percent(middle)} in the median and by "
        f"{percent(abs(worst))} at worst, the {row.kind} of {row.channel} at {significant(row.measured_hz, 4)} Hz in "
        f"configuration {number_of(row.configuration)}."
    )


def resonance_number(rows: tuple[ResonanceRow, ...]) -> tuple[KeyNumber, ...]:
    """Says how far the model's resonances are off, in two numbers."""
    errors = [abs(error) for error, _ in resonance_errors(rows)]
    if not errors:
        return ()
    return (KeyNumber("Resonances off", percent(median(errors)), f"median; worst {percent(max(errors))}"),)


def resonance_section(
    rows: tuple[ResonanceRow, ...], frf: Frf, level: float, modes: Sequence[ArmModes] = (), fit: str = ""
) -> tuple[Section, ...]:
    """Lays out the resonances of a fit by configuration, with links to its modes; nothing without any."""
    if not rows:
        return ()
    interval = f"{percent(level)} interval"
    peaks = ("Peak or dip [Hz]", interval, "Model's peak [Hz]", "Off", "In interval")
    poles = ("Pole or zero [Hz]", "Interval of pole", "Model's pole [Hz]", "Interval of model's", "Damping")
    table = Table(
        ("Conf.", "Channel", "Kind", *peaks, *poles),
        tuple(_row(row, frf, index, modes, fit) for index, row in enumerate(rows)),
        caption=_CAPTION + interval_sentence(frf, repeat_sentence(rows)),
        styles=(
            "text", "name", "text", "strong", "number", "number", "number", "text",
            "strong", "number", "number", "number", "number",
        ),
        choice="Configuration",
        leaves=("In interval", *poles[1:4:2], "Pole or zero [Hz]", interval, "Conf.", "Off"),
        fit="tall",
    )  # fmt: skip
    parts = table, *repeat_tables(rows, level)
    return (Section("Resonances", resonance_sentence(rows), parts, "resonances"),)


def interval_sentence(frf: Frf, repeated: str = "") -> str:
    """Says what the intervals of measured resonances hold.

    Args:
        frf: The response.
        repeated: What campaigns scatter that measured the same configuration, if several did.
    """
    told = []
    if frf.realization_error is not None:
        told.append(f"what leaving out each of {frf.realization_error.shape[1]} realizations changes")
    places = frf.configurations
    listed = any(
        np.abs(places[first] - places[second]).max(initial=0.0) <= SAME_CONFIGURATION
        for first in range(len(places))
        for second in range(first)
    )
    if repeated or listed:
        told.append(repeated or "what measurements of the same configuration scatter")
    if not told:
        return _ALONE if frf.total_covariance is None else "The intervals hold what the realizations scatter."
    return f"The intervals of what was measured hold the response's covariance and {' and '.join(told)}."


def _row(row: ResonanceRow, frf: Frf, index: int, modes: Sequence[ArmModes], fit: str) -> Row:
    low_high, errors, mode = row.interval_hz, resonance_errors((row,)), mode_of(row, modes)
    own = significant(row.mode_hz, 4)
    inside = low_high[0] <= row.model_hz <= low_high[1] if low_high and row.model_hz is not None else None
    cells = (
        number_of(row.configuration),
        row.channel,
        _kind(row),
        _measured(row),
        interval_text(low_high),
        significant(row.model_hz, 4) if row.model_hz is not None else "none",
        percent(errors[0][0], signed=True) if errors else MISSING,
        within(inside),
        significant(row.pole_hz, 4),
        interval_text(row.pole_interval_hz),
        own if mode is None else Cell(own, link=f"#{mode_anchor(fit, row.configuration, mode)}"),
        interval_text(row.mode_interval_hz),
        percent(row.damping),
    )
    return Row(cells, choice=configuration_label(frf, row.configuration), anchor=resonance_anchor(fit, index))


def _measured(row: ResonanceRow) -> str:
    return significant(row.measured_hz, 4) if row.measured_hz is not None else "not seen"


def resonance_table(fit: FitContent) -> Group:
    """Lays out measured peaks and dips beside the fitted model's, then its poles and zeros with their intervals."""
    rows = fit.resonances
    interval = f"{100 * fit.estimates.level:g} % interval"
    columns = (
        *(Column("resonances [Hz]", numbers=False), Column("measured peak"), Column(interval, leaves=2)),
        *(Column("model's peak", leaves=1), Column("its pole or zero"), Column(interval, leaves=2)),
    )
    table = TerminalTable(columns, elsewhere="on the page")
    found = [row for row in rows if row.mode_hz is not None]
    for row in found:
        place = f", configuration {number_of(row.configuration)}" if len(fit.frf.configurations) > 1 else ""
        table.add(
            Text(f"  {row.channel} {row.kind}{place}"),
            _measured(row),
            interval_text(row.interval_hz),
            significant(row.model_hz, 4) if row.model_hz is not None else "none",
            Text(significant(row.mode_hz, 4), style="bold"),
            interval_text(row.mode_interval_hz),
        )
    alone = len(rows) - len(found)
    notes = [f"{alone} more that the model does not have are in the report"] if alone else []
    scattered = repeat_sentence(rows)
    return with_notes(table, [*notes, *([f"measured intervals hold {scattered}"] if scattered else [])])
