"""The plan of an excitation as a table for the terminal, before anything is measured."""

from __future__ import annotations

import numpy as np
from rich.console import Group
from rich.table import Table
from rich.text import Text

from robid.arrays import FloatArray
from robid.design.excitation import UNITS, Excitation
from robid.report.numbers import duration, significant


def plan_table(excitation: Excitation, names: tuple[str, ...]) -> Group | None:
    """Lays out what an excitation is predicted to do to each motor, each figure at its worst configuration.

    Args:
        excitation: The excitation.
        names: Names of the motors.

    Returns:
        A row per motor, the duration and the weakest pair of motors; None without a plan.
    """
    plan = excitation.plan
    if plan is None:
        return None
    table = Table(box=None, pad_edge=False, header_style="dim")
    table.add_column("plan", no_wrap=True)
    columns = [
        (f"rms [{UNITS[excitation.kind]}]", [significant(value) for value in excitation.rms]),
        ("crest", [f"{value:.2f}" for value in excitation.crest_factor.max(axis=(0, 1))]),
        ("speed [rad/s]", _reached(plan.speed_rms, plan.speed_peak, plan.speed_limit)),
        ("torque [N m]", _reached(plan.torque_rms, plan.torque_peak, plan.torque_limit)),
        (
            "excursion [deg]",
            _reached(*(np.degrees(each) for each in (plan.excursion_rms, plan.excursion_peak, plan.excursion_limit))),
        ),
    ]
    if plan.speed_crest is not None:
        columns.append(("speed crest", [f"{value:.2f}" for value in plan.speed_crest.max(axis=0)]))
    if plan.snr_db is not None:
        own = np.diagonal(plan.snr_db, axis1=2, axis2=3)
        columns.append(("worst SNR", [_worst(own[..., [motor]], excitation) for motor in range(len(names))]))
    for header, _ in columns:
        table.add_column(header, justify="right", no_wrap=True)
    for motor, name in enumerate(names):
        table.add_row(f"  {name}", *(cells[motor] for _, cells in columns))
    return Group(table, Text("\n".join(_notes(excitation, names)), style="dim"))


def _reached(rms: FloatArray, peak: FloatArray, limit: FloatArray) -> list[str]:
    worst = np.argmax(peak, axis=0)
    return [
        f"{significant(rms[:, motor].max())}, peak {significant(peak[at, motor])} of {significant(limit[motor])}"
        for motor, at in enumerate(worst)
    ]


def _worst(snr_db: FloatArray, excitation: Excitation) -> str:
    """Smallest ratio of (n_conf, n_freq, ...) with its frequency and configuration."""
    configuration, line = np.unravel_index(int(np.argmin(snr_db)), snr_db.shape)[:2]
    place = f" in configuration {configuration + 1}" if len(snr_db) > 1 else ""
    return f"{snr_db.min():.0f} dB at {significant(excitation.frequency_hz[line])} Hz{place}"


def _notes(excitation: Excitation, names: tuple[str, ...]) -> list[str]:
    plan = excitation.plan
    notes = ["rms, peak and limit; each at its worst configuration, static torque included, friction left out"]
    if plan is not None and plan.snr_db is not None:
        flat = plan.snr_db.reshape(-1, *plan.snr_db.shape[2:])
        output, motor = np.unravel_index(int(np.argmin(np.median(flat, axis=0))), flat.shape[1:])
        notes.append(
            f"SNR of each motor's own element; weakest pair: torque of {names[motor]} to {names[output]},"
            f" {np.median(flat[:, output, motor]):.0f} dB (median)"
        )
    if plan is not None and plan.duration_s is not None:
        notes.append(f"the campaign takes {duration(plan.duration_s)}")
    return notes
