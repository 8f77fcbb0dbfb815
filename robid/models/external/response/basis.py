"""Orthogonal polynomials on the lines, the basis in which numerators and denominators are sought.

With weights |w| = 1 / (sigma |A|) the columns w p_k(s) are orthonormal over the lines: numerators of every degree
follow by inner products. Powers of s over three decades and ten poles are not independent in double precision; these
are.

Source:
    Richardson and Formenti (1982), "Parameter estimation from frequency response measurements using rational fraction
    polynomials"; Forsythe (1957), "Generation and use of orthogonal polynomials for data-fitting with a digital
    computer".
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray, IntArray

_TINY = 1e-300


@dataclass(frozen=True)
class Polynomials:
    """Real polynomials of degree k with `s p_k = h_(k+1) p_(k+1) - h_k p_(k-1)`, of several weights at once.

    On the axis multiplication by s is skew-symmetric, which leaves this recurrence of three terms.
    """

    first: FloatArray  # (n_weight,) the constant p_0
    recurrence: FloatArray  # (n_weight, degree) h_1, h_2, ..

    @property
    def degree(self) -> int:
        """Degree of the last one."""
        return int(self.recurrence.shape[1])

    def values(self, s: ComplexArray, weight: int = 0) -> ComplexArray:
        """Computes the values (degree + 1, *shape) of the polynomials of one weight anywhere."""
        h, found = self.recurrence[weight], np.zeros((self.degree + 1, *np.shape(s)), dtype=complex)
        found[0] = self.first[weight]
        for k in range(self.degree):
            found[k + 1] = (s * found[k] + (h[k - 1] * found[k - 1] if k else 0.0)) / h[k]
        return found

    def powers(self, weight: int = 0) -> FloatArray:
        """Returns the coefficients (degree + 1, degree + 1) of the polynomials of one weight, lowest power first."""
        h, found = self.recurrence[weight], np.zeros((self.degree + 1, self.degree + 1))
        found[0, 0] = self.first[weight]
        for k in range(self.degree):
            found[k + 1, 1:] = found[k, :-1]
            found[k + 1] = (found[k + 1] + (h[k - 1] * found[k - 1] if k else 0.0)) / h[k]
        return found

    def roots(self, coefficients: FloatArray, weight: int = 0) -> ComplexArray:
        """Returns the roots of `sum_k c_k p_k`, c (n_coefficient,) without trailing zeros.

        They are eigenvalues of multiplication by s with the last polynomial eliminated by the sum's own root (comrade
        matrix), which keeps the digits that powers of s would lose.
        """
        degree = len(coefficients) - 1
        if degree < 1:
            return np.zeros(0, dtype=complex)
        h = self.recurrence[weight, :degree]
        comrade = np.diag(h[:-1], -1) - np.diag(h[:-1], 1)
        comrade[:, -1] -= h[-1] / coefficients[-1] * coefficients[:-1]
        return np.asarray(np.linalg.eigvals(comrade), dtype=complex)


@dataclass(frozen=True)
class Columns:
    """Columns `w p_k` on lines s = j x, orthonormal within each parity.

    On the imaginary axis an even polynomial is real and an odd one imaginary. Columns are kept without that factor j:
    `w p_k = V_k` for even and `j V_k` for odd k, so that real arithmetic is enough and even and odd never meet. Of
    complex rows the even ones see the real parts and the odd ones the imaginary parts, see `parted`.
    """

    parts: (
        FloatArray  # (n_weight, 2, degree // 2 + 1, n_freq) V_0, V_2, ..; V_1, V_3, .., zeros last for an even degree
    )
    degree: int

    @property
    def even(self) -> FloatArray:
        """V_0, V_2, .. (n_weight, degree // 2 + 1, n_freq)."""
        return self.parts[:, 0]

    @property
    def odd(self) -> FloatArray:
        """V_1, V_3, .. (n_weight, (degree + 1) // 2, n_freq)."""
        return self.parts[:, 1, : (self.degree + 1) // 2]

    def limit(self, degrees: IntArray) -> None:
        """Makes columns beyond each weight's degree (n_weight,) zero."""
        powers = np.arange(2)[:, None] + 2 * np.arange(self.parts.shape[2])
        self.parts[powers > degrees[:, None, None]] = 0.0

    def along(self, parts: FloatArray) -> FloatArray:
        """Returns the inner products (n_weight, 2, n_row, degree // 2 + 1) of parted rows with columns."""
        return np.asarray(parts @ self.parts.swapaxes(-1, -2))

    def combine(self, products: FloatArray) -> FloatArray:
        """Returns the sums, parted, of columns with coefficients as `along` returns them."""
        return np.asarray(products @ self.parts)

    def ordered(self, products: FloatArray) -> FloatArray:
        """Returns what `along` returns by degree (n_weight, n_row, degree + 1)."""
        mixed = products.transpose(0, 2, 3, 1)
        return mixed.reshape(*mixed.shape[:2], -1)[..., : self.degree + 1]

    def one(self, weight: int) -> ComplexArray:
        """Returns all columns (degree + 1, n_freq) of one weight, factors j included."""
        found = np.empty((self.degree + 1, self.parts.shape[3]), dtype=complex)
        found[::2], found[1::2] = self.even[weight], 1j * self.odd[weight]
        return found


def parted(rows: ComplexArray) -> FloatArray:
    """Returns real and imaginary parts (n_weight, 2, n_row, n_freq) of rows (n_weight, n_row, n_freq)."""
    found = np.empty((rows.shape[0], 2, *rows.shape[1:]))
    found[:, 0], found[:, 1] = rows.real, rows.imag
    return found


def orthogonalise(weights: FloatArray, x: FloatArray, degree: int) -> tuple[Columns, Polynomials]:
    """Builds the polynomials up to a degree that are orthogonal on lines s = j x.

    For the degrees of transfer functions, columns by the recurrence alone stay orthogonal to rounding.

    Args:
        weights (n_weight, n_freq): Magnitudes |w| of the weights.
        x (n_freq,): Frequencies.
        degree: Of the last polynomial.
    """
    n_weight, n_freq = weights.shape
    parts = np.empty((n_weight, 2, degree // 2 + 1, n_freq))
    if degree % 2 == 0:
        parts[:, 1, -1] = 0.0
    if n_weight == 1:
        first, h = _recur_alone(weights[0], x, degree, parts[0])
    else:
        first, h = _recur(weights, x, degree, parts)
    return Columns(parts, degree), Polynomials(first, h)


def _recur(weights: FloatArray, x: FloatArray, degree: int, parts: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Fills in the columns; returns the constants p_0 (n_weight,) and the recurrence (n_weight, degree)."""
    h = np.empty((len(weights), degree))
    first = 1 / np.maximum(np.sqrt(np.einsum("ef,ef->e", weights, weights)), _TINY)
    last = np.multiply(weights, first[:, None], out=parts[:, 0, 0])
    before = last
    turned = (x, -x)
    for k in range(degree):
        # s p_k: j x times an even column is odd, times an odd one (j x)(j V) = -x V even.
        v = turned[k % 2] * last
        if k:
            v += h[:, k - 1, None] * before
        size = np.maximum(np.sqrt(np.einsum("ef,ef->e", v, v)), _TINY)
        h[:, k] = size
        before, last = last, np.divide(v, size[:, None], out=parts[:, (k + 1) % 2, (k + 1) // 2])
    return first, h


def _recur_alone(weight: FloatArray, x: FloatArray, degree: int, parts: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The same for one weight (n_freq,): one row a step costs little more than calling for it."""
    h = np.empty((1, degree))
    first = 1 / max(math.sqrt(weight.dot(weight)), _TINY)
    before = last = np.multiply(weight, first, out=parts[0, 0])
    turned, size = (x, -x), 0.0
    for k in range(degree):
        v = np.multiply(turned[k % 2], last, out=parts[(k + 1) % 2, (k + 1) // 2])
        if k:
            v += size * before
        size = max(math.sqrt(v.dot(v)), _TINY)
        v /= size
        h[0, k] = size
        before, last = last, v
    return np.array([first]), h
