"""Coefficients in powers of s or z, which files and other tools ask for, of a model in a basis of its own."""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce

import numpy as np

from robid.arrays import FloatArray
from robid.models.external.response.denominator import Denominator
from robid.models.external.response.uncertainty import Spread


@dataclass(frozen=True)
class Coefficients:
    """Coefficients, highest power first, and a root of their covariance, in powers of s over the reference, or of z."""

    numerator: FloatArray  # (n_element, n_power)
    denominator: FloatArray  # (n_pole + 1,) with coefficient 1 first
    root: (
        FloatArray  # (n_element * n_power + n_pole + 1, n_root) of `[numerator, denominator without its first, delay]`
    )


def coefficients_of(spread: Spread, *, discrete: bool) -> Coefficients:
    """Expands a model in powers."""
    state = spread.state
    n_pole, n_power = state.denominator.n_pole, max(state.denominator.n_pole if discrete else 0, *state.degrees) + 1
    A, slopes = _expanded(state.denominator)
    B, to_B = [], []
    for element, degree in enumerate(state.degrees):
        rows = np.zeros((degree + 1, n_power))
        rows[:, n_power - degree - 1 :] = state.polynomials.powers(element)[: degree + 1, degree::-1]
        if discrete:
            rows = np.stack([_in_z(row[n_power - degree - 1 :], n_pole) for row in rows])
        to_B.append(rows)
        B.append(state.coefficients[element, : degree + 1] @ rows)
    if discrete:
        A, slopes = _in_z(A, n_pole), np.array([_in_z(row, n_pole) for row in slopes]).reshape(-1, n_pole + 1)
    # Over the first coefficient, which moves along: d(B / a) = dB / a - B da / a^2.
    first, first_slopes = A[0], slopes[:, 0]
    numerator, denominator = np.array(B) / first, A / first
    to_shared = spread.shared[:-1]
    parts = []
    for element, rows in enumerate(to_B):
        size = len(rows)
        through = (
            rows.T @ spread.own[element, :size] / first - np.outer(numerator[element], first_slopes @ to_shared) / first
        )
        alone = np.zeros((n_power, len(to_B), spread.alone.shape[1]))
        alone[:, element, :size] = rows.T * spread.alone[element, :size] / first
        parts.append(np.concatenate([through, alone.reshape(n_power, -1)], axis=1))
    below = ((slopes - np.outer(first_slopes, denominator)) / first)[:, 1:].T @ to_shared
    rest = np.concatenate([below, spread.shared[-1:]])
    parts.append(np.concatenate([rest, np.zeros((len(rest), spread.alone.size))], axis=1))
    return Coefficients(numerator, denominator, np.concatenate(parts))


def _expanded(denominator: Denominator) -> tuple[FloatArray, FloatArray]:
    """Returns the denominator (n_pole + 1,) and its derivatives (n_moving, n_pole + 1), highest power first."""
    factors = denominator.factors()
    shift = np.zeros(denominator.integrators)
    A = np.append(reduce(np.convolve, factors, np.ones(1)), shift)
    slopes = np.zeros((denominator.n_moving, len(A)))
    for index, (w, factor) in enumerate(zip(denominator.sizes, factors, strict=True)):
        rest = np.append(reduce(np.convolve, factors[:index] + factors[index + 1 :], np.ones(1)), shift)
        directions = [[w, 0.0], [w**2]] if len(factor) == 3 else [[w]]
        for offset, direction in enumerate(directions):
            row = np.convolve(direction, rest)
            slopes[2 * index + offset, len(A) - len(row) :] = row
    return A, slopes


def _in_z(polynomial: FloatArray, n_pole: int) -> FloatArray:
    """Turns a numerator of degree m, or a denominator of degree n, in s = (z - 1) / (z + 1) into z, over (z + 1)^n.

    What a numerator lacks to degree n are the zeros (1 + s)^(n - m) = (2 z)^(n - m) / (z + 1)^(n - m).
    """
    degree = len(polynomial) - 1
    found = np.zeros(n_pole + 1)
    for power, value in enumerate(polynomial[::-1]):
        row = reduce(np.convolve, [[1.0, -1.0]] * power + [[1.0, 1.0]] * (degree - power), np.ones(1))
        found[: degree + 1] += value * 2.0 ** (n_pole - degree) * row
    return found
