"""Robots that change between measurements of them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.stats import chi2, t

from robid.arrays import FloatArray
from robid.validation.fleet.outliers import LEVEL, Figure, holm

_LEAST = 2
_ROUNDING = 1e-12
_EFFICIENCY = 0.5
"""Of a median beside a mean, in degrees of freedom."""


@dataclass(frozen=True)
class Drift:
    """How a robot's figure changes.

    Attributes:
        robot: The robot.
        figure: Name of the figure.
        slope: Change per unit of time.
        slope_std: Its standard deviation.
        change: Over all of the robot's measurements.
        count: How many these are.
        chance: That any robot of a fleet that does not change seems to change as clearly, at most.
    """

    robot: str
    figure: str
    slope: float
    slope_std: float
    change: float
    count: int
    chance: float

    @property
    def is_clear(self) -> bool:
        """Whether it is more than chance, at the level of a fleet."""
        return self.chance <= LEVEL


def find_drifts(figures: Sequence[Figure], robots: Sequence[str], time: FloatArray) -> tuple[Drift, ...]:
    """Finds how robots that were measured several times change, the least likely to be chance first.

    A line is laid through each robot's values. They scatter by their own errors and by what measurements of one robot
    differ from day to day. The scatter of half of the robots about their lines tells that; of two measurements it is
    the difference: where all robots have but two, most of them must not change.

    Args:
        figures: The figures.
        robots: Name of each row's robot.
        time (n_row,): When each row was measured; only differences count.
    """
    drifts = [each for figure in figures for each in _drifts(figure, robots, time)]
    adjusted = holm(np.array([each.chance for each in drifts]))
    told = [Drift(**{**vars(each), "chance": float(chance)}) for each, chance in zip(drifts, adjusted, strict=True)]
    return tuple(sorted(told, key=lambda each: each.chance))


def repeat_spread(measured: Sequence[_Measured]) -> float:
    """Standard deviation between measurements of one robot beyond their errors, whatever a minority of robots shows."""

    def excess(spread: float) -> float:
        return float(np.median([each.luck(spread) for each in measured])) - 0.5

    most = 10 * max((float(np.ptp(each.value)) for each in measured), default=0.0)
    least = 1e-9 * most
    return 0.0 if most == 0 or excess(least) <= 0 else float(brentq(excess, least, most, rtol=1e-6))


@dataclass(frozen=True)
class _Measured:
    """Measurements (n,) of one robot, two at least; of two, nobody knows a line's scatter, so they have none."""

    robot: str
    time: FloatArray
    value: FloatArray
    std: FloatArray

    @property
    def freedom(self) -> int:
        return max(len(self.time) - 2, 1)

    def line(self, spread: float) -> tuple[float, float]:
        """Slope and its standard deviation."""
        precision, away = self._about_mean(self.time, spread)
        size = float(precision @ away**2)
        return float((precision * away) @ self.value) / size, 1 / np.sqrt(size)

    def luck(self, spread: float) -> float:
        """Chance of as little scatter as there is about the line."""
        precision, left = self._about_mean(self.value, spread)
        if len(self.time) > _LEAST:
            left = left - self.line(spread)[0] * self._about_mean(self.time, spread)[1]
        return float(chi2.cdf(precision @ left**2, self.freedom))

    def _about_mean(self, numbers: FloatArray, spread: float) -> tuple[FloatArray, FloatArray]:
        precision = 1 / (np.maximum(self.std, _ROUNDING * max(float(np.abs(self.value).max()), 1.0)) ** 2 + spread**2)
        return precision, numbers - precision @ numbers / precision.sum()


def _drifts(figure: Figure, robots: Sequence[str], time: FloatArray) -> list[Drift]:
    rows = defaultdict(list)
    for row in np.flatnonzero(figure.known).tolist():
        rows[robots[row]].append(row)
    measured = [
        _Measured(robot, time[own], figure.value[own], figure.std[own])
        for robot, own in rows.items()
        if np.ptp(time[own]) > 0
    ]
    spread = repeat_spread(measured)
    freedom = _EFFICIENCY * sum(each.freedom for each in measured)
    return [_drift(figure.name, each, spread, freedom) for each in measured]


def _drift(name: str, measured: _Measured, spread: float, freedom: float) -> Drift:
    slope, std = measured.line(spread)
    chance = float(2 * t.sf(abs(slope) / std, freedom))
    return Drift(measured.robot, name, slope, std, slope * float(np.ptp(measured.time)), len(measured.time), chance)
