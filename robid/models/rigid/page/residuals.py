"""Figures of residuals, after Figs 2 to 5 of Janot et al. (2009), and how the cut-off of the filter was chosen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.arrays import FloatArray
from robid.models.parameters import ERROR, GREY, MEASURED, MODEL, curve, extremes, thinned
from robid.models.rigid.fit.solution import Checks, Filtered, RowResiduals
from robid.models.rigid.page.content import RigidContent
from robid.report.numbers import significant
from robid.report.section import Beside, Choice, Curve, Figure, Part, Section

_BINS = 40
_OUTLIER = 3.0


def residual_section(content: RigidContent) -> Section:
    """Lays out each motor's residuals against a Gaussian and Huber's weights, their correlation, and the filters."""
    solution, names = content.solution, content.motors.names
    found, units = solution.residuals, content.units
    each: tuple[tuple[str, tuple[Part, ...]], ...] = tuple(
        (
            name,
            (
                Beside(
                    (histogram(found, joint, "Distribution", unit), weights(found, joint, "Huber's weights", unit)), 2
                ),
            ),
        )
        for joint, (name, unit) in enumerate(zip(names, units, strict=True))
    )
    parts: list[Part] = [Choice("Motor", each), *correlations(solution.checks, names)]
    filtered = solution.filtered
    if filtered.trial_hz.size > 1:
        parts.append(trials(filtered))
    chosen = "chosen by left-out pieces of the log" if filtered.trial_hz.size > 1 else "as stated"
    lead = (
        f"Positions are low-passed at {significant(filtered.cut_hz, 3)} Hz ({chosen}; 99 % of the speed lies"
        f" below {significant(float(filtered.motion_hz.max()), 3)} Hz), and every {filtered.decimation}th row is kept."
        " Each motor's residuals against a Gaussian and with Huber's weights; over time they stand above."
    )
    return Section("Residuals", lead, tuple(parts), "residuals")


def histogram(found: RowResiduals, joint: int, name: str, unit: str) -> Figure:
    """The distribution of one motor's residuals against the Gaussian of the same deviation."""
    residual = found.residual[:, joint]
    residual = residual[np.isfinite(residual)]
    deviation = float(residual.std())
    edges = np.linspace(-4 * deviation, 4 * deviation, _BINS + 1)
    density, _ = np.histogram(np.clip(residual, edges[0], edges[-1]), edges, density=True)
    middle = 0.5 * (edges[1:] + edges[:-1])
    gaussian = np.exp(-0.5 * (middle / deviation) ** 2) / (np.sqrt(2 * np.pi) * deviation)
    curves = (curve("residual", middle, density, MEASURED), curve("Gaussian", middle, gaussian, MODEL))
    return Figure(name, f"Residual [{unit}]", "Density", curves, log_x=False, log_y=False, height=260)


def weights(found: RowResiduals, joint: int, name: str, unit: str) -> Figure:
    """Huber's weight of each row over its residual."""
    residual, weight = _known_rows(found.residual[:, joint], found.weight[:, joint])
    order = np.argsort(residual)
    shown = Curve("weight", tuple(residual[order].tolist()), tuple(weight[order].tolist()), points=True)
    return Figure(
        name, f"Residual [{unit}]", "Weight", (shown,), log_x=False, log_y=False, y_range=(0.0, 1.05), height=260
    )


def course(found: RowResiduals, joint: int, name: str, unit: str) -> Figure:
    """One motor's residuals over time, with three deviations on either side."""
    deviation = float(np.nanstd(found.residual[:, joint]))
    time, residual = extremes(found.time_s, found.residual[:, joint])
    ends = np.array([time[0], time[-1]])
    curves = (
        curve("residual", time, residual, ERROR),
        curve("3 deviations", ends, np.full(2, _OUTLIER * deviation), GREY),
        curve("-3 deviations", ends, np.full(2, -_OUTLIER * deviation), GREY),
    )
    return Figure(name, "Time [s]", f"Residual [{unit}]", curves, log_x=False, log_y=False, height=260)


_MOST_CURVES = 7


def correlations(checks: Checks, names: Sequence[str]) -> tuple[Figure, ...]:
    """Autocorrelation of the residuals, less what the filter gives white noise; as many curves as a figure has."""
    lags = np.arange(1, checks.correlation.shape[1] + 1, dtype=float)
    curves = [curve(name, lags, row) for name, row in zip(names, checks.correlation, strict=True)]
    title, label = "Correlation in time", "Autocorrelation beyond the filter's"
    return tuple(
        Figure(title, "Lag [rows]", label, tuple(curves[first : first + _MOST_CURVES]), log_x=False, log_y=False)
        for first in range(0, len(curves), _MOST_CURVES)
    )


def trials(filtered: Filtered) -> Figure:
    """Error on left-out pieces of the log by each cut-off that was tried, and the smallest with its standard error."""
    best = int(np.argmin(filtered.trial_error))
    beyond = np.sqrt(filtered.trial_error[best] ** 2 + filtered.trial_deviation)
    curves = (
        curve("error on left-out pieces", filtered.trial_hz, filtered.trial_error),
        curve("smallest and one standard error", filtered.trial_hz, beyond),
    )
    label = f"Error over torque, below {significant(filtered.band_hz, 2)} Hz"
    return Figure("Choice of the cut-off", "Cut-off [Hz]", label, curves)


def _known_rows(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Rows that count, no more than a page can draw."""
    known = np.isfinite(x) & np.isfinite(y)
    return thinned(x[known], y[known])
