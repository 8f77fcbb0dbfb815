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
    `w p_k = V_k` for even and `j V_k` for odd k, so that real arithmetic is enough and even and odd never meet.
    """

    even: FloatArray  # (n_weight, degree // 2 + 1, n_freq) V_0, V_2, ..
    odd: FloatArray  # (n_weight, (degree + 1) // 2, n_freq) V_1, V_3, ..

    def limit(self, degrees: IntArray) -> None:
        """Makes columns beyond each weight's degree (n_weight,) zero."""
        self.even[2 * np.arange(self.even.shape[1]) > degrees[:, None]] = 0.0
        self.odd[2 * np.arange(self.odd.shape[1]) + 1 > degrees[:, None]] = 0.0

    def along(self, rows: ComplexArray) -> FloatArray:
        """Returns the inner products (n_weight, n_row, degree + 1) of rows (n_weight, n_row, n_freq) with columns."""
        found = np.empty((*rows.shape[:2], self.even.shape[1] + self.odd.shape[1]))
        found[..., ::2] = rows.real @ self.even.transpose(0, 2, 1)
        found[..., 1::2] = rows.imag @ self.odd.transpose(0, 2, 1)
        return found

    def combine(self, coefficients: FloatArray) -> ComplexArray:
        """Returns the sums (n_weight, n_row, n_freq) of columns with coefficients (n_weight, n_row, degree + 1)."""
        found = np.empty((*coefficients.shape[:2], self.even.shape[2]), dtype=complex)
        found.real = np.ascontiguousarray(coefficients[..., ::2]) @ self.even
        found.imag = np.ascontiguousarray(coefficients[..., 1::2]) @ self.odd
        return found

    def one(self, weight: int) -> ComplexArray:
        """Returns all columns (degree + 1, n_freq) of one weight, factors j included."""
        found = np.empty((self.even.shape[1] + self.odd.shape[1], self.even.shape[2]), dtype=complex)
        found[::2], found[1::2] = self.even[weight], 1j * self.odd[weight]
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
    halves = np.empty((n_weight, degree // 2 + 1, n_freq)), np.empty((n_weight, (degree + 1) // 2, n_freq))
    h = np.empty((n_weight, degree))
    first = 1 / np.maximum(np.sqrt(np.einsum("ef,ef->e", weights, weights)), _TINY)
    last = np.multiply(weights, first[:, None], out=halves[0][:, 0])
    before = last
    turned = (x, -x)
    for k in range(degree):
        # s p_k: j x times an even column is odd, times an odd one (j x)(j V) = -x V even.
        v = turned[k % 2] * last
        if k:
            v += h[:, k - 1, None] * before
        size = np.maximum(np.sqrt(np.einsum("ef,ef->e", v, v)), _TINY)
        h[:, k] = size
        before, last = last, np.divide(v, size[:, None], out=halves[(k + 1) % 2][:, (k + 1) // 2])
    return Columns(*halves), Polynomials(first, h)
