"""Rows of a fleet that are none of its population."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.validation.fleet.population import Population, population

LEVEL = 0.01
"""Chance that a fleet without any outlier has one accused."""


@dataclass(frozen=True)
class Figure:
    """A figure of every row.

    Attributes:
        name: What it is.
        value (n_row,): Its values, logarithms where errors are relative; not a number where a row has none.
        std (n_row,): Standard deviations of their errors.
    """

    name: str
    value: FloatArray
    std: FloatArray

    @property
    def known(self) -> BoolArray:
        """Which rows (n_row,) have it."""
        return np.asarray(np.isfinite(self.value) & np.isfinite(self.std))


@dataclass(frozen=True)
class Outlier:
    """A row that is off its population in a figure.

    Attributes:
        row: Index of the row.
        figure: Name of the figure.
        away: By how many standard deviations.
        chance: That any row of a fleet without outliers is as far off in any figure, at most.
    """

    row: int
    figure: str
    away: float
    chance: float


def populations(figures: Sequence[Figure], robots: Sequence[str]) -> tuple[Population | None, ...]:
    """Finds each figure's population; None where no row has it.

    Args:
        figures: The figures.
        robots: Name of each row's robot; one that was measured several times counts once.
    """
    return tuple(_population(figure, robots) for figure in figures)


def find_outliers(
    figures: Sequence[Figure], found: Sequence[Population | None], level: float = LEVEL
) -> tuple[Outlier, ...]:
    """Finds rows that are off their population, the least likely first.

    Args:
        figures: The figures.
        found: Their populations.
        level: Chance that any is found where there is none, whatever the number of rows and figures.

    Source:
        Holm (1979), Scand. J. Statist. 6.
    """
    tests = []
    for figure, about in zip(figures, found, strict=True):
        if about is None or about.degrees_of_freedom <= 0:
            continue
        rows = np.flatnonzero(figure.known)
        away, chance = (each(figure.value[rows], figure.std[rows]) for each in (about.away, about.chance))
        tests += [Outlier(*each) for each in zip(rows.tolist(), [figure.name] * len(rows), away, chance, strict=True)]
    return _significant(tests, level)


def holm(chance: FloatArray) -> FloatArray:
    """Returns chances (n,) adjusted for their number, so that a level holds for all of them together."""
    order = np.argsort(chance, kind="stable")
    raised = np.maximum.accumulate(chance[order] * np.arange(len(chance), 0, -1))
    adjusted = np.empty_like(raised)
    adjusted[order] = np.minimum(raised, 1.0)
    return adjusted


def _significant(tests: Sequence[Outlier], level: float) -> tuple[Outlier, ...]:
    adjusted = holm(np.array([test.chance for test in tests]))
    kept = [
        Outlier(test.row, test.figure, float(test.away), float(chance))
        for test, chance in zip(tests, adjusted, strict=True)
        if chance <= level
    ]
    return tuple(sorted(kept, key=lambda each: (each.chance, -abs(each.away))))


def _population(figure: Figure, robots: Sequence[str]) -> Population | None:
    known = figure.known
    if not known.any():
        return None
    names = [robot for robot, has in zip(robots, known.tolist(), strict=True) if has]
    times = Counter(names)
    weight = np.array([1 / times[name] for name in names])
    return population(figure.value[known], figure.std[known], weight)
