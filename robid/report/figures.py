"""The data behind the figures, rounded and ready for JSON."""

from __future__ import annotations

from typing import Any

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.frf.frf import Frf
from robid.report.content import CostRow, FitContent, ParameterRow, ReportContent, StartRow
from robid.report.numbers import MINUS, engineering, number_of, percent, pretty_unit
from robid.report.section import Bars, Figure, Skeletons
from robid.report.tables import campaign_title

RATIO_PANELS = (
    ("Springs", ("stiffness",)),
    ("Dampers", ("damping",)),
    ("Inertias", ("motor_inertia", "link_inertia")),
)
_SMALLEST = 1e-30


def page_data(content: ReportContent) -> dict[str, Any]:
    """Gathers what the page's figures draw."""
    figures = [_figure_data(figure) for section in content.sections for figure in section.figures]
    return {"fits": [_fit_data(fit) for fit in content.fits], "figures": figures}


def _figure_data(figure: Figure | Bars | Skeletons) -> dict[str, Any]:
    if isinstance(figure, Skeletons):
        return _skeleton_data(figure)
    if isinstance(figure, Bars):
        return _bar_data(figure)
    return {
        "kind": "curves",
        "x_title": figure.x_title,
        "y_title": figure.y_title,
        "log_x": figure.log_x,
        "log_y": figure.log_y,
        "y_range": figure.y_range,
        "height": figure.height,
        "legend": figure.legend,
        "curves": [
            {"name": curve.name, "x": [_rounded(x) for x in curve.x], "y": [_rounded(y) for y in curve.y]}
            for curve in figure.curves
        ],
    }


def _bar_data(bars: Bars) -> dict[str, Any]:
    return {
        "kind": "bars",
        "value_title": bars.value_title,
        "label_title": bars.label_title,
        "labels": list(bars.labels),
        "flat": bars.flat,
        "parts": [{"name": name, "values": [_rounded(value) for value in values]} for name, values in bars.parts],
    }


def _skeleton_data(arms: Skeletons) -> dict[str, Any]:
    def columns(points: tuple[tuple[float, float, float], ...]) -> list[list[float | None]]:
        return [[_rounded(value, 4) for value in column] for column in zip(*points, strict=True)]

    return {
        "kind": "skeletons",
        "arms": [
            {"name": name, "weight": _rounded(weight, 3), "points": columns(points)}
            for name, points, weight in zip(arms.names, arms.points, arms.weights, strict=True)
        ],
        "others": columns(arms.others),
    }


def configuration_label(frf: Frf, index: int) -> str:
    """Names a configuration by its number and joint angles, as in `3: 0, 20, 30°`."""
    angles = np.round(np.rad2deg(frf.configurations[index])).astype(int)
    written = ", ".join(str(angle).replace("-", MINUS) for angle in angles)
    return f"{number_of(index)}: {written}°" if written else number_of(index)


def band_radius(frf: Frf, level: float) -> FloatArray:
    """Radius of each element's uncertainty circle relative to its magnitude (n_conf, n_freq, n_out, n_in)."""
    return np.asarray(frf.error_radius(level) / np.maximum(np.abs(frf.response), _SMALLEST))


def _fit_data(fit: FitContent) -> dict[str, Any]:
    responses = [_response_data("Estimation", fit.campaign, fit.frf, fit.model_response, fit.level)]
    if fit.validation_frf is not None and fit.validation_model is not None:
        frf, model = fit.validation_frf, fit.validation_model
        responses.append(_response_data("Validation", fit.validation_campaign, frf, model, fit.level))
    return {
        "level": percent(fit.level),
        "responses": responses,
        "marks": [
            [row.configuration, row.channel, _rounded(row.measured_hz)] for row in fit.resonances if row.measured_hz
        ],
        "ratios": [
            _ratio_panel(title, rows) for title, kinds in RATIO_PANELS if (rows := _ratio_rows(kinds, fit.parameters))
        ],
        "costs": [_cost_data("Estimation", fit.estimation_costs), _cost_data("Validation", fit.validation_costs)],
        "starts": _start_data(fit.starts),
    }


def _response_data(role: str, campaign: str, frf: Frf, model: ComplexArray, level: float) -> dict[str, Any]:
    radius = band_radius(frf, level)
    configurations = []
    for index in range(frf.response.shape[0]):
        measured = frf.response[index]
        configurations.append(
            {
                "label": configuration_label(frf, index),
                "measured": _decibels(measured),
                "measured_phase": _phase(measured),
                "model": _decibels(model[index]),
                "model_phase": _phase(model[index]),
                "radius": _per_element(radius[index], 3) if radius[index].any() else None,
                "uncompensated": None
                if frf.uncompensated_response is None
                else _decibels(frf.uncompensated_response[index]),
                **_quality(frf, index),
            }
        )
    return {
        "label": campaign_title(role, campaign),
        "frequency": [_rounded(value) for value in frf.frequency_hz],
        "inputs": list(frf.input_names),
        "outputs": list(frf.output_names),
        "unit": pretty_unit(f"rad/(s^2 {frf.torque_unit})"),
        "configurations": configurations,
    }


def _quality(frf: Frf, index: int) -> dict[str, Any]:
    """Levels per output and the factor per input, in dB: an element's level is the sum of the two."""
    inputs = np.sqrt(np.real(np.diagonal(frf.input_factor[index], axis1=-2, axis2=-1)))
    noise = None
    if frf.noise_covariance is not None:
        noise = np.sqrt(np.real(np.diagonal(frf.noise_covariance[index], axis1=-2, axis2=-1)))
    odd, even = frf.residual_level("odd"), frf.residual_level("even")
    return {
        "factor": _level(inputs),
        "noise": None if noise is None else _level(noise),
        "odd": None if odd is None else _level(odd[index]),
        "even": None if even is None else _level(even[index]),
        "incoherence": None
        if frf.coherence is None or not np.isfinite(frf.coherence[index]).all()
        else [[_rounded(value, 3) for value in row] for row in 1 - frf.coherence[index].T],
    }


def _level(amplitude: FloatArray) -> list[Any]:
    """Amplitudes (n_freq, n_channel) in dB, the frequency axis last."""
    decibels = 20 * np.log10(np.maximum(amplitude, _SMALLEST)).T
    return [[_fixed(value, 1) for value in row] for row in decibels]


def _decibels(response: ComplexArray) -> list[Any]:
    return _per_element(20 * np.log10(np.maximum(np.abs(response), _SMALLEST)), decimals=2)


def _phase(response: ComplexArray) -> list[Any]:
    return _per_element(np.rad2deg(np.angle(response)), decimals=1)


def _per_element(values: FloatArray, digits: int = 4, *, decimals: int | None = None) -> list[Any]:
    """Puts the frequency axis (n_freq, n_out, n_in) last and rounds; not finite becomes null."""
    rows = np.moveaxis(values, 0, -1)
    if decimals is None:
        return [[[_rounded(value, digits) for value in element] for element in row] for row in rows]
    return [[[_fixed(value, decimals) for value in element] for element in row] for row in rows]


def _rounded(value: float | None, digits: int = 5) -> float | None:
    return None if value is None or not np.isfinite(value) else float(f"{value:.{digits}g}")


def _fixed(value: float, decimals: int) -> float | None:
    return round(float(value), decimals) if np.isfinite(value) else None


def _ratio_rows(kinds: tuple[str, ...], rows: tuple[ParameterRow, ...]) -> list[ParameterRow]:
    return [row for row in rows if row.kind in kinds and row.nominal > 0 and row.estimate > 0]


def _ratio_panel(title: str, shown: list[ParameterRow]) -> dict[str, Any]:
    return {
        "title": title,
        "rows": [
            {
                "name": row.name,
                "estimate": _rounded(row.estimate / row.nominal),
                "lower": _rounded(row.lower / row.nominal),
                "upper": _rounded(row.upper / row.nominal),
                "truth": None if row.truth is None else _rounded(row.truth / row.nominal),
                "identifiable": row.identifiable,
                "text": engineering(row.estimate, row.unit, (row.upper - row.lower) / 2),
            }
            for row in shown
        ],
    }


def _cost_data(role: str, rows: tuple[CostRow, ...]) -> dict[str, Any]:
    return {
        "role": role,
        "label": [number_of(row.configuration) for row in rows],
        "cost": [_rounded(row.cost) for row in rows],
        "expected": [_rounded(row.expected_cost) for row in rows],
    }


def _start_data(rows: tuple[StartRow, ...]) -> list[dict[str, Any]]:
    ordered = sorted(rows, key=lambda row: row.cost if np.isfinite(row.cost) else np.inf)
    return [
        {
            "start": number_of(row.index),
            "cost": _rounded(row.cost, 8),
            "minimum": row.minimum_index,
            "status": row.status,
        }
        for row in ordered
    ]
