"""How far a fitted model's responses may be off."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray
from robid.models.lpv.fit.problem import Problem, local_jacobian

_SINGULAR = 1e-11  # of the largest eigenvalue: a direction that moves no response


@dataclass(frozen=True)
class ParameterUncertainty:
    """How far the parameters may be off, the states' basis apart.

    Attributes:
        covariance (n_param, n_param): Of all parameters, zero where one is fixed.
        n_determined: Combinations of parameters that the responses determine.
        misfit: Mean weighted square error of an element, less what those take: near 1 with right weights `1/sigma^2`.
    """

    covariance: FloatArray
    n_determined: int
    misfit: float


@dataclass(frozen=True)
class ResponseUncertainty:
    """A response and how far it may be off, linearised.

    Attributes:
        response (n_pos, n_freq, n_out, n_in): The model's response.
        total (n_pos, n_freq, n_out, n_in): Root of `E|error|^2`.
    """

    response: ComplexArray
    total: FloatArray


def parameter_uncertainty(
    problem: Problem, parameters: FloatArray, free: BoolArray, variance: FloatArray | None
) -> ParameterUncertainty:
    """Returns the covariance of all parameters.

    The states' basis is free: the directions that move no response are taken out by a pseudo-inverse. The covariance
    is that of one basis, but what it says of responses holds in any.

    Args:
        problem: What was fitted.
        parameters (n_function + 1, n_local): The fit.
        free (n_function + 1, n_local): Which elements were fitted.
        variance (n_pos, n_freq, n_out, n_in): `E|error|^2` of the problem's responses, in its units; None where it is
            unknown, then the residual stands for it, alike in all weighted elements.
    """
    error, slope = local_jacobian(problem, parameters)
    full = np.einsum("qk,qrl->qrkl", problem.values, slope).reshape(-1, parameters.size)[:, free.ravel()]
    bread = np.real(full.conj().T @ full)
    null, root = _null_directions(bread)
    scaled = bread / np.outer(root, root) + null @ null.T
    inverse = np.linalg.inv(scaled) - null @ null.T
    inverse = inverse / np.outer(root, root)
    n_determined = bread.shape[0] - null.shape[1]
    misfit = float(np.sum(np.abs(error) ** 2)) / max(problem.n_data - n_determined / 2, 1.0)
    if variance is None:
        inner = 0.5 * misfit * inverse
    else:
        weighted = np.where(problem.root_weight > 0, variance, 0.0) * problem.root_weight**2
        filling = np.real(full.conj().T @ (weighted.reshape(-1, 1) * full))
        inner = 0.5 * inverse @ filling @ inverse
    covariance = np.zeros((parameters.size, parameters.size))
    covariance[np.ix_(free.ravel(), free.ravel())] = inner
    return ParameterUncertainty(covariance, n_determined, misfit)


def response_uncertainty(problem: Problem, parameters: FloatArray, covariance: FloatArray) -> ResponseUncertainty:
    """Carries the parameters' covariance to responses at the problem's positions and lines.

    Args:
        problem: Positions and lines; its responses and weights play no part.
        parameters (n_function + 1, n_local): The fit.
        covariance (n_param, n_param): Of the parameters.
    """
    shape = problem.response.shape
    plain = replace(problem, response=np.zeros(shape, complex), root_weight=np.ones(shape))
    here, slope = local_jacobian(plain, parameters)
    n_function, n_local = parameters.shape
    blocks = covariance.reshape(n_function, n_local, n_function, n_local)
    local = np.einsum("qk,kiml,qm->qil", problem.values, blocks, problem.values)
    squared = np.einsum("qri,qil,qrl->qr", slope.conj(), local, slope).real
    return ResponseUncertainty(here.reshape(shape), np.sqrt(np.maximum(squared, 0)).reshape(shape))


def _null_directions(hessian: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Returns directions that move no response.

    Returns:
        The directions (n_param, n_null), orthonormal where parameters are multiplied by the scale (n_param,), and it.
    """
    root = np.sqrt(np.maximum(np.diag(hessian), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(hessian / np.outer(root, root))
    return vectors[:, values < _SINGULAR * values[-1]], root
