"""How well cubic coefficients can be told from linear ones when the model is not exact."""

from __future__ import annotations

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.clusters.evidence import group_places
from robid.models.elastic.fit.problem import Problem


def load_doubt(problem: Problem, internal: FloatArray, inverse: FloatArray, weighted: ComplexArray) -> FloatArray:
    """Covariance that errors of the gears' slopes give, one for each gear and robot configuration.

    Between configurations everything else changes too, and a model that is off by so much in each of them feigns a
    cubic gear. Only loads that differ by far more, as gravity's do, or that differ in one and the same
    configuration, as those of two amplitudes do, tell it from a linear one. The error is the one that the weights
    assume of the response.

    Args:
        problem: The problem; without cubic coefficients there is no such doubt.
        internal (n_param,): Where to evaluate.
        inverse (n_param, n_param): Inverse of half the Gauss-Newton Hessian.
        weighted (n_conf, n_freq, n_out, n_in, n_param): Weighted derivative of the residual.

    Returns:
        Covariance (n_param, n_param) of the internal parameters.
    """
    parameters = problem.parameters
    total = np.zeros_like(inverse)
    owners = [name.removesuffix("cubic") for name in parameters.elements if name.endswith(".cubic")]
    names = [f"{owner}stiffness" for owner in owners if f"{owner}stiffness" in parameters.elements]
    columns = [int(parameters.member[parameters.elements.index(name)]) for name in names]
    if not columns:
        return total
    own = problem.linear(internal)[1][..., columns]
    pulls = np.real(np.einsum("cfoip,cfoiq->cpq", weighted.conj(), own, optimize=True))
    relative = np.sqrt(np.mean(problem.model_error**2))
    for place in group_places(problem.frf.configurations):
        shift = relative * inverse @ pulls[place].sum(axis=0)
        total += shift @ shift.T
    return total
