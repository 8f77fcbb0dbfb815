"""The plan of an excitation as a table for the terminal, before anything is measured."""

from __future__ import annotations

import numpy as np
from rich.console import Group
from rich.table import Table
from rich.text import Text

from robid.arrays import FloatArray
from robid.design.excitation.excitation import UNITS, Excitation
from robid.report.numbers import duration, significant
from robid.signals.positions import METRES, readable, readable_units


def plan_table(excitation: Excitation, names: tuple[str, ...], units: tuple[str, ...] | None = None) -> Group | None:
    """Lays out what an excitation is predicted to do to each motor, each figure at its worst configuration.

    Args:
        excitation: The excitation.
        names: Names of the motors.
        units: Unit of each joint's position; None where all are angles.

    Returns:
        A row per motor, the duration and the weakest pair of motors; None without a plan.
    """
    plan = excitation.plan
    if plan is None:
        return None
    table = Table(box=None, pad_edge=False, header_style="dim")
    table.add_column("plan", no_wrap=True)
    columns = [] if excitation.channels else _injected(excitation)
    columns += [
        ("speed\n[rad/s]", _reached(plan.speed_rms, plan.speed_peak, plan.speed_limit)),
        ("torque\n[N m]", _reached(plan.torque_rms, plan.torque_peak, plan.torque_limit)),
        (
            f"excursion\n[{', '.join(dict.fromkeys(readable_units(units, len(names))))}]",
            _reached(
                *(readable(each, units) for each in (plan.excursion_rms, plan.excursion_peak, plan.excursion_limit))
            ),
        ),
    ]
    if plan.speed_crest is not None:
        columns.append(("speed\ncrest", [f"{value:.2f}" for value in plan.speed_crest.max(axis=0)]))
    if plan.snr_db is not None:
        own = np.diagonal(plan.snr_db, axis1=2, axis2=3).min(axis=0)
        columns.append(("SNR\n[dB]", [f"{value:.0f}" for value in own.min(axis=0)]))
        columns.append(("at\n[Hz]", [significant(value, 2) for value in excitation.frequency_hz[own.argmin(axis=0)]]))
    for header, _ in columns:
        table.add_column(header, justify="right", no_wrap=True)
    for motor, name in enumerate(names):
        table.add_row(f"  {name}", *(cells[motor] for _, cells in columns))
    return Group(table, Text("\n".join([*_commands(excitation), *_notes(excitation, names)]), style="dim"))


def _injected(excitation: Excitation) -> list[tuple[str, list[str]]]:
    """Columns with what each motor is told."""
    return [
        (f"rms\n[{UNITS[excitation.kind]}]", [significant(value) for value in excitation.rms]),
        ("crest", [f"{value:.2f}" for value in excitation.crest_factor.max(axis=(0, 1))]),
    ]


def _commands(excitation: Excitation) -> list[str]:
    """A line with what each channel that is not a motor is told."""
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
