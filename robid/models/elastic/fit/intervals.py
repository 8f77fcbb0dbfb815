"""How far the parameters of a fit may be off, as what predicts and as what is there, and what set the widths."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from robid.arrays import FloatArray
from robid.clusters.evidence import group_clusters
from robid.models.elastic.fit.nuisance.linear import Basis, list_linearised
from robid.models.elastic.fit.physical import (
    ClusterEstimate,
    assumed_errors,
    count_nuisances,
    find_physical,
    shrink,
    weigh_clusters,
    weigh_few,
)
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.fit.solution import Between, NuisanceEstimates, Spread
from robid.models.elastic.fit.uncertainty import Influence, cubic_covariance, influence, structured_covariance

FEWEST_CLUSTERS = 4
"""Number of clusters from which on their differences say how far a parameter may be off."""


@dataclass(frozen=True)
class Spreads:
    """How far the parameters of a fit may be off."""

    effective: Spread  # As what infinitely many clusters of this robot would give: they predict
    physical: Spread  # As springs, dampers and inertias themselves
    assumed: FloatArray  # (n_param, n_param) Covariance by noise and assumed errors alone: what data do not determine
    between: Between | None = None  # How clusters differ; None where they are too few to tell
    nuisances: NuisanceEstimates | None = None  # What clusters say of the nuisances; None where there are none


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
        excess: Cost over what noise and the assumed model error give; above 1 it widens the covariance of few clusters.
        confidence: Level of the intervals.
        basis: What the fit started from, for what the robot file may have wrong; nothing of that when not given.
    """
    clusters = len(group_clusters(problem.frf.configurations))
    rule = assumed_errors(model_error=bool(problem.model_error.any()))
    if clusters < FEWEST_CLUSTERS:
        return _of_few_clusters(problem, internal, found, (excess, rule), confidence, basis)
    differing = f"what {clusters} clusters of configurations differ by"
    near = weigh_clusters(problem, internal, found)
    differ = f"{rule}, and {differing}"
    shrunk = _spread(shrink(problem, internal, found, near), differ, confidence)
    effective = replace(_spread(near, differ, confidence), beside=shrunk)
    pooled = near.pooled
    between = Between(np.sqrt(pooled.between), pooled.degrees_of_freedom, pooled.dependence)
    found_physical = None if basis is None else find_physical(problem, (near.values, internal), basis, confidence)
    if found_physical is None:
        return Spreads(effective, effective, near.pooled.assumed, between)
    return Spreads(effective, found_physical[0], near.pooled.assumed, between, found_physical[1])


def _of_few_clusters(
    problem: Problem,
    internal: FloatArray,
    found: Influence,
    widened: tuple[float, str],
    confidence: float,
    basis: Basis | None,
) -> Spreads:
    """What noise and assumed errors give, widened by the misfit: too few clusters to see what they differ by."""
    excess, rule = widened
    covariance = structured_covariance(problem, found) + cubic_covariance(
        problem, internal, found.inverse, found.weighted
    )
    covariance *= max(1.0, excess)
    source = rule if excess <= 1 else f"{rule}, widened by the misfit"
    spread = Spread(internal, covariance, np.full(internal.size, np.inf), source)
    nuisances = None if basis is None or not basis.rested else list_linearised(problem, (internal,), basis)
    if nuisances is None:
        return Spreads(spread, spread, covariance)
    far = weigh_few(nuisances, influence(nuisances.problem, internal), max(1.0, excess))
    source = f"{source}, and {count_nuisances(nuisances)}"
    size = internal.size
    half = norm.ppf(0.5 + 0.5 * confidence) * np.sqrt(np.diag(far.pooled.assumed))[size:]
    physical = Spread(far.values, far.pooled.assumed[:size, :size], spread.degrees_of_freedom, source)
    told = nuisances.estimated(far.amounts, np.asarray(half), far.pooled.assumed)
    return Spreads(spread, physical, covariance, nuisances=told)


def _spread(estimate: ClusterEstimate, rule: str, confidence: float) -> Spread:
    size = estimate.values.size
    covariance, freedom = estimate.pooled.spread(confidence)
    return Spread(estimate.values, covariance[:size, :size], freedom[:size], rule)
