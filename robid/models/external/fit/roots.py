"""Roots of fitted polynomials, and how far each may be off by the delta method."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.models.external.fit.transfer import TransferMatrix


@dataclass(frozen=True)
class Root:
    """A real root, or that with positive imaginary part of a pair.

    Attributes:
        place: Where it is [rad/s].
        moves (n_root,): What each column of the coefficients' covariance root moves it by [rad/s].
    """

    place: complex
    moves: ComplexArray

    @property
    def relative_std(self) -> float:
        """Standard deviation of the magnitude, a rate or a natural frequency, over the magnitude."""
        size = abs(self.place)
        if size == 0:
            return float("inf")
        return float(np.linalg.norm((np.conj(self.place) * self.moves).real)) / size**2

    @property
    def real_std(self) -> float:
        """Standard deviation of the real part [rad/s]."""
        return float(np.linalg.norm(self.moves.real))

    def differs(self, other: Root, quantile: float) -> bool:
        """Whether it lies significantly apart from another root of the same fit.

        Args:
            other: The other root.
            quantile: Largest distance in standard deviations that chance explains.
        """
        distance, moves = self.place - other.place, self.moves - other.moves
        both = np.stack([moves.real, moves.imag])
        value = np.array([distance.real, distance.imag])
        if not np.isfinite(both).all():
            return False
        kept = np.linalg.norm(both, axis=1) > 0
        covariance = (both @ both.T)[np.ix_(kept, kept)]
        return bool(value[kept] @ np.linalg.pinv(covariance) @ value[kept] > quantile**2)


def poles_of(model: TransferMatrix, root: FloatArray) -> tuple[Root, ...]:
    """Returns the poles, slow ones first.

    Args:
        model: The transfer functions.
        root (n_param, n_root): Root of the covariance of `[numerators, denominator]` without the latter's first.
    """
    n_pole = len(model.denominator) - 1
    return _roots(model.denominator, np.concatenate([np.zeros((1, root.shape[1])), root[-n_pole:]]))


def zeros_of(model: TransferMatrix, root: FloatArray, output: int = 0, input: int = 0) -> tuple[Root, ...]:  # noqa: A002
    """Returns the zeros of one channel, slow ones first."""
    n_weight = model.numerator.shape[-1]
    first = (output * len(model.inputs) + input) * n_weight
    return _roots(model.numerator[output, input], root[first : first + n_weight])


def _roots(polynomial: FloatArray, root: FloatArray) -> tuple[Root, ...]:
    """Finds the roots of a polynomial (n_power,) with a covariance root (n_power, n_root) of its coefficients."""
    found = sorted(np.roots(polynomial).astype(complex).tolist(), key=lambda each: (abs(each), each.real))
    upper = [each for each in found if each.imag >= 0]
    slope = np.polyder(polynomial)
    with np.errstate(divide="ignore", invalid="ignore"):
        moves = [-(np.vander([each], len(polynomial))[0] @ root) / np.polyval(slope, each) for each in upper]
    return tuple(Root(place, np.asarray(move, dtype=complex)) for place, move in zip(upper, moves, strict=True))
