"""What places say of the parameters of a fit, and the values that they agree on."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray
from robid.fit.elastic.cubic_uncertainty import load_doubt
from robid.fit.elastic.problem import Problem
from robid.fit.elastic.uncertainty import Influence, score_covariance
from robid.places.between import estimate_between
from robid.places.evidence import Evidence, summarise
from robid.places.grouping import group_places
from robid.places.pooling import Pooled, pool

_STEPS = 3
_LONGEST_STEP = 0.5  # of an internal parameter; beyond, nothing is linear
_ARRIVED = 1e-2  # of a deviation


@dataclass(frozen=True)
class Effective:
    """The internal parameters that predict other places.

    Attributes:
        values (n_param,): Each place weighed by what noise and differences between places leave of its information.
        pooled: How far they may be off.
    """

    values: FloatArray
    pooled: Pooled


def place_evidence(problem: Problem, internal: FloatArray, covariance: FloatArray) -> Evidence:
    """What each place says of the internal parameters, around a point.

    Args:
        problem: The problem with its weights.
        internal (n_param,): The point.
        covariance (n_conf, n_param, n_param): Covariance of the scores by what is known of the errors; changes little
            from point to point.

    Source:
        METHODS sec. 11.
    """
    error, derivative = problem.linear(internal)
    n_conf, n_param = len(error), derivative.shape[-1]
    adjoint = problem.fully_weighted(derivative).reshape(n_conf, -1, n_param).conj().swapaxes(1, 2)
    bread = 2 * np.real(adjoint @ derivative.reshape(n_conf, -1, n_param))
    score = 2 * np.real(adjoint @ error.reshape(n_conf, -1, 1))[..., 0]
    places = group_places(problem.frf.configurations)
    each, pulls, meat = (
        np.array([values[place].sum(axis=0) for place in places]) for values in (bread, score, covariance)
    )
    precision = 1 / problem.parameters.prior_std**2
    return summarise(each, pulls, meat, np.diag(precision), -precision * internal)


def find_effective(problem: Problem, internal: FloatArray, found: Influence) -> Effective:
    """Weighs places by what noise and their differences leave of their information, from the minimum of a fit on.

    Args:
        problem: The problem, at its minimum.
        internal (n_param,): The minimum.
        found: The estimator linearised there.
    """
    covariance = score_covariance(problem, found)
    parameters, values = problem.parameters, internal
    for _ in range(_STEPS):
        evidence = place_evidence(problem, values, covariance)
        pooled = pool(evidence, estimate_between(evidence).variance)
        step = np.clip(pooled.shift, -_LONGEST_STEP, _LONGEST_STEP)
        values = np.clip(values + step, parameters.lower, parameters.upper)
        if (np.abs(step) <= _ARRIVED * np.sqrt(np.diag(pooled.covariance))).all():
            break
    doubt = load_doubt(problem, internal, found.inverse, found.weighted)
    return Effective(values, replace(pooled, assumed=pooled.assumed + doubt))
