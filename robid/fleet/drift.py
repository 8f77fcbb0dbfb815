"""Robots that change between measurements of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
from scipy.optimize import brentq
from scipy.stats import chi2, t

from robid.arrays import FloatArray, IntArray
from robid.fleet.population import LEVEL, Trait, holm

_LEAST = 2
_ROUNDING = 1e-12
_EFFICIENCY = 0.5
"""Of a median beside a mean, in degrees of freedom."""
_CONFIDENCE = 0.95


@dataclass(frozen=True)
class Drift:
    """How a robot's trait changes."""

    robot: int  # number of the robot
    trait: int  # index of the trait
    slope: float  # change per unit of time
    slope_half_width: float  # half width of its interval, of 95 %
    change: float  # over all of the robot's measurements
    change_half_width: float  # half width of its interval
    count: int  # how many these are
    chance: float  # that any robot of a fleet that does not change seems to change as clearly, at most


def find_drifts(traits: Sequence[Trait], robots: IntArray, time: FloatArray, level: float = LEVEL) -> tuple[Drift, ...]:
    """Finds robots that were measured several times and change, the least likely to be chance first.

    A line is laid through each robot's values. They scatter by their own errors and by what measurements of one robot
    differ from day to day. The scatter of half of the robots about their lines tells that; of two measurements it is
    the difference: where all robots have but two, most of them must not change. Where small values are nothing to worry
    about, neither are values that fall. Each row (n_row,) has the number of its robot and a time, of which only
    differences count; `level` is the chance that any is found where there is none, whatever the number of robots and
    traits.
    """
    lines = [_lines(trait, robots, time) for trait in traits]
    chance = holm(np.concatenate([each.chance for each in lines])) if lines else np.zeros(0)
    of = np.repeat(np.arange(len(lines)), [len(each.chance) for each in lines])
    place = np.concatenate([np.arange(len(each.chance)) for each in lines]) if lines else np.zeros(0, int)
    kept = np.flatnonzero(chance <= level)
    kept = kept[np.argsort(chance[kept], kind="stable")]
    return tuple(lines[of[k]].drift(int(place[k]), int(of[k]), float(chance[k])) for k in kept)


def followed(traits: Sequence[Trait], robots: IntArray, time: FloatArray) -> IntArray:
    """Returns the numbers of robots that have values at different times in any trait: those that can drift."""
    found = [_repeated(trait, robots, time) for trait in traits]
    return reduce(np.union1d, [names[last > first] for names, _, first, last in found], np.zeros(0, int))


def repeat_spread(measured: Measured) -> float:
    """Standard deviation between measurements of one robot beyond their errors, whatever a minority of robots shows."""

    def excess(spread: float) -> float:
        return float(np.median(measured.luck(spread))) - 0.5

    most = 10 * float(np.ptp(measured.value - measured.level))
    least = 1e-9 * most
    return 0.0 if most == 0 or excess(least) <= 0 else float(brentq(excess, least, most, rtol=1e-6))


@dataclass(frozen=True)
class Measured:
    """All measurements (n,) of a trait on robots that have two at least, at different times."""

    robot: IntArray  # (n,): index of the robot of each
    time: FloatArray  # (n,): when
    value: FloatArray  # (n,): values
    std: FloatArray  # (n,): standard deviations of their errors
    level: FloatArray  # (n,): first value of each one's robot
    count: IntArray  # (n_robot,): measurements of each robot

    @property
    def freedom(self) -> IntArray:
        """Degrees of freedom (n_robot,) of the scatter; of two measurements it is that of their difference."""
        return np.maximum(self.count - 2, 1)

    def sums(self, numbers: FloatArray) -> FloatArray:
        """Returns the sum over each robot's measurements (n_robot,)."""
        return np.bincount(self.robot, numbers, len(self.count)).astype(float)

    def line(self, spread: float) -> tuple[FloatArray, FloatArray]:
        """Returns each robot's slope (n_robot,) and its standard deviation."""
        precision, away = self._about_mean(self.time, spread)
        size = self.sums(precision * away**2)
        return self.sums(precision * away * (self.value - self.level)) / size, 1 / np.sqrt(size)

    def luck(self, spread: float) -> FloatArray:
        """Returns the chance (n_robot,) of as little scatter as there is about the line."""
        precision, left = self._about_mean(self.value - self.level, spread)
        slope = np.where(self.count > _LEAST, self.line(spread)[0], 0.0)
        left = left - slope[self.robot] * self._about_mean(self.time, spread)[1]
        return np.asarray(chi2.cdf(self.sums(precision * left**2), self.freedom))

    def _about_mean(self, numbers: FloatArray, spread: float) -> tuple[FloatArray, FloatArray]:
        precision = 1 / (self.std**2 + spread**2)
        mean = self.sums(precision * numbers) / self.sums(precision)
        return precision, numbers - mean[self.robot]


@dataclass(frozen=True)
class _Lines:
    """Lines through the measurements of several robots (n_robot,), and the degrees of freedom of their scatter."""

    robot: IntArray
    slope: FloatArray
    std: FloatArray
    length: FloatArray
    count: IntArray
    freedom: float
    only_large: bool

    @property
    def chance(self) -> FloatArray:
        if self.only_large:
            return np.asarray(t.sf(self.slope / self.std, self.freedom))
        return np.asarray(2 * t.sf(np.abs(self.slope) / self.std, self.freedom))

    def drift(self, place: int, trait: int, chance: float) -> Drift:
        slope, length = float(self.slope[place]), float(self.length[place])
        half = float(self.std[place] * t.ppf(0.5 + 0.5 * _CONFIDENCE, self.freedom))
        change = slope * length, half * length
        return Drift(int(self.robot[place]), trait, slope, half, *change, int(self.count[place]), chance)


def _repeated(trait: Trait, robots: IntArray, time: FloatArray) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """A trait's robots, which of them each row is, and their first and last times."""
    names, index = np.unique(robots[trait.rows], return_inverse=True)
    first, last = np.full(len(names), np.inf), np.full(len(names), -np.inf)
    np.minimum.at(first, index, time[trait.rows])
    np.maximum.at(last, index, time[trait.rows])
    return names, index, first, last


def _lines(trait: Trait, robots: IntArray, time: FloatArray) -> _Lines:
    names, index, first, last = _repeated(trait, robots, time)
    when = time[trait.rows]
    repeated = last > first
    chosen = repeated[index]
    kept = np.unique(index[chosen])
    nothing = np.zeros(0)
    if not kept.size:
        return _Lines(np.zeros(0, int), nothing, nothing, nothing, np.zeros(0, int), 1.0, trait.only_large)
    robot = np.searchsorted(kept, index[chosen])
    measured = _measured(robot, when[chosen] - first[index][chosen], trait.value[chosen], trait.std[chosen])
    slope, std = measured.line(repeat_spread(measured))
    freedom = _EFFICIENCY * float(measured.freedom.sum())
    return _Lines(names[kept], slope, std, (last - first)[kept], measured.count, freedom, trait.only_large)


def _measured(robot: IntArray, time: FloatArray, value: FloatArray, std: FloatArray) -> Measured:
    count = np.bincount(robot)
    level = np.empty(len(count))
    level[robot[::-1]] = value[::-1]
    least = _ROUNDING * max(float(np.abs(value).max()), 1.0)
    return Measured(robot, time, value, np.maximum(std, least), level[robot], count)
