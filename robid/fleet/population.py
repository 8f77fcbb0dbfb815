"""What a population of robots is like in one figure, whatever a minority shows, and rows that are none of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.stats import chi2, norm, t

from robid.arrays import BoolArray, FloatArray, IntArray

_HALF = float(norm.ppf(0.75))
_FAR = 3.0
_LEFT = 1 - 2 * _FAR * norm.pdf(_FAR) / (2 * norm.cdf(_FAR) - 1)
"""Variance of what a normal distribution has within these limits."""

_ROUNDS = 50
_ROUNDING = 1e-12
_INSIDE = 0.4
"""Share of all robots that a value is compared with at least: those nearest to the centre."""
_SEARCHED = 2
"""Robots that tell nothing of the scatter: one for the centre, one because the farthest were searched for."""
_SAME = 1e-9
"""Distances that differ by as little are the same."""
_LUCK = 0.05
"""Chance of as little scatter as there is, at the upper end of the spread's interval."""


@dataclass(frozen=True)
class Population:
    """A figure of a population."""

    centre: float  # its mean
    centre_std: float  # standard deviation of that
    spread: float  # standard deviation of the figure itself between robots, errors of measurement apart
    spread_high: float  # upper end of its interval, of 95 % to one side
    kept: BoolArray  # (n,): which of the values it was found from
    weight: FloatArray  # (n,): how much each value counts; a robot that was measured several times counts once

    @property
    def robots(self) -> int:
        """Number of robots that it was found from."""
        return round(float(self.weight.sum()))

    def away(self, value: FloatArray, std: FloatArray) -> FloatArray:
        """Returns by how many standard deviations values (n,) that are known to `std` (n,) are off the centre."""
        return np.asarray((value - self.centre) / np.sqrt(self.spread**2 + std**2 + self.centre_std**2))

    def chance(self, value: FloatArray, std: FloatArray, *, only_large: bool = False) -> FloatArray:
        """Returns the chance (n,) that a robot of this population is as far off, to both sides or above it alone.

        Each value is held against those nearer to the centre alone, whose own scatter says what is far. Thus neither
        other strangers hide it, nor does a cut that left out too much accuse it. A value that lies beyond a stranger is
        one as well. Of the spread only what it makes of different errors counts: the most that it may be, so that a
        well known value is not off because the spread was found too small. The population was found from these values
        (n,) of known deviations (n,); with `only_large` a small value is nothing to worry about.

        Source:
            Rosner (1983), Technometrics 25, with deleted residuals, one degree of freedom less;
            Viechtbauer (2007), Stat. Med. 26, for the interval of the spread.
        """
        std = _at_least_rounding(value, std)
        away, variance = value - self.centre, self.spread_high**2 + std**2
        distance = np.abs(away) / np.sqrt(variance)
        order = np.argsort(distance, kind="stable")
        nearer = np.searchsorted(distance[order], distance[order] * (1 - _SAME))
        precision = self.weight / variance
        summed = np.stack([self.weight, precision, precision * away, precision * away**2])[:, order]
        count, size, first, second = np.pad(np.cumsum(summed, axis=1), ((0, 0), (1, 0)))[:, nearer]
        told = (count > _SEARCHED) & (count >= _INSIDE * self.weight.sum() * (1 - _SAME))
        count, size, mean, second = count[told], size[told], first[told] / size[told], second[told]
        own = order[told]
        scale = np.maximum(second - size * mean**2, 0.0) / (count - 1)
        deviation = np.sqrt(np.maximum(scale * variance[own], std[own] ** 2) + scale / size)
        off = (away[own] - mean) / deviation
        chance = t.sf(off, count - _SEARCHED) if only_large else 2 * t.sf(np.abs(off), count - _SEARCHED)
        found = np.ones(len(value))
        found[own] = np.where((off > 0) | (not only_large), np.minimum.accumulate(chance), 1.0)
        return found


def population(value: FloatArray, std: FloatArray, weight: FloatArray | None = None) -> Population:
    """Finds the centre and the spread of a population from values of known errors.

    Values are normal about the centre, with the variance of the population and that of their own error. The search
    begins with the weighted median and the spread for which half of the values lie within their quartiles; then values
    beyond three deviations are left out, and mean and variance of the others are those of maximum likelihood and of
    Paule and Mandel, corrected for what was cut off, until nothing changes. Values (n,) are logarithms where errors are
    relative; a robot that was measured several times counts once by its weights (n,). With less than three robots
    nothing is said to be outside.

    Source:
        Paule and Mandel (1982), J. Res. NBS 87; Rousseeuw and Leroy (1987), sec. 5.1, for the reweighting.
    """
    weight = np.ones(len(value)) if weight is None else weight
    std = _at_least_rounding(value, std)
    # Centre and spread by median and quartiles, which half of the robots may spoil.
    centre = _median(value, weight)
    for _ in range(3):
        spread = _middle_spread(value - centre, std, weight)
        centre = _median(value, weight / np.sqrt(spread**2 + std**2))
    kept, centre_std = np.ones(len(value), bool), 0.0
    for _ in range(_ROUNDS):
        before = kept
        limit = _FAR * np.sqrt(spread**2 + std**2 + centre_std**2)
        kept = np.abs(value - centre) <= limit
        robots = float(weight[kept].sum()) - 1
        spread = _moment_spread(value[kept], std[kept], weight[kept], robots)
        precision = weight[kept] / (spread**2 + std[kept] ** 2)
        centre = float(precision @ value[kept] / precision.sum())
        centre_std = float(
            np.sqrt((precision**2 / weight[kept] * (spread**2 + std[kept] ** 2)).sum()) / precision.sum()
        )
        if (kept == before).all():
            break
    least = float(chi2.ppf(_LUCK, robots)) if robots > 0 else 0.0
    high = _moment_spread(value[kept], std[kept], weight[kept], least)
    return Population(centre, centre_std, spread, high, kept, weight)


def _at_least_rounding(value: FloatArray, std: FloatArray) -> FloatArray:
    return np.maximum(std, _ROUNDING * max(float(np.abs(value).max(initial=0.0)), 1.0))


def _median(value: FloatArray, weight: FloatArray) -> float:
    order = np.argsort(value)
    share = np.cumsum(weight[order])
    first, last = (int(np.searchsorted(share, half * share[-1])) for half in (0.5 - 1e-12, 0.5 + 1e-12))
    return float(0.5 * (value[order[first]] + value[order[min(last, len(order) - 1)]]))


def _middle_spread(away: FloatArray, std: FloatArray, weight: FloatArray) -> float:
    """The spread for which half of the weight lies within the quartiles of its distribution."""
    return float(np.sqrt(max(_median((away / _HALF) ** 2 - std**2, weight), 0.0)))


def _moment_spread(value: FloatArray, std: FloatArray, weight: FloatArray, squares: float) -> float:
    """The spread for which the weighted squares about the mean add up as stated, but for what was cut off."""
    wanted = _LEFT * squares
    if wanted <= 0:
        return 0.0

    def excess(spread: float) -> float:
        precision = weight / (spread**2 + std**2)
        mean = precision @ value / precision.sum()
        return float(precision @ (value - mean) ** 2 - wanted)

    most = float(np.ptp(value)) * np.sqrt(weight.sum() / wanted)
    least = 1e-9 * most
    return 0.0 if most == 0 or excess(least) <= 0 else float(brentq(excess, least, most, rtol=1e-9))


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
    """Finds each trait's population, each robot of the rows (n_row,) counted once; None of fewer than eight robots."""
    found: list[Population | None] = []
    for trait in traits:
        names, own, times = np.unique(robots[trait.rows], return_inverse=True, return_counts=True)
        enough = len(names) >= FEWEST_ROBOTS
        found.append(population(trait.value, trait.std, 1 / times[own]) if enough else None)
    return tuple(found)


def find_outliers(
    traits: Sequence[Trait], found: Sequence[Population | None], level: float = LEVEL
) -> tuple[Outlier, ...]:
    """Finds rows that are off their population, the least likely first.

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
