"""Orthogonal polynomials on the lines, the basis in which numerators and denominators are sought.

With weights |w| = 1 / (sigma |A|) the columns w p_k(s) are orthonormal over the lines: numerators of every degree
follow by inner products. Powers of s over three decades and ten poles are not independent in double precision; these
are.

Source:
    Richardson and Formenti (1982), "Parameter estimation from frequency response measurements using rational fraction
    polynomials"; Brubeck, Nakatsukasa and Trefethen (2021), "Vandermonde with Arnoldi".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray

_TINY = 1e-300


@dataclass(frozen=True)
class Polynomials:
    """Real polynomials p_k of degree k, by their recurrence `s p_k = sum_j H_jk p_j`, of several weights at once."""

    first: FloatArray  # (n_weight,) the constant p_0
    recurrence: FloatArray  # (n_weight, degree + 1, degree) H, of which every other diagonal is zero

    @property
    def degree(self) -> int:
        """Degree of the last one."""
        return int(self.recurrence.shape[2])

    def values(self, s: ComplexArray, weight: int = 0) -> ComplexArray:
        """Computes the values (degree + 1, *shape) of the polynomials of one weight anywhere."""
        H, found = self.recurrence[weight], np.zeros((self.degree + 1, *np.shape(s)), dtype=complex)
        found[0] = self.first[weight]
        for k in range(self.degree):
            found[k + 1] = (s * found[k] - np.tensordot(H[: k + 1, k], found[: k + 1], axes=1)) / H[k + 1, k]
        return found

    def powers(self, weight: int = 0) -> FloatArray:
        """Returns the coefficients (degree + 1, degree + 1) of the polynomials of one weight, lowest power first."""
        H, found = self.recurrence[weight], np.zeros((self.degree + 1, self.degree + 1))
        found[0, 0] = self.first[weight]
        for k in range(self.degree):
            found[k + 1, 1:] = found[k, :-1]
            found[k + 1] = (found[k + 1] - H[: k + 1, k] @ found[: k + 1]) / H[k + 1, k]
        return found

    def roots(self, coefficients: FloatArray, weight: int = 0) -> ComplexArray:
        """Returns the roots of `sum_k c_k p_k`, c (n_coefficient,) without trailing zeros.

        They are eigenvalues of the recurrence's square part with the last polynomial eliminated by the sum's own root
        (comrade matrix), which keeps the digits that powers of s would lose.
        """
        degree = len(coefficients) - 1
        if degree < 1:
            return np.zeros(0, dtype=complex)
        H = self.recurrence[weight, : degree + 1, :degree]
        comrade = H[:degree].copy()
        comrade[:, -1] -= H[degree, -1] / coefficients[-1] * coefficients[:-1]
        return np.asarray(np.linalg.eigvals(comrade), dtype=complex)


def orthogonalise(weights: FloatArray, x: FloatArray, degree: int) -> tuple[FloatArray, Polynomials]:
    """Builds the polynomials orthogonal on lines s = j x.

    On the imaginary axis an even polynomial is real and an odd one imaginary. Columns are kept without that factor j:
    `w p_k = V_k` for even and `j V_k` for odd k, so that real arithmetic is enough and even and odd never meet.

    Args:
        weights (n_weight, n_freq): Magnitudes |w| of the weights.
        x (n_freq,): Frequencies.
        degree: Of the last polynomial.

    Returns:
        Columns V (n_weight, degree + 1, n_freq), orthonormal within each parity, and the polynomials.
    """
    n_weight, n_freq = weights.shape
    V, H = np.zeros((n_weight, degree + 1, n_freq)), np.zeros((n_weight, degree + 1, degree))
    first = 1 / np.maximum(np.sqrt(np.einsum("ef,ef->e", weights, weights)), _TINY)
    V[:, 0] = weights * first[:, None]
    for k in range(degree):
        # s p_k: j x times an even column is odd, times an odd one (j x)(j V) = -x V even.
        v = (x if k % 2 == 0 else -x) * V[:, k]
        if k:
            # Skew symmetry of multiplication by s gives the one coefficient there is in exact arithmetic.
            H[:, k - 1, k] = -H[:, k, k - 1]
            v -= H[:, k - 1, k, None] * V[:, k - 1]
            same = V[:, (k + 1) % 2 : k + 1 : 2]
            rest = same @ v[:, :, None]
            v -= (rest.transpose(0, 2, 1) @ same)[:, 0]
            H[:, (k + 1) % 2 : k + 1 : 2, k] += rest[:, :, 0]
        size = np.maximum(np.sqrt(np.einsum("ef,ef->e", v, v)), _TINY)
        H[:, k + 1, k] = size
        V[:, k + 1] = v / size[:, None]
    return V, Polynomials(first, H)
