"""What places agree on, and where a fit lies that leans on what is known where they contradict each other."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray
from robid.clusters.between import estimate_between
from robid.clusters.evidence import Evidence, group_places, summarise
from robid.clusters.pooling import Pooled, pool
from robid.models.elastic.fit.nuisance.named import Named
from robid.models.elastic.fit.optimizers import optimise
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.fit.uncertainty import Influence, influence, load_doubt, score_covariance

_STEPS = 10
LONGEST_STEP = 0.5
"""Of an internal parameter; beyond, nothing is linear, and what is known no better stays."""
_ARRIVED = 1e-2  # of a deviation


@dataclass(frozen=True)
class Settled:
    """What places agree on.

    Attributes:
        values (n_param,): Internal parameters, each place weighed by what noise and differences between places leave of
            its information.
        amounts (n_doubt,): Amounts of the doubts.
        pooled: How far both may be off, parameters first.
    """

    values: FloatArray
    amounts: FloatArray
    pooled: Pooled


def place_evidence(
    problem: Problem, internal: FloatArray, covariance: FloatArray, doubts: Named | None = None
) -> Evidence:
    """What each place says of the internal parameters and of doubts, around a point.

    Args:
        problem: The problem with its weights.
        internal (n_param,): The point.
        covariance (n_conf, n_param + n_doubt, n_param + n_doubt): Covariance of the scores there by what is known of
            the errors. That of another point does not do: along what places hardly see, it would differ most.
        doubts: Further columns; none when not given.

    Source:
        docs/methods, sec. 11.
    """
    error, derivative = problem.linear(internal)
    variance, middle = problem.parameters.prior_std**2, internal
    if doubts is not None:
        error, derivative = doubts.error, np.concatenate([derivative, doubts.columns], axis=-1)
        variance = np.concatenate([variance, doubts.common_std**2])
        middle = np.concatenate([internal, doubts.amounts])
    n_conf, n_param = len(error), derivative.shape[-1]
    adjoint = problem.fully_weighted(derivative).reshape(n_conf, -1, n_param).conj().swapaxes(1, 2)
    bread = 2 * np.real(adjoint @ derivative.reshape(n_conf, -1, n_param))
    score = 2 * np.real(adjoint @ error.reshape(n_conf, -1, 1))[..., 0]
    places = group_places(problem.frf.configurations)
    each, pulls, meat = (
        np.array([values[place].sum(axis=0) for place in places]) for values in (bread, score, covariance)
    )
    return summarise(each, pulls, meat, np.diag(1 / variance), -middle / variance)


def settle(problem: Problem, internal: FloatArray, found: Influence, doubts: Named | None = None) -> Settled:
    """Weighs places by what noise and their differences leave of their information, from the minimum of a fit on.

    Without doubts, that is what predicts other places. With them, places also say what the robot file has wrong, as far
    as their data and what is known of it beforehand tell; that takes a single step, for elsewhere the parameters' own
    derivatives would no longer be those that the doubts go with.

    Args:
        problem: The problem, at its minimum.
        internal (n_param,): The minimum.
        found: The estimator linearised there.
        doubts: Further columns, linearised there; none when not given.
    """
    parameters, size = problem.parameters, internal.size
    given, least = np.full(size, np.nan), None
    if doubts is not None:
        found = _extended(problem, internal, found, doubts)
        given = np.concatenate([given, doubts.place_std**2])
        least = doubts.least_shift
    best, now = np.inf, internal
    for step in range(_STEPS if doubts is None else 1):
        here = influence(problem, now) if step else found
        evidence = place_evidence(problem, now, score_covariance(problem, here), doubts)
        there = pool(evidence, estimate_between(evidence, given).variance, least)
        std = np.sqrt(np.maximum(np.diag(there.covariance), np.diag(there.assumed))[:size])
        known = std <= LONGEST_STEP
        shift = np.abs(known * there.shift[:size])
        if shift.max() >= best:
            break  # where nothing is linear, steps lead nowhere: the last one that was shorter counts
        moved = now + known * np.clip(there.shift[:size], -LONGEST_STEP, LONGEST_STEP)
        best, pooled, now = shift.max(), there, np.clip(moved, parameters.lower, parameters.upper)
        if (shift <= _ARRIVED * std).all():
            break
    assumed = pooled.assumed.copy()
    assumed[:size, :size] += load_doubt(problem, internal, found.inverse, found.weighted[..., :size])
    amounts = np.zeros(0) if doubts is None else doubts.amounts + pooled.shift[size:]
    return Settled(now, amounts, replace(pooled, assumed=assumed))


def weigh_few(named: Named, found: Influence, excess: float) -> Settled:
    """Weighs places too few to see what they differ by: a single step, each with its noise and its part of the doubts.

    Args:
        named: The problem and its doubts, linearised at the minimum.
        found: The estimator linearised there.
        excess: By how much the misfit widens the covariance of noise and assumed errors; at least 1.
    """
    problem, internal, size = named.problem, named.point, named.point.size
    covariance = excess * score_covariance(problem, _extended(problem, internal, found, named))
    between = np.concatenate([np.zeros(size), named.place_std**2])
    pooled = pool(place_evidence(problem, internal, covariance, named), between, named.least_shift)
    step = np.clip(pooled.shift[:size], -LONGEST_STEP, LONGEST_STEP)
    values = np.clip(internal + step, problem.parameters.lower, problem.parameters.upper)
    assumed = pooled.assumed.copy()
    assumed[:size, :size] += excess * load_doubt(problem, internal, found.inverse, found.weighted)
    return Settled(values, named.amounts + pooled.shift[size:], replace(pooled, assumed=assumed))


def _extended(problem: Problem, internal: FloatArray, found: Influence, doubts: Named) -> Influence:
    """What errors pull at doubts too."""
    weighted = problem.fully_weighted(doubts.columns)
    gain = weighted / problem.residual_kind.divisor(problem.measured(internal)).conj()[..., None]
    return replace(
        found,
        gain=np.concatenate([found.gain, gain], axis=-1),
        weighted=np.concatenate([found.weighted, weighted], axis=-1),
    )


_ITERATIONS = 60
_NEAR = 1.5  # of an internal logarithm: nothing leads back to the file's values from far beyond


def lean(problem: Problem, internal: FloatArray, found: Influence, near: Settled) -> Settled:
    """Settles places once more from where what is known beforehand counts for more.

    A model that lacks something is contradicted by the places far more than noise would make them; then a plain
    minimum lets what the data hardly tell run off for next to nothing, and the other parameters follow it. Here, the
    data count as much less as the places' differences raise the variance of a typical parameter over that by noise.

    Args:
        problem: The problem, at its minimum.
        internal (n_param,): The minimum.
        found: The estimator linearised there.
        near: What places agree on, from there on.

    Source:
        Power likelihood of a misspecified model, as in Holmes and Walker (2017), with the weight by the places.
    """
    noise = 0.5 * np.diag(found.inverse)
    times = max(1.0, float(np.median(np.diag(near.pooled.assumed)[: noise.size] / noise)))
    known = replace(problem.parameters, prior_std=problem.parameters.prior_std / np.sqrt(times))
    start = np.where(known.logarithmic, np.clip(internal, -_NEAR, _NEAR), internal)
    there = optimise(replace(problem, parameters=known), start, max_iterations=_ITERATIONS).parameters
    return settle(problem, there, influence(problem, there))
