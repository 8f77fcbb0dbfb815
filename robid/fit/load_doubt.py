"""How well cubic coefficients can be told from linear ones when the model is not exact."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray
from robid.fit.problem import Problem

_SAME_CONFIGURATION_RAD = 1e-3


def load_doubt(problem: Problem, relative: float) -> FloatArray:
    """Variance (n_param,) that errors of the gears' slopes give, one for each gear and robot configuration.

    Between configurations everything else changes too, and a model that is off by so much in each of them feigns a
    cubic gear. Only loads that differ by far more, as gravity's do, or that differ in one and the same
    configuration, as those of two amplitudes do, tell it from a linear one.

    Args:
        problem: The problem; without cubic coefficients there is no such doubt.
        relative: Standard deviation of the relative errors.

    Returns:
        Variance of the internal parameters at the robot file's values.
    """
    parameters = problem.parameters
    total = np.zeros(len(parameters.names))
    owners = [name.removesuffix("cubic") for name in parameters.elements if name.endswith(".cubic")]
    names = [f"{owner}stiffness" for owner in owners]
    columns = [int(parameters.member[parameters.elements.index(name)]) for name in names if name in parameters.elements]
    if not columns:
        return total
    derivative = problem.weighted(problem.linear(np.zeros(total.size))[1])
    rows = derivative.reshape(len(derivative), -1, total.size)
    own = np.real(np.einsum("crp,crq->cpq", rows.conj(), rows, optimize=True))
    inverse = np.linalg.pinv(own.sum(axis=0) + np.diag(0.5 / parameters.prior_std**2), rcond=1e-14, hermitian=True)
    for place in _places(problem.frf.configurations):
        shift = inverse @ own[place].sum(axis=0)[:, columns]
        total += (relative * shift**2 * relative).sum(axis=1)
    return total


def _places(configurations: FloatArray) -> list[list[int]]:
    """Indices of the measurements in each robot configuration."""
    places: list[list[int]] = []
    for index, angles in enumerate(configurations):
        for place in places:
            if np.abs(configurations[place[0]] - angles).max() < _SAME_CONFIGURATION_RAD:
                place.append(index)
                break
        else:
            places.append([index])
    return places
