"""Bootstrap over realizations: the fit repeated on responses whose realizations are weighted anew."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from scipy.stats import norm, t

from robid.arrays import FloatArray
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.fit.uncertainty import Influence, realization_freedom

Map: TypeAlias = Callable[[Callable[[Any], Any], Sequence[Any]], list[Any]]

_FURTHER_STEPS = 1
_LONGEST_STEP = 1.0
_CHUNK = 10


@dataclass(frozen=True)
class Bootstrap:
    """Spread of repeated fits, in internal values.

    Attributes:
        std (n_param,): Standard deviation of the replicates.
        lower (n_param,): Lower end of the percentile interval.
        upper (n_param,): Upper end.
    """

    std: FloatArray
    lower: FloatArray
    upper: FloatArray


@dataclass(frozen=True)
class _Chunk:
    problem: Problem
    internal: FloatArray
    inverse: FloatArray
    shifts: FloatArray
    seed: np.random.SeedSequence
    count: int


def bootstrap(
    problem: Problem,
    internal: FloatArray,
    found: Influence,
    shifts: FloatArray,
    count: int,
    confidence: float,
    seed: int,
    parallel_map: Map,
) -> Bootstrap:
    """Repeats a fit from its minimum on perturbed responses.

    Resampling the few realizations of a campaign with replacement knows few distinct samples (35 of four) and makes
    the variance too small by the factor (M - 1)/M. Here every realization's own error is added to the response
    with a normal weight of variance M/(M - 1), drawn for each configuration (a wild bootstrap): lines and elements
    of a realization stay together, so that nothing is assumed about their correlation. The percentiles are taken
    apart by the ratio of Student's and the normal quantile, because few realizations tell a variance badly.

    Args:
        problem: The problem, weights of the final fit.
        internal (n_param,): Its minimum.
        found: The estimator linearised there.
        shifts (n_conf, n_real, n_param): What each realization does to the parameters, see `realization_shifts`.
        count: Number of replicates.
        confidence: Level of the interval.
        seed: Seed of the weights.
        parallel_map: Ordered map over chunks of replicates.

    Returns:
        The spread.

    Source:
        Wu (1986); expanded percentiles: Hesterberg (2015).
    """
    sizes = [min(_CHUNK, count - index * _CHUNK) for index in range(bootstrap_tasks(count))]
    seeds = np.random.SeedSequence([seed, count]).spawn(len(sizes))
    chunks = [_Chunk(problem, internal, found.inverse, shifts, *each) for each in zip(seeds, sizes, strict=True)]
    replicates = np.concatenate(parallel_map(_replicates, chunks))
    tail = 0.5 - 0.5 * confidence
    expanded = t.ppf(1 - tail, np.maximum(realization_freedom(shifts), 1.0)) / norm.ppf(1 - tail)
    ends = np.quantile(replicates, [tail, 1 - tail], axis=0, method="weibull") - internal
    return Bootstrap(replicates.std(axis=0, ddof=1), *(internal + expanded * ends))


def bootstrap_tasks(count: int) -> int:
    """Number of tasks that so many replicates are spread over."""
    return -(-count // _CHUNK)


def _replicates(chunk: _Chunk) -> FloatArray:
    """Minima (count, n_param), what is known beforehand drawn anew as well."""
    generator = np.random.default_rng(chunk.seed)
    frf, n_real = chunk.problem.frf, chunk.shifts.shape[1]
    each = np.asarray(frf.realization_error)
    parameters = chunk.problem.parameters
    known = 0.5 / parameters.prior_std
    minima = []
    for _ in range(chunk.count):
        weights = generator.standard_normal(chunk.shifts.shape[:2])
        errors = np.einsum("cm,cmfoi->cfoi", np.sqrt(n_real / (n_real - 1)) * weights, each)
        drawn = replace(chunk.problem, frf=replace(frf, response=frf.response + errors))
        # The linear move is the first Gauss-Newton step.
        point = chunk.internal + np.clip(np.einsum("cm,cmp->p", weights, chunk.shifts), -_LONGEST_STEP, _LONGEST_STEP)
        for _ in range(_FURTHER_STEPS):
            here = drawn.normal(point)
            point = point - np.clip(np.linalg.solve(here.hessian, here.gradient), -_LONGEST_STEP, _LONGEST_STEP)
            point = np.clip(point, parameters.lower, parameters.upper)
        minima.append(point + chunk.inverse @ (known * generator.standard_normal(known.size)))
    return np.array(minima)
