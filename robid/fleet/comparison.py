"""The rows of a fleet against each other: populations, who is off them, who changes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robid.arrays import BoolArray, FloatArray, IntArray
from robid.fleet.collected import Collected, Key
from robid.fleet.drift import Drift, find_drifts, followed
from robid.fleet.outliers import Outlier, Trait, find_outliers, populations
from robid.fleet.population import Population
from robid.fleet.robots import Robots

_QUANTILE = 1.96


@dataclass(frozen=True)
class Compared:
    """A trait of one population, by name."""

    fit: str
    name: str  # the parameter, or the misfit
    group: int  # number of the population
    of: Collected  # its values over all populations
    trait: Trait  # its values in this one
    population: Population | None  # what the population is like in it; None where too few robots tell

    def natural(self, value: float) -> float:
        """Returns a value in its unit."""
        return math.exp(value) if self.of.is_logarithmic else value

    def change(self, difference: float) -> float:
        """Returns a difference as what it changes: relative where the values are compared by logarithms."""
        return math.expm1(difference) if self.of.is_logarithmic else difference

    def interval(self, row: int) -> tuple[float, float, float]:
        """Returns a row's value in its unit and the ends of its interval, of 95 %."""
        place = int(np.searchsorted(self.trait.rows, row))
        value, half = float(self.trait.value[place]), _QUANTILE * float(self.trait.std[place])
        return self.natural(value), self.natural(value - half), self.natural(value + half)


@dataclass(frozen=True)
class Comparison:
    """The rows of a fleet against each other."""

    robots: Robots  # whose measurements the rows are
    compared: tuple[Compared, ...]  # all traits of all populations
    outliers: tuple[Outlier, ...]  # rows that are off, the clearest first, once for each trait
    drifts: tuple[Drift, ...]  # robots that change, the clearest first, once for each trait
    followed: IntArray  # numbers of the robots that have values at different times, so that a change would be seen

    @cached_property
    def off(self) -> dict[int, list[Outlier]]:
        """The rows that are off, the clearest first, each with all that it is off in."""
        found: dict[int, list[Outlier]] = {}
        for outlier in self.outliers:
            found.setdefault(outlier.row, []).append(outlier)
        return found

    @cached_property
    def changing(self) -> dict[int, list[Drift]]:
        """The robots that change, the clearest first, each with all that changes."""
        found: dict[int, list[Drift]] = {}
        for drift in self.drifts:
            found.setdefault(drift.robot, []).append(drift)
        return found

    @cached_property
    def untold(self) -> tuple[int, ...]:
        """Populations in which too few robots tell who is off."""
        told = {each.group for each in self.compared if each.population is not None}
        return tuple(sorted({each.group for each in self.compared} - told))

    @cached_property
    def away(self) -> dict[Key, FloatArray]:
        """By how many deviations each row (n_row,) is off in a parameter; not a number where that is not told."""
        found: dict[Key, FloatArray] = {}
        for each in self.compared:
            if each.population is not None and not each.of.is_misfit:
                whole = found.setdefault((each.fit, each.name), np.full(len(self.robots.robot), np.nan))
                whole[each.trait.rows] = each.population.away(each.trait.value, each.trait.std)
        return found

    @cached_property
    def accused(self) -> frozenset[tuple[int, str, str]]:
        """Row, fit and parameter, or misfit, of all outliers."""
        return frozenset((each.row, *self.names(each.trait)) for each in self.outliers)

    def names(self, trait: int) -> Key:
        """Returns fit and name of a trait."""
        return self.compared[trait].fit, self.compared[trait].name


def compare(found: Mapping[Key, Collected], robots: Robots) -> Comparison:
    """Compares what the rows of a fleet found, each population by itself, all at the level of one fleet.

    Args:
        found: Parameters and misfits over the rows.
        robots: Whose measurements the rows are.
    """
    named = [
        (*key, int(robots.group[trait.rows[0]]), of, trait)
        for key, of in found.items()
        for trait in _by_group(of, robots.group)
    ]
    traits = [trait for *_, trait in named]
    about = populations(traits, robots.robot)
    compared = tuple(Compared(*each, each_about) for each, each_about in zip(named, about, strict=True))
    repeated = np.bincount(robots.robot, minlength=1)[robots.robot] > 1
    lasting = [_where(trait, repeated & np.isfinite(robots.time)) for trait in traits]
    over_time = lasting, robots.robot, robots.time
    return Comparison(robots, compared, find_outliers(traits, about), find_drifts(*over_time), followed(*over_time))


def _by_group(of: Collected, group: IntArray) -> Iterator[Trait]:
    """The values that can be compared, those of each population by themselves."""
    rows, value, std = of.known
    order = np.argsort(group[rows], kind="stable")
    ends = np.flatnonzero(np.diff(group[rows][order])) + 1
    for part in np.split(order, ends):
        if part.size:
            yield Trait(rows[part], value[part], std[part], of.is_misfit)


def _where(trait: Trait, kept: BoolArray) -> Trait:
    own = kept[trait.rows]
    return Trait(trait.rows[own], trait.value[own], trait.std[own], trait.only_large)
