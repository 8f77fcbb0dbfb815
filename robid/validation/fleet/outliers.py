"""Rows of a fleet that are none of their population."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.validation.fleet.population import Population, population

LEVEL = 0.01
"""Chance that a fleet without any outlier has one accused."""
FEWEST_ROBOTS = 8
"""With fewer robots nobody can tell who is off."""


@dataclass(frozen=True)
class Trait:
    """What the rows of one population are compared by.

    Attributes:
        rows (n,): Indices of the rows that have it.
        value (n,): Its values, logarithms where errors are relative.
        std (n,): Standard deviations of their errors.
        only_large: Whether a small value is nothing to worry about.
    """

    rows: IntArray
    value: FloatArray
    std: FloatArray
    only_large: bool = False


@dataclass(frozen=True)
class Outlier:
    """A row that is off its population in a trait.

    Attributes:
        row: Index of the row.
        trait: Index of the trait.
        away: By how many standard deviations.
        chance: That any row of a fleet without outliers is as far off in any trait, at most.
    """

    row: int
    trait: int
    away: float
    chance: float


def populations(traits: Sequence[Trait], robots: IntArray) -> tuple[Population, ...]:
    """Finds each trait's population.

    Args:
        traits: The traits.
        robots (n_row,): Number of each row's robot; one that was measured several times counts once.
    """
    return tuple(_population(trait, robots[trait.rows]) for trait in traits)


def away_of(trait: Trait, about: Population) -> FloatArray | None:
    """Returns by how many deviations each value (n,) is off; None where too few robots tell."""
    if about.robots < FEWEST_ROBOTS or about.degrees_of_freedom <= 0:
        return None
    return about.away(trait.value, trait.std)


def find_outliers(
    traits: Sequence[Trait], found: Sequence[Population], level: float = LEVEL
) -> tuple[Outlier, ...]:
    """Finds rows that are off their population, the least likely first.

    Args:
        traits: The traits.
        found: Their populations.
        level: Chance that any is found where there is none, whatever the number of rows and traits.

    Source:
        Holm (1979), Scand. J. Statist. 6.
    """
    away = [away_of(*each) for each in zip(traits, found, strict=True)]
    tested = [index for index, each in enumerate(away) if each is not None]
    if not tested:
        return ()
    chances = [
        found[index].chance(traits[index].value, traits[index].std, only_large=traits[index].only_large)
        for index in tested
    ]
    chance = holm(np.concatenate(chances))
    rows = np.concatenate([traits[index].rows for index in tested])
    far = np.concatenate([np.asarray(away[index]) for index in tested])
    of = np.repeat(tested, [len(each) for each in chances])
    kept = np.flatnonzero(chance <= level)
    kept = kept[np.lexsort((-np.abs(far[kept]), chance[kept]))]
    return tuple(Outlier(int(rows[k]), int(of[k]), float(far[k]), float(chance[k])) for k in kept)


def holm(chance: FloatArray) -> FloatArray:
    """Returns chances (n,) adjusted for their number, so that a level holds for all of them together."""
    order = np.argsort(chance, kind="stable")
    raised = np.maximum.accumulate(chance[order] * np.arange(len(chance), 0, -1))
    adjusted = np.empty_like(raised)
    adjusted[order] = np.minimum(raised, 1.0)
    return adjusted


def _population(trait: Trait, robots: IntArray) -> Population:
    _, own, times = np.unique(robots, return_inverse=True, return_counts=True)
    return population(trait.value, trait.std, 1 / times[own])
