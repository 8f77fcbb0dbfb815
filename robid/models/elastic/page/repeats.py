"""Resonances that several campaigns measured in one robot configuration: as text, as a table, in numbers."""

from __future__ import annotations

from robid.models.elastic.page.content import RepeatRow, ResonanceRow
from robid.report.numbers import MISSING, number_of, percent, significant
from robid.report.section import Row, Table

_CAPTION = (
    "What campaigns that measured the same robot configuration found, pooled. An interval is where another campaign's"
    " would be found: it holds what theirs scatter, and their own intervals."
)


def repeat_tables(rows: tuple[ResonanceRow, ...], level: float) -> tuple[Table, ...]:
    """Lays out resonances that several measurements show; nothing without any.

    Args:
        rows: The resonances.
        level: Level of their intervals.
    """
    found = [(row, row.repeat) for row in rows if row.repeat is not None]
    if not found:
        return ()
    interval = f"{percent(level)} interval of another"
    peaks = ("Mean peak or dip [Hz]", "Lowest … highest", interval)
    columns = ("Conf.", "Channel", "Kind", "Measured by", *peaks, "Mean pole or zero [Hz]", interval)
    return (
        Table(
            columns,
            tuple(_row(row, repeat) for row, repeat in found),
            title="Measured more than once",
            caption=_CAPTION,
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


def _row(row: ResonanceRow, repeat: RepeatRow) -> Row:
    cells = (
        number_of(row.configuration),
        row.channel,
        f"{'▲' if row.kind == 'resonance' else '▽'} {row.kind}",
        measured_by(repeat),
        significant(repeat.peak_hz, 4),
        interval_text((repeat.lowest_hz, repeat.highest_hz)),
        interval_text(repeat.peak_interval_hz),
        MISSING if repeat.pole_hz is None else significant(repeat.pole_hz, 4),
        interval_text(repeat.pole_interval_hz),
    )
    return Row(cells)


def interval_text(low_high: tuple[float, float] | None) -> str:
    """Writes an interval to four digits, or more where its ends would look the same."""
    if low_high is None:
        return MISSING
    for digits in (4, 5):
        low, high = (significant(value, digits) for value in low_high)
        if low != high:
            break
    return f"{low} … {high}"
