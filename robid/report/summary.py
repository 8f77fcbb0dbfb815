"""The few numbers that a reader looks for first, from the rows of a fit."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import fmean, median

from robid.report.content import CostRow, FitContent, ParameterRow, ResonanceRow, StartRow
from robid.report.numbers import percent, significant


@dataclass(frozen=True)
class KeyFigure:
    """A number with what it means.

    Attributes:
        label: What it is.
        value: The number, written out.
        detail: What stands behind it; may be empty.
    """

    label: str
    value: str
    detail: str = ""


def key_figures(fit: FitContent) -> tuple[KeyFigure, ...]:
    """Picks what decides whether a fit can be used."""
    candidates = (
        _identified(fit),
        _half_width(fit),
        _truth_distance(fit.parameters),
        _coverage(fit.parameters),
        _resonance_distance(fit.resonances),
        _cost_figure("Validation cost", fit.validation_costs) or _cost_figure("Estimation cost", fit.estimation_costs),
        _minima(fit),
    )
    return tuple(figure for figure in candidates if figure is not None)


def identified_phrase(fit: FitContent) -> str:
    """Says how many springs, or parameters without any, are identified, and how closely."""
    springs = _springs(fit.parameters)
    chosen = springs or list(fit.parameters)
    noun = ("spring" if springs else "parameter") + ("" if len(chosen) == 1 else "s")
    if fit.grade is not None and fit.grade.value == 0:
        return f"{len(chosen)} {noun} {'was' if len(chosen) == 1 else 'were'} fitted"
    found = sum(row.identifiable and row.identified for row in chosen)
    text = f"{found} of {len(chosen)} {noun} identified"
    half_width = _median_half_width(springs)
    if half_width is None:
        return text
    level = f"{'median, ' if found > 1 else ''}{percent(fit.level)}"
    return f"{text} within ±{percent(half_width)} ({level})"


def average_and_worst(rows: tuple[CostRow, ...]) -> tuple[float, CostRow] | None:
    """Mean cost over the configurations and the row of the largest, or None without rows."""
    if not rows:
        return None
    return fmean(row.cost for row in rows), max(rows, key=lambda row: row.cost)


def resonance_errors(rows: tuple[ResonanceRow, ...]) -> list[tuple[float, ResonanceRow]]:
    """Relative distance of model from measurement, for the rows that have both."""
    return [
        (row.model_hz / row.measured_hz - 1, row)
        for row in rows
        if row.measured_hz is not None and row.model_hz is not None and row.measured_hz > 0
    ]


def _springs(rows: tuple[ParameterRow, ...]) -> list[ParameterRow]:
    return [row for row in rows if row.kind == "stiffness"]


def _identified(fit: FitContent) -> KeyFigure | None:
    if not fit.parameters:
        return None
    chosen = _springs(fit.parameters) or list(fit.parameters)
    what = "Springs identified" if _springs(fit.parameters) else "Parameters identified"
    if fit.grade is not None and fit.grade.value == 0:
        return None
    found = sum(row.identifiable and row.identified for row in chosen)
    every = sum(row.identifiable and row.identified for row in fit.parameters)
    detail = "" if len(chosen) == len(fit.parameters) else f"{every} of {len(fit.parameters)} parameters"
    return KeyFigure(what, f"{found} of {len(chosen)}", detail)


def _half_width(fit: FitContent) -> KeyFigure | None:
    value = _median_half_width(_springs(fit.parameters))
    if value is None:
        return None
    return KeyFigure("Spring interval", f"± {percent(value)}", f"median, {percent(fit.level)} level")


def _median_half_width(springs: list[ParameterRow]) -> float | None:
    widths = [(row.upper - row.lower) / 2 / abs(row.estimate) for row in springs if row.identifiable and row.estimate]
    return median(widths) if widths else None


def _truth_distance(rows: tuple[ParameterRow, ...]) -> KeyFigure | None:
    errors = [abs(row.estimate / row.truth - 1) for row in _springs(rows) if row.identifiable and row.truth]
    if not errors:
        return None
    return KeyFigure("Springs off truth", percent(median(errors)), f"median; worst {percent(max(errors))}")


def _coverage(rows: tuple[ParameterRow, ...]) -> KeyFigure | None:
    known = [row.covered for row in rows if row.identifiable and row.covered is not None]
    if not known:
        return None
    return KeyFigure("Truth in interval", f"{sum(known)} of {len(known)}", "identifiable parameters")


def _resonance_distance(rows: tuple[ResonanceRow, ...]) -> KeyFigure | None:
    errors = [abs(error) for error, _ in resonance_errors(rows)]
    if not errors:
        return None
    return KeyFigure("Resonances off", percent(median(errors)), f"median; worst {percent(max(errors))}")


def _cost_figure(label: str, rows: tuple[CostRow, ...]) -> KeyFigure | None:
    found = average_and_worst(rows)
    if found is None:
        return None
    average, worst = found
    expected = [row.expected_cost for row in rows if row.expected_cost]
    if len(expected) == len(rows):
        ratio = significant(average / fmean(expected), 3)
        worst_ratio = max(row.cost / row.expected_cost for row in rows if row.expected_cost)
        return KeyFigure(f"{label} / noise", ratio, f"average; worst {significant(worst_ratio, 3)}")
    return KeyFigure(label, significant(average, 4), f"average; worst {significant(worst.cost, 4)}")


def _minima(fit: FitContent) -> KeyFigure | None:
    if len(fit.starts) < 2:
        return None
    best = sum(row.minimum_index == 0 for row in fit.starts)
    count = len({row.minimum_index for row in fit.starts})
    detail = "one minimum found" if count == 1 else f"{count} minima found"
    return KeyFigure("Starts at the best", f"{best} of {len(fit.starts)}", detail)


@dataclass(frozen=True)
class Effort:
    """What the starts of a fit cost.

    Attributes:
        median: Median of the points at which a start computed the cost.
        most: Largest number of them.
        cap_share: Share of the starts that the iteration limit ended.
    """

    median: float
    most: int
    cap_share: float


def effort(rows: tuple[StartRow, ...]) -> Effort | None:
    """Returns what the starts cost, nothing where it was not counted."""
    counted = [row.evaluations for row in rows if row.evaluations is not None]
    if not counted:
        return None
    capped = sum(row.status == "iteration_limit" for row in rows)
    return Effort(median(counted), max(counted), capped / len(rows))
