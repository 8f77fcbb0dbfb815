"""How far the parameters of a fit may be off, as what predicts and as what is there, and what set the widths."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from robid.arrays import FloatArray
from robid.clusters.evidence import group_places
from robid.models.elastic.fit.nuisance.named import Basis, name_doubts
from robid.models.elastic.fit.physical import (
    Settled,
    assumed_errors,
    find_physical,
    settle,
    shrink,
    told_doubts,
    weigh_few,
)
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.fit.solution import Between, NamedDoubts, Spread
from robid.models.elastic.fit.uncertainty import Influence, influence, load_doubt, structured_covariance

FEWEST_PLACES = 4
"""Number of places from which on their differences say how far a parameter may be off."""


@dataclass(frozen=True)
class Spreads:
    """How far the parameters of a fit may be off.

    Attributes:
        effective: As what infinitely many places of this robot would give: they predict.
        physical: As springs, dampers and inertias themselves.
        assumed (n_param, n_param): Covariance by noise and assumed errors alone: what the data do not determine.
        between: How places differ; None where they are too few to tell.
        doubts: What places say of the doubts; None where there are none.
    """

    effective: Spread
    physical: Spread
    assumed: FloatArray
    between: Between | None = None
    doubts: NamedDoubts | None = None


def find_spreads(
    problem: Problem,
    internal: FloatArray,
    found: Influence,
    excess: float,
    confidence: float,
    basis: Basis | None = None,
) -> Spreads:
    """Finds how far a fit's parameters may be off.

    Args:
        problem: The problem, at its minimum.
        internal (n_param,): The minimum.
        found: The estimator linearised there.
        excess: Cost over what noise and the assumed model error give; above 1 it widens the covariance of few places.
        confidence: Level of the intervals.
        basis: What the fit started from, for what the robot file may have wrong; nothing of that when not given.
    """
    places = len(group_places(problem.frf.configurations))
    rule = assumed_errors(model_error=bool(problem.model_error.any()))
    if places < FEWEST_PLACES:
        return _of_few_places(problem, internal, found, (excess, rule), confidence, basis)
    differing = f"what {places} places differ by"
    near = settle(problem, internal, found)
    differ = f"{rule}, and {differing}"
    shrunk = _spread(shrink(problem, internal, found, near), differ, confidence)
    effective = replace(_spread(near, differ, confidence), beside=shrunk)
    pooled = near.pooled
    between = Between(np.sqrt(pooled.between), pooled.degrees_of_freedom, pooled.dependence)
    found_physical = None if basis is None else find_physical(problem, (near.values, internal), basis, confidence)
    if found_physical is None:
        return Spreads(effective, effective, near.pooled.assumed, between)
    return Spreads(effective, found_physical[0], near.pooled.assumed, between, found_physical[1])


def _of_few_places(
    problem: Problem,
    internal: FloatArray,
    found: Influence,
    widened: tuple[float, str],
    confidence: float,
    basis: Basis | None,
) -> Spreads:
    """What noise and assumed errors give, widened by the misfit: too few places to see what they differ by."""
    excess, rule = widened
    covariance = structured_covariance(problem, found) + load_doubt(problem, internal, found.inverse, found.weighted)
    covariance *= max(1.0, excess)
    told = rule if excess <= 1 else f"{rule}, widened by the misfit"
    spread = Spread(internal, covariance, np.full(internal.size, np.inf), told)
    doubts = None if basis is None or not basis.rested else name_doubts(problem, (internal,), basis)
    if doubts is None:
        return Spreads(spread, spread, covariance)
    far = weigh_few(doubts, influence(doubts.problem, internal), max(1.0, excess))
    told = f"{told}, and {told_doubts(doubts)}"
    size = internal.size
    half = norm.ppf(0.5 + 0.5 * confidence) * np.sqrt(np.diag(far.pooled.assumed))[size:]
    physical = Spread(far.values, far.pooled.assumed[:size, :size], spread.degrees_of_freedom, told)
    return Spreads(spread, physical, covariance, doubts=doubts.estimated(far.amounts, np.asarray(half)))


def _spread(settled: Settled, rule: str, confidence: float) -> Spread:
    size = settled.values.size
    covariance, freedom = settled.pooled.spread(confidence)
    return Spread(settled.values, covariance[:size, :size], freedom[:size], rule)
