"""Parameter covariance: the sandwich of the weighted estimator."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray
from robid.fit.problem import Problem


def sandwich(problem: Problem, internal: FloatArray) -> FloatArray:
    """Covariance of the internal parameters, a model error assumed by the weights included.

    Args:
        problem: The problem, whose response carries the structured covariance.
        internal (n_param,): Where to evaluate.

    Returns:
        Covariance (n_param, n_param); directions the data do not determine come out large, not infinite.

    Source:
        Wernholt and Moberg (2008), eq. 5 divided by the number of lines, LLS form.
    """
    _, derivative = problem.linear(internal)
    weighted = problem.weight[..., None] * derivative
    n_param = derivative.shape[-1]
    bread = np.real(derivative.reshape(-1, n_param).conj().T @ weighted.reshape(-1, n_param))
    error = (problem.model_error * weighted).reshape(-1, n_param)
    if problem.estimator != "nls":
        weighted = weighted / problem.measured(internal).conj()[..., None]
    else:
        error = error * np.abs(problem.frf.response).reshape(-1, 1)
    covariance, factor = problem.frf.covariance, problem.frf.input_factor
    weighted = weighted * np.sqrt(problem.frf.element_scale)[:, None, :, :, None]
    moved = np.einsum("cfop,cfpiq->cfoiq", covariance, weighted, optimize=True)
    moved = np.einsum("cfij,cfojq->cfoiq", factor, moved, optimize=True)
    meat = 0.5 * np.real(weighted.reshape(-1, n_param).conj().T @ moved.reshape(-1, n_param) + error.conj().T @ error)
    precision = 0.5 / problem.parameters.prior_std**2
    inverse = np.linalg.pinv(bread + np.diag(precision), rcond=1e-14, hermitian=True)
    return np.asarray(inverse @ (meat + np.diag(0.5 * precision)) @ inverse)
