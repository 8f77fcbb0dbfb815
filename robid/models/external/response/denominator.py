"""Denominators as products of quadratic factors, whose coefficients are what a descent moves.

A factor `s^2 + w u s + w^2 v` goes from a pair to two real poles without a kink, which poles themselves cannot; it is
stable if and only if u and v are above zero, in continuous time and, by the bilinear map, in discrete time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray

_SAME_POLE = 1e-12  # of the magnitude, an imaginary part that counts as none


@dataclass(frozen=True)
class Denominator:
    """A denominator `s^k prod (s^2 + w u s + w^2 v) [(s + w u)]`, over the reference frequency."""

    integrators: int  # exact poles at zero
    sizes: FloatArray  # (n_factor,) w of each factor, fixed
    coefficients: FloatArray  # (n_moving,) u, v of each quadratic factor; u of the linear one, last, if there is one

    @property
    def n_moving(self) -> int:
        """Number of poles that are not integrators."""
        return len(self.coefficients)

    @property
    def n_pole(self) -> int:
        """Number of poles."""
        return self.integrators + self.n_moving

    def factors(self) -> list[FloatArray]:
        """Returns the factors (2,) or (3,), highest power first."""
        found = [
            np.array([1.0, w * u, w**2 * v])
            for w, u, v in zip(self.sizes, self.coefficients[::2], self.coefficients[1::2], strict=False)
        ]
        if self.n_moving % 2:
            found.append(np.array([1.0, self.sizes[-1] * self.coefficients[-1]]))
        return found

    def moving_poles(self) -> ComplexArray:
        """Returns the poles (n_moving,) that are not integrators, factor by factor."""
        if not self.n_moving:
            return np.zeros(0, dtype=complex)
        return np.concatenate([_roots_of(factor) for factor in self.factors()])

    def poles(self) -> ComplexArray:
        """Returns all poles (n_pole,), integrators first."""
        return np.concatenate([np.zeros(self.integrators, dtype=complex), self.moving_poles()])

    def evaluate(self, s: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Computes the denominator (n_freq,) and its logarithmic derivatives (n_moving, n_freq) by the coefficients."""
        n_pair = self.n_moving // 2
        factors = np.empty((len(self.sizes), len(s)), dtype=complex)
        slopes = np.empty((self.n_moving, len(s)), dtype=complex)
        w, own = self.sizes[:n_pair, None], self.coefficients[: 2 * n_pair].reshape(n_pair, 2, 1)
        constant = w * w
        np.multiply(s, s + w * own[:, 0], out=factors[:n_pair])
        factors[:n_pair] += constant * own[:, 1]
        pairs = slopes[: 2 * n_pair].reshape(n_pair, 2, len(s))
        np.divide(constant, factors[:n_pair], out=pairs[:, 1])
        np.multiply(s / w, pairs[:, 1], out=pairs[:, 0])
        if self.n_moving % 2:
            np.add(s, self.sizes[-1] * self.coefficients[-1], out=factors[-1])
            np.divide(self.sizes[-1], factors[-1], out=slopes[-1])
        whole = np.multiply.reduce(factors, axis=0)
        return (whole * s**self.integrators if self.integrators else whole), slopes


def _roots_of(factor: FloatArray) -> ComplexArray:
    """Roots of a factor without cancellation."""
    if len(factor) == 2:
        return np.array([-factor[1]], dtype=complex)
    half = factor[1] / 2
    inside = half**2 - factor[2]
    if inside < 0:
        return np.array([complex(-half, np.sqrt(-inside)), complex(-half, -np.sqrt(-inside))])
    large = -half - np.copysign(np.sqrt(inside), half)
    return np.array([large, factor[2] / large if large else 0.0], dtype=complex)


def denominator_of(poles: ComplexArray, integrators: int = 0) -> Denominator:
    """Builds a denominator of poles (n_moving,), pairs complete; real ones share a factor with their neighbours."""
    above = sorted(poles[poles.imag > _SAME_POLE * np.abs(poles)], key=abs)
    real = np.array(sorted(poles[np.abs(poles.imag) <= _SAME_POLE * np.abs(poles)].real, key=abs))
    left = None
    if len(real) % 2:
        left = int(_odd_one(real))
        single, real = real[left], np.delete(real, left)
    sizes, coefficients = [], []
    for pole in above:
        sizes.append(abs(pole))
        coefficients += [-2 * pole.real / sizes[-1], 1.0]
    for one, other in zip(real[::2], real[1::2], strict=True):
        sizes.append(float(np.sqrt(max(abs(one * other), 1e-200))))
        coefficients += [-(one + other) / sizes[-1], one * other / sizes[-1] ** 2]
    if left is not None:
        sizes.append(max(abs(float(single)), 1e-100))
        coefficients.append(-float(single) / sizes[-1])
    return Denominator(integrators, np.array(sizes), np.array(coefficients))


def _odd_one(real: FloatArray) -> int:
    """Which of an odd number of real poles, sorted by magnitude, leaves pairs of closest neighbours."""
    logs = np.log(np.maximum(np.abs(real), 1e-200))
    gaps = np.diff(logs)
    costs = [gaps[:k:2].sum() + gaps[k + 1 :: 2].sum() for k in range(0, len(real), 2)]
    return 2 * int(np.argmin(costs))
