"""Figures of residuals and torques of a rigid fit, after Figs 2 to 5 of Janot et al. (2009)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.arrays import FloatArray
from robid.models.rigid.fit.solution import Checks, Filtered, RowResiduals
from robid.models.rigid.judge.validating import Prediction
from robid.report.section import Curve, Figure

_BINS = 40
_MOST_POINTS = 1500
_OUTLIER = 3.0


def histogram(found: RowResiduals, joint: int, name: str, unit: str) -> Figure:
    """The distribution of one motor's residuals against the Gaussian of the same deviation."""
    residual = found.residual[:, joint]
    residual = residual[np.isfinite(residual)]
    deviation = float(residual.std())
    edges = np.linspace(-4 * deviation, 4 * deviation, _BINS + 1)
    density, _ = np.histogram(np.clip(residual, edges[0], edges[-1]), edges, density=True)
    middle = 0.5 * (edges[1:] + edges[:-1])
    gaussian = np.exp(-0.5 * (middle / deviation) ** 2) / (np.sqrt(2 * np.pi) * deviation)
    curves = (_curve("residual", middle, density), _curve("Gaussian", middle, gaussian))
    return Figure(name, f"Residual [{unit}]", "Density", curves, log_x=False, log_y=False, height=260)


def weights(found: RowResiduals, joint: int, name: str, unit: str) -> Figure:
    """Huber's weight of each row over its residual."""
    residual, weight = _thinned(found.residual[:, joint], found.weight[:, joint])
    order = np.argsort(residual)
    curve = Curve("weight", tuple(residual[order].tolist()), tuple(weight[order].tolist()), points=True)
    return Figure(
        name, f"Residual [{unit}]", "Weight", (curve,), log_x=False, log_y=False, y_range=(0.0, 1.05), height=260
    )


def course(found: RowResiduals, joint: int, name: str, unit: str) -> Figure:
    """One motor's residuals over time, with three deviations on either side."""
    deviation = float(np.nanstd(found.residual[:, joint]))
    time, residual = _thinned(found.time_s, found.residual[:, joint])
    ends = np.array([time[0], time[-1]])
    curves = (
        _curve("residual", time, residual),
        _curve("3 deviations", ends, np.full(2, _OUTLIER * deviation)),
        _curve("-3 deviations", ends, np.full(2, -_OUTLIER * deviation)),
    )
    return Figure(name, "Time [s]", f"Residual [{unit}]", curves, log_x=False, log_y=False, height=260)


def correlations(checks: Checks, names: Sequence[str]) -> Figure:
    """Autocorrelation of the residuals, less what the filter gives white noise."""
    lags = np.arange(1, checks.correlation.shape[1] + 1, dtype=float)
    curves = tuple(_curve(name, lags, row) for name, row in zip(names, checks.correlation, strict=True))
    return Figure(
        "Correlation in time", "Lag [rows]", "Autocorrelation beyond the filter's", curves, log_x=False, log_y=False
    )


def trials(filtered: Filtered) -> Figure:
    """What each cut-off that was tried leaves correlated."""
    worst = filtered.trial_correlation.max(axis=1)
    curve = Curve("worst motor", tuple(filtered.trial_hz.tolist()), tuple(worst.tolist()))
    return Figure(
        "Choice of the cut-off", "Cut-off [Hz]", "Largest autocorrelation", (curve,), log_y=False, legend=False
    )


def torques(found: Prediction, joint: int, name: str, unit: str) -> Figure:
    """One motor's measured and predicted torque over time."""
    time, measured = _thinned(found.time_s, found.measured[:, joint])
    again, predicted = _thinned(found.time_s, found.predicted[:, joint])
    rest, error = _thinned(found.time_s, found.measured[:, joint] - found.predicted[:, joint])
    curves = (_curve("measured", time, measured), _curve("predicted", again, predicted), _curve("error", rest, error))
    quantity = "Force" if unit == "N" else "Torque"
    return Figure(name, "Time [s]", f"{quantity} [{unit}]", curves, log_x=False, log_y=False)


def _curve(name: str, x: FloatArray, y: FloatArray) -> Curve:
    return Curve(name, tuple(x.tolist()), tuple(y.tolist()))


def _thinned(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Rows that count, no more than a page can draw."""
    known = np.isfinite(x) & np.isfinite(y)
    x, y = x[known], y[known]
    step = max(1, -(-x.size // _MOST_POINTS))
    return x[::step], y[::step]
