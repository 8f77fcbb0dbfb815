"""The weighted residual for given poles and delay, and its derivatives, with all numerators eliminated.

Variable projection: for a denominator A and a delay, numerators follow by linear least squares, element by element.
What is left is a function of few parameters that all elements share.

Source:
    Golub and Pereyra (1973), "The differentiation of pseudo-inverses and nonlinear least squares problems whose
    variables separate"; Kaufman (1975) for the derivative.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.models.external.response.basis import Columns, Polynomials, orthogonalise, parted
from robid.models.external.response.denominator import Denominator
from robid.models.external.response.lines import Lines

Degrees = tuple[int, ...]


@dataclass(frozen=True)
class State:
    """The best numerators for a denominator and a delay.

    Everything on the lines is turned by the phase of 1 / w, w = exp(-s tau) / (sigma A), which changes no norm: columns
    of even polynomials are real there, those of odd ones imaginary.
    """

    denominator: Denominator
    delay: float  # in the lines' units
    degrees: Degrees  # of each element's numerator
    polynomials: Polynomials  # one set an element
    columns: Columns  # orthonormal columns of each element, zero beyond the element's degree
    coefficients: FloatArray  # (n_element, degree + 1) of the polynomials
    model: ComplexArray  # (n_element, n_freq) weighted model
    residual: ComplexArray  # (n_element, n_freq) weighted data less model
    slopes: ComplexArray  # (n_moving, n_freq) logarithmic derivatives of the denominator
    phase: ComplexArray  # (n_element, n_freq) what everything was turned by
    cost: float  # sum of squares of all real and imaginary parts

    @property
    def parameters(self) -> FloatArray:
        """Coefficients of the denominator, and the delay last."""
        return np.append(self.denominator.coefficients, self.delay)


def evaluate(lines: Lines, denominator: Denominator, delay: float, degrees: Degrees) -> State:
    """Finds the best numerators of given degrees."""
    A, slopes = denominator.evaluate(1j * lines.x)
    size = np.maximum(np.abs(A), 1e-150)
    phase = (A / size * np.exp(1j * lines.turn * delay) if delay else A / size)[None]
    weights = lines.weights / size
    if lines.time == "discrete":
        factors = np.stack([lines.fixed_factor(denominator.n_pole - degree) for degree in degrees])
        weights, phase = weights * np.abs(factors), phase * np.conj(factors) / np.abs(factors)
    turned = lines.y * phase
    V, polynomials = orthogonalise(weights, lines.x, max(degrees))
    if min(degrees) < max(degrees):
        V.limit(np.array(degrees))
    c = V.along(parted(turned[:, None]))
    parts = V.combine(c)[:, :, 0]
    model = parts[:, 0] + 1j * parts[:, 1]
    residual = turned - model
    cost = float(np.vdot(residual, residual).real)
    c = V.ordered(c)[:, 0]
    return State(denominator, delay, degrees, polynomials, V, c, model, residual, slopes, phase, cost)


def derivatives(state: State, turn: FloatArray | None) -> ComplexArray:
    """Computes the derivatives (n_element, n_param, n_freq) of the residual at fixed numerators.

    The parameters are the denominator's coefficients and, with the phase per unit of delay given, the delay.
    """
    # r = y - B / A: dr = (B / A) dA / A. A delay turns the data by exp(j w tau); at first order the model stands for
    # them, which leaves the gradient exact, since j w |r|^2 has no real part.
    rows = state.slopes if turn is None else np.concatenate([state.slopes, 1j * turn[None]])
    return np.asarray(state.model[:, None, :] * rows)


def project(state: State, rows: ComplexArray) -> FloatArray:
    """Takes out of rows (n_element, n_row, n_freq) what the numerators can follow; parted (n_element, 2, ..)."""
    parts = parted(rows)
    parts -= state.columns.combine(state.columns.along(parts))
    return parts


def as_real(parts: FloatArray) -> FloatArray:
    """Stacks parted rows (n_element, 2, n_row, n_freq) as rows (n_row, n_element * 2 n_freq)."""
    return parts.transpose(2, 0, 1, 3).reshape(parts.shape[2], -1)
