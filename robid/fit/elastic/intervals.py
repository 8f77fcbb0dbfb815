"""How far the parameters of a fit may be off: a plain covariance, its degrees of freedom, and what set them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm, t

from robid.arrays import FloatArray
from robid.fit.elastic.cubic_uncertainty import load_doubt
from robid.fit.elastic.model_error import ModelError
from robid.fit.elastic.problem import Problem
from robid.fit.elastic.uncertainty import Influence, configuration_covariance, structured_covariance
from robid.fit.places import group_places

_FEW_PLACES = 4
MANY_ABOVE = 0.25
"""Share of the elements beyond their covariance from which a model lacks something; 0.05 is expected."""


@dataclass(frozen=True)
class Spread:
    """How far internal parameters may be off.

    Attributes:
        covariance (n_param, n_param): Their covariance, without any quantile.
        degrees_of_freedom (n_param,): What the quantile of each interval follows, infinite for the normal one.
        rule: What set the width, in words.
    """

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


def many_above(error: ModelError | None) -> bool:
    """Whether many elements miss the model by more than their covariance, or with correlated residuals."""
    return error is not None and max(error.share_above, error.share_correlated) > MANY_ABOVE


def find_spread(
    problem: Problem,
    internal: FloatArray,
    found: Influence,
    excess: float,
    error: ModelError | None,
    confidence: float,
    beyond: FloatArray | None = None,
) -> Spread:
    """Finds how far a fit's parameters may be off.

    Args:
        problem: The problem, at its minimum.
        internal (n_param,): The minimum.
        found: The estimator linearised there.
        excess: Cost over what noise and the assumed model error give; above 1 it widens the covariance.
        error: The residuals against their expectation; None without a covariance.
        confidence: Level of the intervals.
        beyond (n_param, n_param): Covariance by what the rigid parameters leave open, if they come from a fit.
    """
    covariance = structured_covariance(problem, found) * max(1.0, excess)
    covariance += load_doubt(problem, internal, found.inverse, found.weighted)
    assumed = "noise and assumed model error" if problem.model_error.any() else "noise"
    rule = assumed if excess <= 1 else f"{assumed}, widened by the misfit"
    if beyond is not None and beyond.any():
        covariance, rule = covariance + beyond, f"{rule}, and what the rigid fit leaves open"
    spread = Spread(covariance, np.full(len(covariance), np.inf), rule)
    if not many_above(error):
        return spread
    places = len(group_places(problem.frf.configurations))
    if places < _FEW_PLACES:
        return Spread(covariance, spread.degrees_of_freedom, f"{rule}; too few places for a jackknife")
    return at_least(spread, configuration_covariance(problem, internal), places, confidence)


def at_least(spread: Spread, jackknife: FloatArray, places: int, confidence: float) -> Spread:
    """Lets no interval be narrower than a jackknife over places says.

    What a jackknife's variance has beyond the spread's is added with the jackknife's own correlations: that of a
    few places alone is singular, and the spread's correlations are those of other errors. An interval follows
    Student's distribution where that of the jackknife alone would be the wider one.

    Args:
        spread: What noise and assumed errors give.
        jackknife (n_param, n_param): Covariance by leaving out places.
        places: Their number.
        confidence: Level of the intervals.
    """
    own, other = np.diag(spread.covariance), np.diag(jackknife)
    share = np.sqrt(np.divide(np.maximum(other - own, 0.0), other, out=np.zeros_like(other), where=other > 0))
    tail = 0.5 + 0.5 * confidence
    wider = t.ppf(tail, places - 1) * np.sqrt(other) > norm.ppf(tail) * np.sqrt(own)
    rule = spread.rule
    if wider.any():
        rule += f"; jackknife over {places} places where that is wider ({wider.sum()} of {wider.size} parameters)"
    freedom = np.where(wider, places - 1.0, spread.degrees_of_freedom)
    return Spread(spread.covariance + jackknife * np.outer(share, share), freedom, rule)
