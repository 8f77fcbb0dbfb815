"""Figures of a fit of gears: torque over deflection as data sheets show it, and deflections over time."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray
from robid.models.parameters import ERROR, MEASURED, MODEL, curve, over_time
from robid.models.transmission.fit.law import LOST_MOTION_SHARE
from robid.models.transmission.fit.solution import TransmissionSolution
from robid.models.transmission.judge.validating import TransmissionValidation
from robid.report.section import Choices, Figure, Line, Part, Section

_POINTS = 1200
_MILLI = 1e3


def loop_section(solution: TransmissionSolution) -> Section:
    """Draws torque over deflection: what was measured, and the loop of the law up to the rated torque."""
    options: list[tuple[tuple[str, ...], tuple[Part, ...]]] = []
    for gear, joint in enumerate(solution.joints):
        rows = solution.rows
        # What the encoders showed less all that is not the gear's law.
        own = rows.deflection[:, gear] + rows.measured[:, gear] - rows.model[:, gear]
        step = max(1, own.size // _POINTS)
        curves = (
            curve("measured", _MILLI * own[::step], rows.torque[::step, gear], MEASURED, points=True),
            curve(
                "loop of the law", _MILLI * solution.loops.deflection[:, gear], solution.loops.torque[:, gear], MODEL
            ),
        )
        share = LOST_MOTION_SHARE * float(solution.rated[gear])
        figure = Figure(
            "Torque over deflection",
            "Deflection [mrad]",
            "Torque behind the gear [N m]",
            curves,
            log_x=False,
            log_y=False,
            height=420,
            lines=(Line("y", share, "3 % of rated"), Line("y", -share, "")),
        )
        options.append(((joint,), (figure,)))
    lead = (
        "Measured: the encoders' difference without lag, offset, scale and transmission error. The loop is what a gear "
        "maker would measure with a locked motor, computed from the fitted law up to the rated torque."
    )
    return Section("Torque over deflection", lead, (Choices(("Joint",), tuple(options)),), "loops")


def deflection_section(solution: TransmissionSolution, validation: TransmissionValidation | None) -> Section:
    """Draws measured and modelled differences of the encoders over time, motion by motion."""
    rows, options = solution.rows, []
    for gear, joint in enumerate(solution.joints):
        for motion, name in enumerate(solution.motions):
            chosen = rows.motion == motion
            parts = _figures(rows.time_s[chosen], rows.measured[chosen, gear], rows.model[chosen, gear])
            options.append(((joint, name or f"motion {motion + 1}"), parts))
        if validation is not None:
            step = np.diff(validation.time_s, prepend=validation.time_s[0])
            time_s = np.cumsum(np.where(step < 0, 0.0, step))
            options.append(
                ((joint, "validation"), _figures(time_s, validation.measured[:, gear], validation.model[:, gear]))
            )
    lead = "Difference of the encoders with their lag taken out, and what the model says of it."
    return Section("Deflections over time", lead, (Choices(("Joint", "Motion"), tuple(options)),), "deflections")


def _figures(time_s: FloatArray, measured: FloatArray, model: FloatArray) -> tuple[Part, ...]:
    both = (
        over_time("measured", time_s, _MILLI * measured, MEASURED),
        over_time("model", time_s, _MILLI * model, MODEL),
    )
    left = over_time("measured less model", time_s, _MILLI * (measured - model), ERROR)
    return (
        Figure("Difference of the encoders", "", "[mrad]", both, log_x=False, log_y=False, height=300),
        Figure("Residual", "Time [s]", "[mrad]", (left,), log_x=False, log_y=False, height=200),
    )
