"""Rows of a fleet that are none of their population."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.fleet.population import Population, population

LEVEL = 0.01
"""Chance that a fleet without any outlier has one accused."""
FEWEST_ROBOTS = 8
"""With fewer robots nobody can tell who is off."""


@dataclass(frozen=True)
class Trait:
    """What the rows of one population are compared by."""

    rows: IntArray  # (n,): indices of the rows that have it
    value: FloatArray  # (n,): its values, logarithms where errors are relative
    std: FloatArray  # (n,): standard deviations of their errors
    only_large: bool = False  # whether a small value is nothing to worry about


@dataclass(frozen=True)
class Outlier:
    """A row that is off its population in a trait."""

    row: int  # index of the row
    trait: int  # index of the trait
    away: float  # by how many standard deviations
    chance: float  # that any row of a fleet without outliers is as far off in any trait, at most


def populations(traits: Sequence[Trait], robots: IntArray) -> tuple[Population | None, ...]:
    """Finds each trait's population; None where fewer than eight robots have it.

    Args:
        traits: The traits.
        robots (n_row,): Number of each row's robot; one that was measured several times counts once.
    """
    return tuple(_population(trait, robots[trait.rows]) for trait in traits)


def find_outliers(
    traits: Sequence[Trait], found: Sequence[Population | None], level: float = LEVEL
) -> tuple[Outlier, ...]:
    """Finds rows that are off their population, the least likely first.

    Args:
        traits: The traits.
        found: Their populations.
        level: Chance that any is found where there is none, whatever the number of rows and traits.

    Source:
        Holm (1979), Scand. J. Statist. 6.
    """
    tested = [(index, trait, about) for index, (trait, about) in enumerate(zip(traits, found, strict=True)) if about]
    if not tested:
        return ()
    chances = [about.chance(trait.value, trait.std, only_large=trait.only_large) for _, trait, about in tested]
    chance = holm(np.concatenate(chances))
    rows = np.concatenate([trait.rows for _, trait, _ in tested])
    away = np.concatenate([about.away(trait.value, trait.std) for _, trait, about in tested])
    of = np.repeat([index for index, _, _ in tested], [len(each) for each in chances])
    kept = np.flatnonzero(chance <= level)
    kept = kept[np.lexsort((-np.abs(away[kept]), chance[kept]))]
    return tuple(Outlier(int(rows[k]), int(of[k]), float(away[k]), float(chance[k])) for k in kept)


def holm(chance: FloatArray) -> FloatArray:
    """Returns chances (n,) adjusted for their number, so that a level holds for all of them together."""
    order = np.argsort(chance, kind="stable")
    raised = np.maximum.accumulate(chance[order] * np.arange(len(chance), 0, -1))
    adjusted = np.empty_like(raised)
    adjusted[order] = np.minimum(raised, 1.0)
    return adjusted


def _population(trait: Trait, robots: IntArray) -> Population | None:
    names, own, times = np.unique(robots, return_inverse=True, return_counts=True)
    return population(trait.value, trait.std, 1 / times[own]) if len(names) >= FEWEST_ROBOTS else None
