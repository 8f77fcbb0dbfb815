"""How far a fitted model's responses, poles and other parameters may be off."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from robid.arrays import BoolArray, ComplexArray, FloatArray
from robid.models.conclusions import Row, estimate_of_rows, root_rows
from robid.models.lpv.fit.model import LpvModel
from robid.models.lpv.fit.responses import LocalResponses, Problem, local_jacobian, make_problem
from robid.models.lpv.fit.state_space import Sizes, StateSpace, pack, unpack
from robid.results.estimate import Estimate

_SINGULAR = 1e-11  # of the largest eigenvalue: a direction that moves no response


@dataclass(frozen=True)
class ParameterUncertainty:
    """How far the parameters may be off, the states' basis apart."""

    covariance: FloatArray  # (n_param, n_param): of all parameters, zero where one is fixed
    n_determined: int  # combinations of parameters that the responses determine
    # Mean weighted square error of an element, less what those take: near 1 with right weights `1/sigma^2`.
    misfit: float


@dataclass(frozen=True)
class ResponseUncertainty:
    """A response and how far it may be off, linearised."""

    response: ComplexArray  # (n_pos, n_freq, n_out, n_in): the model's response
    total: FloatArray  # (n_pos, n_freq, n_out, n_in): root of `E|error|^2`


def parameter_uncertainty(
    problem: Problem, parameters: FloatArray, free: BoolArray, variance: FloatArray | None
) -> ParameterUncertainty:
    """Returns the covariance of all parameters.

    The states' basis is free: the directions that move no response are taken out by a pseudo-inverse. The covariance is
    that of one basis, but what it says of responses holds in any. Which elements of the fit (n_function + 1, n_local)
    were free is given, and the variance `E|error|^2` (n_pos, n_freq, n_out, n_in), in the problem's units; where it is
    None, the residual stands for it, alike in all weighted elements.
    """
    error, slope = local_jacobian(problem, parameters)
    # J of all parameters: each position's derivative by its local matrices, times the basis functions there.
    full = np.einsum("qk,qrl->qrkl", problem.values, slope).reshape(-1, parameters.size)[:, free.ravel()]
    bread = np.real(full.conj().T @ full)
    # Directions that move no response, orthonormal by the scale of each parameter.
    root = np.sqrt(np.maximum(np.diag(bread), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(bread / np.outer(root, root))
    null = vectors[:, values < _SINGULAR * values[-1]]
    # Adding one along the null directions makes the matrix regular; subtracted again, its inverse is the
    # pseudo-inverse.
    scaled = bread / np.outer(root, root) + null @ null.T
    inverse = np.linalg.inv(scaled) - null @ null.T
    inverse = inverse / np.outer(root, root)
    n_determined = bread.shape[0] - null.shape[1]
    # A complex element has two real degrees of freedom, so that each parameter takes half an element.
    misfit = float(np.sum(np.abs(error) ** 2)) / max(problem.n_data - n_determined / 2, 1.0)
    if variance is None:
        inner = 0.5 * misfit * inverse
    else:
        weighted = np.where(problem.root_weight > 0, variance, 0.0) * problem.root_weight**2
        # The sandwich H^-1 J^H C J H^-1, as weights were smoothed and are no inverse variances; one half, as E|e|^2 of
        # a complex error is twice the variance of each part.
        filling = np.real(full.conj().T @ (weighted.reshape(-1, 1) * full))
        inner = 0.5 * inverse @ filling @ inverse
    covariance = np.zeros((parameters.size, parameters.size))
    covariance[np.ix_(free.ravel(), free.ravel())] = inner
    return ParameterUncertainty(covariance, n_determined, misfit)


def response_uncertainty(problem: Problem, parameters: FloatArray, covariance: FloatArray) -> ResponseUncertainty:
    """Carries the parameters' covariance (n_param, n_param) to responses at the problem's positions and lines."""
    shape = problem.response.shape
    plain = replace(problem, response=np.zeros(shape, complex), root_weight=np.ones(shape))
    here, slope = local_jacobian(plain, parameters)
    n_function, n_local = parameters.shape
    blocks = covariance.reshape(n_function, n_local, n_function, n_local)
    # Covariance of the local matrices at a position: psi(p)^T C psi(p).
    local = np.einsum("qk,kiml,qm->qil", problem.values, blocks, problem.values)
    squared = np.einsum("qri,qil,qrl->qr", slope.conj(), local, slope).real
    return ResponseUncertainty(here.reshape(shape), np.sqrt(np.maximum(squared, 0)).reshape(shape))


_REAL = 1e-9  # of a pole's absolute value, an imaginary part that counts as none


def estimate_poles(
    core: LpvModel,
    covariance: FloatArray,
    points: FloatArray,
    status: str,
    *,
    confidence: float,
    identifiable_relative_std: float,
) -> Estimate:
    """Returns natural frequencies, damping ratios and rates of the frozen models at some positions.

    Poles on the negative real axis of the z plane have no counterpart in continuous time and are left out. The model is
    without integrators; its covariance (n_param, n_param) is of whatever units of outputs, the positions (n_pos,
    n_scheduling).
    """
    rows = [row for index in range(len(points)) for row in _rows(core, points[index : index + 1], f"p{index + 1}")]
    slopes = np.array([row.moves for row in rows]).reshape(len(rows), core.parameters.size)
    whole = slopes @ covariance @ slopes.T
    found = estimate_of_rows(
        rows,
        0.5 * (whole + whole.T),
        "the covariance of the responses, or the residual where it is larger",
        status,
        "" if status == "converged" else "try another `order` or fewer basis functions",
        confidence=confidence,
        identifiable_relative_std=identifiable_relative_std,
    )
    std, half = np.sqrt(np.maximum(np.diag(found.covariance), 0)), norm.ppf(0.5 + 0.5 * confidence)
    return replace(found, relative_half_width=half * std / np.array([row.scale for row in rows], float))


def continuous_poles(A: FloatArray, sampling_period_s: float) -> ComplexArray:
    """Returns the logarithms of the poles (..., n_state) over the sampling period [rad/s]."""
    return np.asarray(np.log(np.linalg.eigvals(A).astype(complex)) / sampling_period_s)


def _rows(core: LpvModel, point: FloatArray, place: str) -> Iterator[Row]:
    """Yields the poles at one point, slow ones first, with their slopes by all parameters."""
    A = core.at(point).A[0]
    values, right = np.linalg.eig(A)
    left, parts = np.linalg.inv(right), core.sizes.parts
    s = np.log(values.astype(complex)) / core.sampling_period_s
    number = 0
    for index in np.argsort(np.abs(s)).tolist():
        is_real = abs(values[index].imag) <= _REAL * abs(values[index])
        if (values[index].imag < 0 and not is_real) or (is_real and values[index].real <= 0):
            continue
        number += 1
        local = np.zeros(core.sizes.n_local, complex)
        # d lambda = v^T dA u with left and right eigenvectors, v^T u = 1; s = log(lambda) / T, so that ds = d lambda /
        # (lambda T).
        local[parts[0]] = np.outer(left[index], right[:, index]).ravel()
        moves = np.outer(core.basis.values(point)[0], local).ravel() / (values[index] * core.sampling_period_s)
        yield from root_rows(f"{place}.pole{number}", "pole", complex(s[index]), moves, is_real=is_real)


def rescaled(parameters: FloatArray, sizes: Sizes, scales: FloatArray) -> FloatArray:
    """Multiplies the outputs of packed matrices (n_function + 1, n_local) by scales (n_out,)."""
    inside = unpack(parameters, sizes)
    return pack(StateSpace(inside.A, inside.B, inside.C * scales[:, None], inside.D * scales[:, None]))


def model_response(
    core: LpvModel,
    scales: FloatArray,
    covariance: FloatArray,
    integrators: tuple[int, ...],
    points: FloatArray,
    frequency_hz: FloatArray,
) -> ResponseUncertainty:
    """Returns the response at points (n_pos, n_scheduling), integrators included, with its deviations.

    The core without integrators is in the outputs' own units, its covariance (n_param, n_param) in those of `scales`
    (n_out,).

    Raises:
        DataError: If a point lies outside the range.
    """
    empty = np.zeros((len(points), len(frequency_hz), core.sizes.n_out, core.sizes.n_in), complex)
    asked = LocalResponses(points, frequency_hz, empty, None, core.sampling_period_s)
    problem = make_problem(asked, core.basis, core.sizes.n_state, scales, weighted=False)
    scaled = response_uncertainty(problem, rescaled(core.parameters, core.sizes, 1 / scales), covariance)
    # An integrator T / (z - 1) for each time that an output integrates.
    behind = ((asked.z[:, None] - 1) / asked.sampling_period_s) ** np.array(integrators)
    factor = (scales / behind)[..., None]
    return ResponseUncertainty(scaled.response * factor, scaled.total * np.abs(factor))
