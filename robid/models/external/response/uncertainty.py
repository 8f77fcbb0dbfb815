"""How far a model may be off: a root of its parameters' covariance, and what that moves.

Every deviation is a row of what the independent unit errors of the root move: variances, covariances and those of
anything that follows from the parameters are sums of squares.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.models.external.response.basis import parted
from robid.models.external.response.lines import Lines
from robid.models.external.response.residual import State, as_real, derivatives, project

_SINGULAR = 1e-14  # of the largest, a singular value that counts as none
_UNBOUNDED = 1e7  # deviations, scaled, for what the data do not determine


@dataclass(frozen=True)
class Spread:
    """A root of the covariance of a model's own parameters, coefficients of its polynomials and its denominator."""

    state: State
    delayed: bool  # whether the delay was estimated
    shared: FloatArray  # (n_moving + 1, n_shared) root of the denominator's coefficients and the delay
    own: FloatArray  # (n_element, degree + 1, n_shared) what the same errors move each element's coefficients by
    alone: FloatArray  # (n_element, degree + 1) deviations of the coefficients by errors of their own

    def moves(self, element: int, by_coefficient: ComplexArray, by_shared: ComplexArray) -> ComplexArray:
        """Returns what moves a quantity (n_value, n_root) of an element.

        Args:
            element: Which.
            by_coefficient (n_value, degree + 1): Derivatives by the coefficients of the numerator.
            by_shared (n_value, n_moving + 1): The same by the denominator's coefficients and the delay.
        """
        through = by_coefficient @ self.own[element] + by_shared @ self.shared
        return np.concatenate([through, by_coefficient * self.alone[element]], axis=1)


def find_spread(lines: Lines, state: State, *, delayed: bool, scale: float) -> Spread:
    """Computes the root of the covariance, `scale` times that of the stated variance."""
    # Residual r = y - V c - .. with orthonormal V: the part J of poles and delay that numerators cannot follow decides
    # how far these may be off, (J J^T)^-1; numerators follow them by K = V^T dr, and have unit errors besides.
    n_moving = state.denominator.n_moving
    deviation = np.sqrt(scale)
    alone = (np.arange(state.coefficients.shape[1]) <= np.array(state.degrees)[:, None]) * deviation
    if n_moving + delayed == 0:
        return Spread(state, delayed, np.zeros((1, 0)), np.zeros((*alone.shape, 0)), alone)
    J = derivatives(state, lines.turn if delayed else None)
    free = as_real(project(state, J))
    K = state.columns.ordered(state.columns.along(parted(J))).transpose(0, 2, 1)
    root = _inverse_root(free) * deviation
    shared = np.zeros((n_moving + 1, root.shape[1]))
    shared[:n_moving] = root[:n_moving]
    if delayed:
        shared[-1] = root[-1]
    return Spread(state, delayed, shared, K @ root, alone)


def _inverse_root(rows: FloatArray) -> FloatArray:
    """Returns a root of `(J J^T)^-1` of rows J (n_param, n_data); what they do not determine is off by very much."""
    size = np.maximum(np.linalg.norm(rows, axis=1), 1e-150)
    turned, values, _ = np.linalg.svd(rows / size[:, None], full_matrices=False)
    inverse = np.where(values > _SINGULAR * values[0], 1 / np.maximum(values, 1e-300), _UNBOUNDED)
    return np.asarray(turned * inverse / size[:, None])


def response_of(
    lines: Lines, spread: Spread, x: FloatArray, turn: FloatArray
) -> tuple[ComplexArray, FloatArray, FloatArray]:
    """Computes the response (n_element, n_freq) and the deviations of its real and imaginary parts.

    Args:
        lines: What the model was fitted to, for its scales.
        spread: The model and its spread.
        x (n_freq,): Frequencies over the reference.
        turn (n_freq,): Phases per unit of delay [rad].
    """
    state = spread.state
    A, slopes = state.denominator.evaluate(1j * x)
    late = np.exp(-1j * turn * state.delay) / A
    shared = np.concatenate([-slopes, -1j * turn[None]]).T
    found = np.empty((len(state.degrees), len(x)), dtype=complex)
    deviations = np.empty((2, *found.shape))
    for element, degree in enumerate(state.degrees):
        missing = state.denominator.n_pole - degree if lines.time == "discrete" else 0
        factor = (1 + 1j * x * lines.reference) ** missing
        values = state.polynomials.values(1j * x, element) * late * factor
        found[element] = state.coefficients[element] @ values
        moves = spread.moves(element, values.T, found[element][:, None] * shared)
        deviations[0, element] = np.linalg.norm(moves.real, axis=1)
        deviations[1, element] = np.linalg.norm(moves.imag, axis=1)
    return found, deviations[0], deviations[1]


def pole_moves(spread: Spread) -> tuple[ComplexArray, ComplexArray]:
    """Returns the poles (n_moving,) over the reference, integrators apart, and what moves them (n_moving, n_shared)."""
    denominator = spread.state.denominator
    poles = denominator.moving_poles()
    moves = np.zeros((len(poles), spread.shared.shape[1]), dtype=complex)
    for index in range(denominator.n_moving // 2):
        both = slice(2 * index, 2 * index + 2)
        w, p = denominator.sizes[index], poles[both, None]
        # p^2 + w u p + w^2 v = 0: (2 p + w u) dp = -(w p du + w^2 dv), and 2 p + w u is p less the other root.
        change = -(w * p * spread.shared[2 * index] + w**2 * spread.shared[2 * index + 1])
        apart = p - poles[both][::-1, None]
        moves[both] = change / np.where(apart == 0, np.finfo(float).tiny, apart)
    if denominator.n_moving % 2:
        moves[-1] = -denominator.sizes[-1] * spread.shared[denominator.n_moving - 1]
    return poles, moves


def zero_moves(spread: Spread, element: int) -> tuple[ComplexArray, ComplexArray]:
    """Returns the zeros (n_zero,) of an element over the reference, and what moves them (n_zero, n_root)."""
    state, degree = spread.state, spread.state.degrees[element]
    c, polynomials = state.coefficients[element, : degree + 1], state.polynomials
    zeros = polynomials.roots(c, element)
    leading = c[-1] * polynomials.powers(element)[degree, degree]
    apart = zeros[:, None] - zeros
    np.fill_diagonal(apart, 1.0)
    # dz = -dB(z) / B'(z), B' the product over the other roots.
    slopes = leading * apart.prod(axis=1)
    by_coefficient = -(
        polynomials.values(zeros, element).T / np.where(slopes == 0, np.finfo(float).tiny, slopes)[:, None]
    )
    return zeros, spread.moves(element, by_coefficient, np.zeros((len(zeros), len(spread.shared)), dtype=complex))


def gain_moves(spread: Spread, element: int) -> tuple[float, FloatArray]:
    """Returns an element at zero without its integrators, over the reference, and what moves it (n_root,)."""
    state = spread.state
    A, slopes = replace(state.denominator, integrators=0).evaluate(np.zeros(1, dtype=complex))
    values = (state.polynomials.values(np.zeros(1, dtype=complex), element) / A).real
    gain = float(state.coefficients[element] @ values[:, 0])
    shared = np.append(-gain * slopes[:, 0].real, 0.0)[None]
    return gain, spread.moves(element, values.T.astype(complex), shared.astype(complex))[0].real
