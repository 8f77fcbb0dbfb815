"""A system whose blocks are known, and its local responses: A affine, one quadratic block of B, C and D constant."""

import numpy as np

from robid.models.lpv.fit.model import polynomial_basis
from robid.models.lpv.fit.responses import LocalResponses, Problem
from robid.models.lpv.fit.state_space import Sizes, StateSpace, response, transform

POSITIONS = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])[:, None]
LEFT_OUT = np.array([[-0.25]])
SIZES = Sizes(3, 1, 2)
STRUCTURE = ("A1", "B2")
FREQUENCY = np.linspace(0.002, 0.4, 200)

_A0 = np.array([[0.9, 0.05, 0.0], [0.0, 0.9112, 0.3326], [0.03, -0.3326, 0.9112]])
_A1 = np.array([[0.0, 0.02, 0.0], [0.0, 0.0, 0.06], [0.01, -0.06, 0.0]])
_B0 = np.array([[0.5], [0.1], [0.4]])
_B2 = np.array([[0.1], [-0.05], [0.2]])
_C = np.array([[1.0, 0.3, 0.1], [0.5, -0.4, 0.6]])
_D = np.array([[0.02], [0.05]])


def true_systems(points, T=None):
    """The system at points (n_pos, 1), in the states T x."""
    p = points[:, :, None]
    ones = np.ones_like(p)
    system = StateSpace(_A0 + _A1 * p, _B0 + _B2 * p**2, _C * ones, _D * ones)
    return system if T is None else transform(system, T)


def true_parameters(n_function=4):
    """The packed blocks of the system in powers of p."""
    full = np.zeros((n_function + 1, SIZES.n_local))
    for row, block in ((0, _A0), (1, _A1)):
        full[row, SIZES.parts[0]] = block.ravel()
    for row, block in ((0, _B0), (2, _B2)):
        full[row, SIZES.parts[1]] = block.ravel()
    full[0, SIZES.parts[2]], full[0, SIZES.parts[3]] = _C.ravel(), _D.ravel()
    return full


def local_responses(points, generator=None, noise_db=-40.0, T=None, frequency=FREQUENCY):
    """Responses with noise of a level below each output's rms; without noise where there is no generator."""
    exact = response(true_systems(points, T), np.exp(2j * np.pi * frequency))
    deviation = 10 ** (noise_db / 20) * np.sqrt(np.mean(np.abs(exact) ** 2, axis=1, keepdims=True))
    variance = np.broadcast_to(deviation**2, exact.shape)
    if generator is not None:
        error = generator.standard_normal((*exact.shape, 2)) @ np.array([1, 1j])
        exact = exact + error * np.sqrt(variance / 2)
    return LocalResponses(points, frequency, exact, variance, 1.0)


def basis():
    """Powers up to the fourth: as many functions as positions."""
    return polynomial_basis(POSITIONS, 4)


def problem(responses, degree=4):
    """The weighted problem in the outputs' own units."""
    values = polynomial_basis(POSITIONS, degree).values(responses.points)
    return Problem(responses.z, responses.response, 1 / np.sqrt(responses.variance), values, SIZES)
