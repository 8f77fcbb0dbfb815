"""Where a fit lies that leans on what is known beforehand as far as places contradict each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robid.arrays import FloatArray
from robid.models.elastic.fit.effective import Settled, settle
from robid.models.elastic.fit.optimizers import optimise
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.fit.uncertainty import Influence, influence

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
