"""Poles and zeros of the linearised elastic robot, and how they move with its parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.models.elastic.judge.fitted import FittedModel
from robid.robot.derivatives import loaded_slopes
from robid.robot.linearize import LinearModel
from robid.robot.response import ElasticParameters, at_rest, motion_matrices

_PASSES = 3


@dataclass(frozen=True)
class Modes:
    """Oscillating modes, upper half plane, by rising size.

    Attributes:
        roots (n_mode,): Roots of the characteristic equation [rad/s].
        shapes (n, n_mode): Their shapes in the model's coordinates; zero at a locked motor.
        slopes (n_mode,): `x' (2 s M + D) x` of each root `s` and shape `x`.
    """

    roots: ComplexArray
    shapes: ComplexArray
    slopes: ComplexArray


def poles(model: LinearModel, parameters: ElasticParameters, configuration: int) -> Modes:
    """Returns the oscillating modes with free motors.

    Args:
        model: Linearised robot.
        parameters: Parameter values.
        configuration: Index of the configuration.
    """
    return _modes(model, parameters, configuration, None)


def zeros(model: LinearModel, parameters: ElasticParameters, configuration: int, motor: int) -> Modes:
    """Returns the zeros of a motor's own response.

    They are the modes with that motor locked: its row and column leave the equations of motion, as the
    numerator of a diagonal element of an inverse matrix is the minor without that row and column.

    Args:
        model: Linearised robot.
        parameters: Parameter values.
        configuration: Index of the configuration.
        motor: Index of the motor.
    """
    return _modes(model, parameters, configuration, motor)


def damping_ratio(roots: ComplexArray) -> FloatArray:
    """Damping ratios of modes [rad/s]."""
    return np.asarray(-roots.real / np.abs(roots))


def frequency_std(fitted: FittedModel, covariance: FloatArray, modes: Modes, configuration: int) -> FloatArray:
    """Standard deviation (n_mode,) of undamped frequencies by the delta method [Hz].

    Args:
        fitted: The fitted model.
        covariance (n_param, n_param): Covariance of its internal parameters.
        modes: Its modes in one configuration.
        configuration: Index of that configuration.

    Source:
        First-order perturbation of `(M s^2 + D s + K) x = 0` with symmetric matrices.
    """
    model, parameters, values = fitted.problem.model, fitted.problem.parameters, fitted.parameters
    s, x = modes.roots, modes.shapes
    motors, springs = x[: model.n_motor] ** 2, x[model.n_motor :] ** 2
    inertias, arms = _seen(model.link_inertia[configuration], x), (model.arm @ x) ** 2
    change = {
        "stiffness": model.rest.factor[configuration][:, None] * springs,
        "damping": s * springs,
        "viscous": s * motors,
        "arm_viscous": s * arms,
        "motor_inertia": s**2 * motors,
        "link_inertia": s**2 * inertias,
        "delay": np.zeros((1, s.size)),
    }
    if model.shifts is not None:
        by = model.shifts
        change["doubt"] = s**2 * _seen(by.mass[configuration], x) + _seen(by.gravity_stiffness[configuration], x)
    if model.effects is not None:
        by_effects = model.effects.slopes(values.doubt, values.damping, np.abs(s))[configuration]
        change["doubt"] = change["doubt"] + np.einsum("msd,sm->dm", by_effects, springs)
        change["damping"] = model.effects.growth(values.doubt)[configuration, :, None] * change["damping"]
    moving, at = at_rest(model, values)
    for kind, slopes in loaded_slopes(moving, values, at, parameters.kinds).items():
        through = slopes.stiffness[configuration].T @ springs
        moves = moving.rest.moves
        if moves is not None:
            turned = s**2 * _seen(moves.mass[configuration], x) + _seen(moves.gravity_stiffness[configuration], x)
            through = through + slopes.displacement[configuration].T @ turned
        change[kind] = through + (change[kind] if kind == "damping" else 0.0)
    moved = -np.concatenate([change[kind] for kind in parameters.kinds])[parameters.columns()] / modes.slopes
    rate = np.real(s.conj() * moved) / (2 * np.pi * np.abs(s))
    count = len(parameters.names) - parameters.n_friction
    rate = parameters.chain(fitted.internal)[: len(rate), :count].T @ rate
    own = covariance[: rate.shape[0], : rate.shape[0]]
    return np.asarray(np.sqrt(np.einsum("pm,pq,qm->m", rate, own, rate)))


def _seen(matrices: FloatArray, shapes: ComplexArray) -> ComplexArray:
    """Quadratic form (n_matrix, n_mode) of each matrix in each shape."""
    return np.asarray(np.einsum("im,lij,jm->lm", shapes, matrices, shapes))


def _modes(model: LinearModel, parameters: ElasticParameters, configuration: int, locked: int | None) -> Modes:
    """Modes, hysteresis as it is at each one's own frequency."""
    found = _solved(model, parameters, configuration, locked, None)
    if model.effects is None or not model.effects.bristles:
        return found
    columns = []
    for row, root in enumerate(found.roots):
        at = found
        for _ in range(_PASSES):
            omega = float(np.abs(root))
            at = _solved(model, parameters, configuration, locked, omega)
            row = min(row, at.roots.size - 1)
            root = at.roots[row]
        columns.append((at.roots[row], at.shapes[:, row], at.slopes[row]))
    roots, shapes, slopes = zip(*columns, strict=True) if columns else ((), (), ())
    return Modes(np.array(roots, complex), np.array(shapes).T.reshape(found.shapes.shape), np.array(slopes, complex))


def _solved(
    model: LinearModel, parameters: ElasticParameters, configuration: int, locked: int | None, omega: float | None
) -> Modes:
    """Solves `(M s^2 + D s + K) x = 0` for roots with positive imaginary part."""
    kept = np.delete(np.arange(model.mass.shape[-1]), [] if locked is None else [locked])
    inside = np.ix_(kept, kept)
    mass, damping, stiffness = (matrix[inside] for matrix in motion_matrices(model, parameters, configuration, omega))
    n = kept.size
    upper = np.hstack([np.zeros((n, n)), np.eye(n)])
    lower = -np.linalg.solve(mass, np.hstack([stiffness, damping]))
    roots, vectors = np.linalg.eig(np.vstack([upper, lower]))
    order = np.argsort(np.abs(roots))
    order = order[roots.imag[order] > 1e-6 * np.abs(roots[order])]
    shapes: ComplexArray = np.zeros((model.mass.shape[-1], order.size), complex)
    shapes[kept] = vectors[:n, order]
    x, s = shapes[kept], roots[order].astype(complex)
    slopes = 2 * s * np.einsum("im,ij,jm->m", x, mass, x) + np.einsum("im,ij,jm->m", x, damping, x)
    return Modes(s, shapes, np.asarray(slopes))
