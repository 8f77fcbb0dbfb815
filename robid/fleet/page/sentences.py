"""Outliers and drifts in words."""

from __future__ import annotations

import numpy as np

from robid.fleet.comparison import Compared, Comparison
from robid.fleet.drift import Drift
from robid.fleet.outliers import Outlier
from robid.report.numbers import percent, scale_for


def outlier_sentence(comparison: Comparison, outlier: Outlier) -> str:
    """Says what of a row is off, by how much, and how well both are known."""
    of = comparison.compared[outlier.trait]
    if of.population is None:
        message = "an outlier has a population"
        raise RuntimeError(message)
    about, (value, low, high) = of.population, of.interval(outlier.row)
    known = "" if low == high else f" ({_range(of, low, high)})"
    centre = of.natural(about.centre)
    return (
        f"{of.name} is {_number(of, value)}{known}, {_away(of, value, centre)} the fleet's {_number(of, centre)};"
        f" robots differ by {_spread(of, about.spread)}: {deviations(outlier.away)}"
    )


def deviations(away: float) -> str:
    """Writes how far something is off."""
    return f"{abs(away):.2g} deviations" if abs(away) < 100 else f"{abs(away):.0f} deviations"


def short(comparison: Comparison, outlier: Outlier) -> str:
    """Names what of a row is off, as in `gear_a1.stiffness +29 %`."""
    of = comparison.compared[outlier.trait]
    if of.population is None or not of.of.is_logarithmic:
        return of.name
    value, *_ = of.interval(outlier.row)
    ratio = value / of.natural(of.population.centre)
    return f"{of.name} {_factor(ratio)}"


def changes(comparison: Comparison, drift: Drift) -> tuple[str, str]:
    """Writes slope and change of a drift with their intervals."""
    of = comparison.compared[drift.trait]
    slope = _change(of, drift.slope, drift.slope_half_width)
    return f"{slope} a {comparison.robots.time_unit}", _change(of, drift.change, drift.change_half_width)


def centre_and_spread(of: Compared) -> tuple[str, str]:
    """Writes what a population is like."""
    if of.population is None:
        return "", ""
    return _number(of, of.natural(of.population.centre)), _spread(of, of.population.spread)


def known_to(of: Compared) -> str:
    """Writes how well the median row knows its value; nothing of a misfit."""
    return "" if of.of.is_misfit else _spread(of, float(np.median(of.trait.std)))


def _away(of: Compared, value: float, centre: float) -> str:
    side = "above" if value > centre else "below"
    if not of.of.is_logarithmic:
        return f"{_number(of, abs(value - centre))} {side}"
    ratio = value / centre
    return f"{ratio:.3g} times" if ratio > 2 else f"{percent(abs(ratio - 1))} {side}"


def _factor(ratio: float) -> str:
    return f"{ratio:.2g} times" if ratio > 2 else percent(ratio - 1, signed=True)


def _change(of: Compared, change: float, half: float) -> str:
    middle, low, high = (of.change(change + part) for part in (0.0, -half, half))
    if of.of.is_logarithmic:
        return f"{percent(middle, signed=True)} ({percent(low, signed=True)} to {percent(high, signed=True)})"
    scale = scale_for(middle, _unit(of), half)
    return f"{scale.text(middle)} {scale.unit} ({scale.text(low)} to {scale.text(high)})"


def _spread(of: Compared, spread: float) -> str:
    return percent(spread) if of.of.is_logarithmic else _number(of, spread)


def _range(of: Compared, low: float, high: float) -> str:
    scale = scale_for((low + high) / 2, _unit(of), (high - low) / 2)
    return f"{scale.text(low)} to {scale.text(high)}"


def _number(of: Compared, value: float) -> str:
    scale = scale_for(value, _unit(of), abs(value) / 20)
    return f"{scale.text(value)} {scale.unit}".strip()


def _unit(of: Compared) -> str:
    return "" if of.of.unit == "1" else of.of.unit
