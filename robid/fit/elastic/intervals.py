"""How far the parameters of a fit may be off, as what predicts and as what is there, and what set the widths."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t

from robid.arrays import FloatArray
from robid.fit.elastic.cubic_uncertainty import load_doubt
from robid.fit.elastic.effective import find_effective
from robid.fit.elastic.problem import Problem
from robid.fit.elastic.solution import Between
from robid.fit.elastic.uncertainty import Influence, structured_covariance
from robid.places.grouping import group_places
from robid.places.pooling import Pooled

FEWEST_PLACES = 4
"""Number of places from which on their differences say how far a parameter may be off."""


@dataclass(frozen=True)
class Spread:
    """Internal parameters and how far they may be off.

    Attributes:
        values (n_param,): Middle of their intervals.
        covariance (n_param, n_param): Their covariance, without any quantile.
        degrees_of_freedom (n_param,): What the quantile of each interval follows, infinite for the normal one.
        rule: What set the width, in words.
    """

    values: FloatArray
    covariance: FloatArray
    degrees_of_freedom: FloatArray
    rule: str

    @property
    def std(self) -> FloatArray:
        """Standard deviation (n_param,) of each."""
        return np.sqrt(np.diag(self.covariance))

    def reach(self, confidence: float) -> FloatArray:
        """Half width (n_param,) of the intervals of a level."""
        return np.asarray(t.ppf(0.5 + 0.5 * confidence, self.degrees_of_freedom) * self.std)


@dataclass(frozen=True)
class Spreads:
    """How far the parameters of a fit may be off.

    Attributes:
        effective: As what infinitely many places of this robot would give: they predict.
        physical: As springs, dampers and inertias themselves.
        assumed (n_param, n_param): Covariance by noise and assumed errors alone: what the data do not determine.
        between: How places differ; None where they are too few to tell.
    """

    effective: Spread
    physical: Spread
    assumed: FloatArray
    between: Between | None = None


def find_spreads(
    problem: Problem, internal: FloatArray, found: Influence, excess: float, confidence: float, beyond: FloatArray
) -> Spreads:
    """Finds how far a fit's parameters may be off.

    Args:
        problem: The problem, at its minimum.
        internal (n_param,): The minimum.
        found: The estimator linearised there.
        excess: Cost over what noise and the assumed model error give; above 1 it widens the covariance of few places.
        confidence: Level of the intervals.
        beyond (n_param, n_param): Covariance by what the rigid parameters leave open, zero where they are the file's.
    """
    places = len(group_places(problem.frf.configurations))
    rule = "noise and assumed model error" if problem.model_error.any() else "noise"
    if places < FEWEST_PLACES or not (problem.frf.element_variance().any() or problem.model_error.any()):
        spread = _of_few_places(problem, internal, found, excess, rule)
        return Spreads(spread, _with(spread, beyond), spread.covariance)
    effective = find_effective(problem, internal, found)
    spread = _spread(effective.values, effective.pooled, f"{rule}, and what {places} places differ by", confidence)
    return Spreads(spread, _with(spread, beyond), effective.pooled.assumed, between_places(effective.pooled))


def _of_few_places(problem: Problem, internal: FloatArray, found: Influence, excess: float, rule: str) -> Spread:
    """What noise and assumed errors give, widened by the misfit: too few places to see what they differ by."""
    covariance = structured_covariance(problem, found) * max(1.0, excess)
    covariance += load_doubt(problem, internal, found.inverse, found.weighted)
    widened = rule if excess <= 1 else f"{rule}, widened by the misfit"
    return Spread(internal, covariance, np.full(internal.size, np.inf), widened)


def _with(spread: Spread, beyond: FloatArray) -> Spread:
    rule = f"{spread.rule}, and what the rigid fit leaves open" if beyond.any() else spread.rule
    return replace(spread, covariance=spread.covariance + beyond, rule=rule)


def _spread(values: FloatArray, pooled: Pooled, rule: str, confidence: float) -> Spread:
    size = values.size
    covariance, freedom = pooled.spread(confidence)
    return Spread(values, covariance[:size, :size], freedom[:size], rule)


def between_places(pooled: Pooled) -> Between:
    """Takes what places say of each parameter's differences."""
    return Between(np.sqrt(pooled.between), pooled.degrees_of_freedom, pooled.dependence)
