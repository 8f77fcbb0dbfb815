"""The data behind the figures, rounded and ready for JSON."""

from __future__ import annotations

from typing import Any

from robid.report.bode import BodeMatrix, bode_data
from robid.report.charts import RatioChart, Skeletons, Waterfall
from robid.report.numbers import rounded
from robid.report.section import AnyFigure, Bars, Curve, Figure


def figure_data(figure: AnyFigure) -> dict[str, Any]:
    """Gathers what the page draws of a figure; `kind` names the script that does it."""
    if isinstance(figure, BodeMatrix):
        return bode_data(figure)
    if isinstance(figure, Skeletons):
        return _skeleton_data(figure)
    if isinstance(figure, Waterfall):
        return _waterfall_data(figure)
    if isinstance(figure, Bars):
        return _bar_data(figure)
    if isinstance(figure, RatioChart):
        return _ratio_data(figure)
    return _curve_data(figure)


def _curve_data(figure: Figure) -> dict[str, Any]:
    return {
        "kind": "curves",
        "x_title": figure.x_title,
        "y_title": figure.y_title,
        "log_x": figure.log_x,
        "log_y": figure.log_y,
        "y_range": figure.y_range,
        "height": figure.height,
        "legend": figure.legend,
        "x_labels": list(figure.x_labels),
        "x_range": figure.x_range,
        "equal": figure.equal,
        "lines": [{"along": line.along, "at": rounded(line.at), "name": line.name} for line in figure.lines],
        "curves": [
            {
                "name": curve.name,
                "x": [rounded(x) for x in curve.x],
                "y": [rounded(y) for y in curve.y],
                **({"texts": list(curve.texts)} if curve.texts else {}),
                **({"points": True, "symbol": curve.symbol} if curve.points else {}),
                **({} if curve.shade is None else {"shade": curve.shade, "dashed": curve.dashed}),
                **(_band(curve) if curve.lower else {}),
            }
            for curve in figure.curves
        ],
    }


def _band(curve: Curve) -> dict[str, list[float | None]]:
    return {"lower": [rounded(y) for y in curve.lower], "upper": [rounded(y) for y in curve.upper]}


def _bar_data(bars: Bars) -> dict[str, Any]:
    return {
        "kind": "bars",
        "value_title": bars.value_title,
        "label_title": bars.label_title,
        "labels": list(bars.labels),
        "flat": bars.flat,
        "parts": [{"name": name, "values": [rounded(value) for value in values]} for name, values in bars.parts],
        "groups": [{"name": name, "count": count} for name, count in bars.groups],
        "marks": [rounded(mark) for mark in bars.marks],
        "mark_title": bars.mark_title,
    }


def _skeleton_data(arms: Skeletons) -> dict[str, Any]:
    def columns(points: tuple[tuple[float, float, float], ...]) -> list[list[float | None]]:
        return [[rounded(value, 4) for value in column] for column in zip(*points, strict=True)]

    return {
        "kind": "skeletons",
        "arms": [
            {"name": name, "weight": rounded(weight, 3), "points": columns(points)}
            for name, points, weight in zip(arms.names, arms.points, arms.weights, strict=True)
        ],
        "others": columns(arms.others),
    }


def _waterfall_data(figure: Waterfall) -> dict[str, Any]:
    return {
        "kind": "waterfall",
        "x_title": figure.x_title,
        "place_title": figure.place_title,
        "y_title": figure.y_title,
        "log_x": figure.log_x,
        "height": figure.height,
        "places": [rounded(place) for place in figure.places],
        "layers": [
            {
                "name": layer.name,
                "drawn": layer.drawn,
                "x": [rounded(x) for x in layer.x],
                "heights": [[rounded(height) for height in curve] for curve in layer.heights],
            }
            for layer in figure.layers
        ],
    }


def _ratio_data(chart: RatioChart) -> dict[str, Any]:
    return {
        "kind": "ratios",
        "interval": chart.interval,
        "panels": [
            {
                "title": title,
                "rows": [
                    {
                        "name": row.name,
                        "estimate": rounded(row.estimate),
                        "lower": rounded(row.lower),
                        "upper": rounded(row.upper),
                        "truth": rounded(row.truth),
                        "identifiable": row.identifiable,
                        "text": row.text,
                    }
                    for row in rows
                ],
            }
            for title, rows in chart.panels
        ],
    }
