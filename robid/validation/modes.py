"""Poles and zeros of the linearised elastic robot."""

from __future__ import annotations

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.robot.linearize import LinearModel
from robid.robot.response import ElasticParameters


def poles(model: LinearModel, parameters: ElasticParameters, configuration: int) -> ComplexArray:
    """Returns the oscillating modes with free motors, upper half plane [rad/s].

    Args:
        model: Linearised robot.
        parameters: Parameter values.
        configuration: Index of the configuration.
    """
    return _modes(*_matrices(model, parameters, configuration))


def zeros(model: LinearModel, parameters: ElasticParameters, configuration: int, motor: int) -> ComplexArray:
    """Returns the zeros of a motor's own response, upper half plane [rad/s].

    They are the modes with that motor locked: its row and column leave the equations of motion, as the
    numerator of a diagonal element of an inverse matrix is the minor without that row and column.

    Args:
        model: Linearised robot.
        parameters: Parameter values.
        configuration: Index of the configuration.
        motor: Index of the motor.
    """
    matrices = _matrices(model, parameters, configuration)
    return _modes(*(np.delete(np.delete(matrix, motor, 0), motor, 1) for matrix in matrices))


def damping_ratio(modes: ComplexArray) -> FloatArray:
    """Damping ratios of modes [rad/s]."""
    return np.asarray(-modes.real / np.abs(modes))


def _matrices(
    model: LinearModel, parameters: ElasticParameters, configuration: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mass, damping and stiffness (n, n) in the model's coordinates."""
    links = np.einsum("l,lij->ij", parameters.link_inertia, model.link_inertia[configuration])
    rotors = np.zeros(links.shape[0])
    rotors[: model.n_motor] = parameters.motor_inertia
    springs = np.concatenate([np.zeros(model.n_motor), parameters.stiffness])
    dampers = np.concatenate([parameters.viscous, parameters.damping])
    mass = model.mass[configuration] + links + np.diag(rotors)
    return mass, np.diag(dampers), model.gravity_stiffness[configuration] + np.diag(springs)


def _modes(mass: FloatArray, damping: FloatArray, stiffness: FloatArray) -> ComplexArray:
    """Eigenvalues of `M s^2 + D s + K` with positive imaginary part, by rising size."""
    n = mass.shape[0]
    if n == 0:
        return np.zeros(0, complex)
    upper = np.hstack([np.zeros((n, n)), np.eye(n)])
    lower = -np.linalg.solve(mass, np.hstack([stiffness, damping]))
    eigenvalues = np.linalg.eigvals(np.vstack([upper, lower]))
    oscillating = eigenvalues[eigenvalues.imag > 1e-6 * np.abs(eigenvalues)]
    return np.asarray(oscillating[np.argsort(np.abs(oscillating))])
