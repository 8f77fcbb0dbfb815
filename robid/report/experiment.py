"""Sections on what was measured and what was run, and the table of what is planned."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from rich.console import Group

from robid.arrays import FloatArray
from robid.design.excitation.excitation import UNITS, Excitation, ExcitationPlan
from robid.report.numbers import MISSING, duration, joint_text, number_of, percent, pretty_unit, significant
from robid.report.section import Cell, ColumnStyle, Notes, Part, Section, Table
from robid.report.terminal_table import Column, Footnotes, TerminalTable
from robid.signals.quantities import METRES, readable, readable_units

_LEAVES = ("Crest factor", "Detection lines", "Period", "RMS injected", "Lines")


@dataclass(frozen=True)
class ConfigurationRow:
    """One measured configuration."""

    campaign: str  # name of the campaign
    index: int  # index in the campaign
    positions: tuple[float, ...]  # arm-side joint positions [rad, or m]
    joint_units: tuple[str, ...] | None = None  # unit of each; None where all are angles


@dataclass(frozen=True)
class PeakRow:
    """A predicted peak against its limit."""

    channel: str  # motor or joint
    quantity: str  # what peaks, as in `speed`
    unit: str  # SI unit of both
    predicted: float  # predicted peak
    limit: float  # limit
    rms: float | None = None  # predicted RMS, or None


@dataclass(frozen=True)
class ExcitationRow:
    """What one campaign excites with."""

    campaign: str  # name of the campaign
    lines: int  # number of excited lines
    low_hz: float  # lowest excited frequency [Hz]
    high_hz: float  # highest excited frequency [Hz]
    duration_s: float  # measuring time over all configurations [s]
    rms: tuple[float, ...]  # RMS of the injected signal, one for all channels or one each
    rms_unit: str  # its unit
    peaks: tuple[PeakRow, ...] = ()  # predicted peaks against limits
    detection_lines: int = 0  # number of odd lines left out on purpose
    period_s: float | None = None  # length of a period [s], or None
    crest_factor: float | None = None  # the highest of all experiments, or None
    worst_snr_db: float | None = None  # lowest predicted signal-to-noise ratio of all lines and motors [dB], or None


@dataclass(frozen=True)
class TorqueRow:
    """Torque that compensation removed, over a campaign."""

    campaign: str  # name of the campaign
    channel: str  # motor
    removed_rms: float  # RMS of the removed torque
    unit: str = "N m"  # its unit


@dataclass(frozen=True)
class StageRow:
    """One stage that was run."""

    stage: str  # name of the stage
    artifact: str  # path of the artifact in the run folder
    settings_hash: str  # short hash of the settings it read
    content_hash: str  # short hash of what it wrote
    seconds: float | None = None  # time it took [s], or None when it was not run anew
    phrase: str = ""  # what came out


def experiment_section(
    robot_notes: tuple[str, ...],
    excitations: tuple[ExcitationRow, ...],
    removed_torques: tuple[TorqueRow, ...],
    joint_names: tuple[str, ...],
    configurations: tuple[ConfigurationRow, ...],
) -> tuple[Section, ...]:
    """Lays out with what, where and against which friction the robot was measured; nothing where nothing was."""
    parts: list[Part] = []
    if robot_notes:
        parts.append(Notes(robot_notes))
    if excitations:
        parts += [_excitation_table(excitations), *(_peak_table(row) for row in excitations if row.peaks)]
    if removed_torques:
        parts.append(_torque_table(removed_torques))
    if configurations and joint_names:
        parts.append(_configuration_table(joint_names, configurations))
    return (Section("Experiment", "", tuple(parts), "experiment"),) if parts else ()


def run_section(stages: tuple[StageRow, ...]) -> tuple[Section, ...]:
    """Lays out the stages that were run; nothing without any."""
    if not stages:
        return ()
    table = Table(
        ("Stage", "Artifact", "Settings", "Content", "Time", "What came out"),
        tuple(
            (row.stage, row.artifact, row.settings_hash, row.content_hash, duration(row.seconds), row.phrase)
            for row in stages
        ),
        styles=("name", "code", "code", "code", "number", "prose"),
    )
    return (Section("What was run", "", (table,), "run"),)


def _excitation_table(rows: tuple[ExcitationRow, ...]) -> Table:
    heads = ("Campaign", "Lines", "Band", "Measuring time", "RMS injected", "Detection lines")
    cells = []
    for row in rows:
        band = f"{significant(row.low_hz)} … {significant(row.high_hz)} Hz"
        signal = (row.campaign, str(row.lines), band, duration(row.duration_s), rms_text(row), str(row.detection_lines))
        snr = significant(row.worst_snr_db) + ("" if row.worst_snr_db is None else " dB")
        cells.append((*signal, duration(row.period_s), significant(row.crest_factor), snr))
    return Table(
        (*heads, "Period", "Crest factor", "Worst SNR"),
        tuple(cells),
        title="Excitation plan",
        fit="compact",
        leaves=_LEAVES,
    )


def _peak_table(row: ExcitationRow) -> Table:
    cells: list[tuple[str | Cell, ...]] = []
    for peak in row.peaks:
        share = peak.predicted / peak.limit if peak.limit else float("nan")
        sizes = (peak.rms, peak.predicted, peak.limit)
        texts = (MISSING if size is None else f"{significant(size, 3)} {pretty_unit(peak.unit)}" for size in sizes)
        shares = Cell(percent(share), "bad" if share > 1 else ""), Cell(percent(share), share=share)
        cells.append((peak.channel, peak.quantity, *texts, *shares))
    return Table(
        ("Channel", "Quantity", "RMS", "Peak", "Limit", "Share of limit", ""),
        tuple(cells),
        title=f"Predicted peaks, {row.campaign}",
        caption="Speeds and torques are motor side.",
        styles=("name", "text", "number", "strong", "number", "number", "meter"),
    )


def _torque_table(rows: tuple[TorqueRow, ...]) -> Table:
    return Table(
        ("Campaign", "Motor", "RMS removed"),
        tuple((row.campaign, row.channel, f"{significant(row.removed_rms)} {pretty_unit(row.unit)}") for row in rows),
        title="Friction torque removed by compensation",
        styles=("text", "name", "strong"),
        fit="compact",
    )


def _configuration_table(joint_names: tuple[str, ...], rows: tuple[ConfigurationRow, ...]) -> Table:
    angles: tuple[ColumnStyle, ...] = tuple("number" for _ in joint_names)
    units = readable_units(rows[0].joint_units, len(joint_names))
    named = zip(joint_names, units, strict=True)
    heads = ("Campaign", "Configuration", *(f"{name} [{unit.replace('deg', '°')}]" for name, unit in named))
    return Table(
        heads,
        tuple((row.campaign, number_of(row.index), *_written(row, units)) for row in rows),
        title="Configurations",
        styles=("text", "name", *angles),
        fit="compact tall",
    )


def rms_text(row: ExcitationRow) -> str:
    """Writes the RMS of an excitation: once when all channels have the same."""
    values = sorted(set(row.rms))
    unit = pretty_unit(row.rms_unit)
    if not values:
        return MISSING
    if len(values) == 1:
        return f"{significant(values[0], 3)} {unit}"
    return f"{significant(values[0], 3)} … {significant(values[-1], 3)} {unit}"


def _written(row: ConfigurationRow, units: tuple[str, ...]) -> tuple[str, ...]:
    values: list[float] = readable(np.array(row.positions), row.joint_units).tolist()
    return tuple(joint_text(value, unit) for value, unit in zip(values, units, strict=True))


def plan_table(excitation: Excitation, names: tuple[str, ...], units: tuple[str, ...] | None = None) -> Group | None:
    """Lays out what an excitation is predicted to do to each motor, at its worst configuration; None without a plan."""
    plan = excitation.plan
    if plan is None:
        return None
    columns = [*_injected(excitation), *_held_against_limits(plan, names, units)]
    if plan.snr_db is not None:
        own = np.diagonal(plan.snr_db, axis1=2, axis2=3).min(axis=0)
        columns.append((Column("SNR\n[dB]", leaves=5), [f"{value:.0f}" for value in own.min(axis=0)]))
        worst = excitation.frequency_hz[own.argmin(axis=0)]
        columns.append((Column("at\n[Hz]", leaves=1), [significant(value, 2) for value in worst]))
    heads = (Column("plan", numbers=False), *(column for column, _ in columns))
    table = TerminalTable(heads)
    for motor, name in enumerate(names):
        table.add(name, *(cells[motor] for _, cells in columns))
    return Group(table, Footnotes([*_commands(excitation), *_notes(excitation, names)]))


_Columns: TypeAlias = list[tuple[Column, list[str]]]


def _injected(excitation: Excitation) -> _Columns:
    if excitation.channels:
        return []
    crest = [f"{value:.2f}" for value in excitation.crest_factor.max(axis=(0, 1))]
    rms = [significant(value) for value in excitation.rms]
    return [(Column(f"rms\n[{UNITS[excitation.kind]}]", leaves=4), rms), (Column("crest", leaves=3), crest)]


def _held_against_limits(plan: ExcitationPlan, names: tuple[str, ...], units: tuple[str, ...] | None) -> _Columns:
    unit = ", ".join(dict.fromkeys(readable_units(units, len(names))))
    excursions = (readable(each, units) for each in (plan.excursion_rms, plan.excursion_peak, plan.excursion_limit))
    columns = [
        (Column("speed\n[rad/s]"), _reached(plan.speed_rms, plan.speed_peak, plan.speed_limit)),
        (Column("torque\n[N m]"), _reached(plan.torque_rms, plan.torque_peak, plan.torque_limit)),
        (Column(f"excursion\n[{unit}]"), _reached(*excursions)),
    ]
    if plan.speed_crest is not None:
        crest = [f"{value:.2f}" for value in plan.speed_crest.max(axis=0)]
        columns.append((Column("speed\ncrest", leaves=2), crest))
    return columns


def _commands(excitation: Excitation) -> list[str]:
    channels = excitation.channels
    if not channels:
        return []
    peaks = np.abs(excitation.reference).max(axis=(0, 1, 2))
    units = [("mm", 1e3) if channel.unit == METRES else ("deg", float(np.rad2deg(1.0))) for channel in channels]
    told = [
        f"{channel.name} {significant(peak * factor)} {unit}"
        for channel, peak, (unit, factor) in zip(channels, peaks.tolist(), units, strict=True)
    ]
    return [f"commanded one after the other, at most: {', '.join(told)}; excursions are from the middle of the range"]


def _reached(rms: FloatArray, peak: FloatArray, limit: FloatArray) -> list[str]:
    worst = np.argmax(peak, axis=0)
    return [
        f"{significant(rms[:, motor].max(), 2)} {significant(peak[at, motor], 2)}/{significant(limit[motor], 2)}"
        for motor, at in enumerate(worst)
    ]


def _notes(excitation: Excitation, names: tuple[str, ...]) -> list[str]:
    plan = excitation.plan
    rigid = plan is not None and plan.condition is not None
    what = "the rigid robot's torques, friction in them" if rigid else "static torque is in it, friction is not"
    notes = [f"rms peak/limit, each at its worst configuration; {what}"]
    if plan is not None and plan.condition is not None:
        numbers = ", ".join(significant(value) for value in plan.condition)
        notes.append(f"condition number of the base parameters' regressor: {numbers}")
    if plan is not None and plan.snr_db is not None:
        flat = plan.snr_db.reshape(-1, *plan.snr_db.shape[2:])
        output, motor = np.unravel_index(int(np.argmin(np.median(flat, axis=0))), flat.shape[1:])
        notes.append(
            f"SNR: a motor's own element at its worst line; weakest pair: {names[motor]} to {names[output]},"
            f" {np.median(flat[:, output, motor]):.0f} dB (median)"
        )
    if plan is not None and plan.duration_s is not None:
        notes.append(f"the campaign takes {duration(plan.duration_s)}")
    return notes
