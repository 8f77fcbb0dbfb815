"""What each place says of the parameters, to first order around a point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray, check_shape

_NOTHING = 1e-12
"""Scaled information relative to the largest of a place, below which a place says nothing."""


@dataclass(frozen=True)
class Evidence:
    """What each place says, as few rows of unit noise: `target = rows (own - point) + noise`.

    Attributes:
        rows (n_place, n_row, n_param): Derivative of each row by the parameters, all noise of deviation one.
        target (n_place, n_row): What is left of each row at the point.
        precision (n_param, n_param): What is known beforehand, an inverse covariance; zero for nothing.
        pull (n_param,): `precision` times how far what is known beforehand lies from the point.
    """

    rows: FloatArray
    target: FloatArray
    precision: FloatArray
    pull: FloatArray

    @property
    def information(self) -> FloatArray:
        """Information (n_place, n_param, n_param) of each place."""
        return np.asarray(self.rows.swapaxes(1, 2) @ self.rows)

    @property
    def score(self) -> FloatArray:
        """Information times how far each place's own estimate lies from the point (n_place, n_param)."""
        return np.asarray((self.target[:, None] @ self.rows)[:, 0])

    def moved(self, shift: FloatArray) -> Evidence:
        """The same around a point that lies further by a shift (n_param,), where all is linear."""
        return Evidence(self.rows, self.target - self.rows @ shift, self.precision, self.pull - self.precision @ shift)


def gather(
    residual: FloatArray | ComplexArray,
    derivative: FloatArray | ComplexArray,
    places: Sequence[Sequence[int]],
    precision: FloatArray,
    pull: FloatArray,
) -> Evidence:
    """Compresses weighted residuals to what they say of the parameters.

    Args:
        residual (n_conf, ...): Measured minus modelled, over the deviation of its noise; `E|r|^2 = 1` for circular
            complex ones.
        derivative (n_conf, ..., n_param): Derivative of the model, weighted alike.
        places: Indices of the configurations of each place.
        precision (n_param, n_param): What is known beforehand, an inverse covariance.
        pull (n_param,): `precision` times how far that lies from the point.
    """
    n_param = derivative.shape[-1]
    check_shape("precision", precision, "n_param n_param", n_param=n_param)
    found = [_compressed(residual[list(place)], derivative[list(place)], n_param) for place in places]
    return Evidence(np.array([rows for rows, _ in found]), np.array([left for _, left in found]), precision, pull)


def summarise(
    bread: FloatArray, score: FloatArray, meat: FloatArray, precision: FloatArray, pull: FloatArray
) -> Evidence:
    """Takes what weighted estimates say whose weights are not the inverse of their errors' covariance.

    A place's own estimate lies `bread^-1 score` from the point, with the covariance `bread^-1 meat bread^-1`. Neither
    inverse need be there: a place may say nothing of some parameters.

    Args:
        bread (n_place, n_param, n_param): Weighted information of each place.
        score (n_place, n_param): Weighted residuals times their derivative, `bread` times the own estimate's shift.
        meat (n_place, n_param, n_param): Covariance of the score.
        precision (n_param, n_param): What is known beforehand, an inverse covariance.
        pull (n_param,): `precision` times how far that lies from the point.
    """
    scale = np.sqrt(np.maximum(np.diagonal(meat, axis1=1, axis2=2), 1e-300))
    values, vectors = np.linalg.eigh(meat / (scale[:, :, None] * scale[:, None]))
    kept = values > _NOTHING * np.maximum(values[:, -1:], 1e-300)
    root = np.where(kept, 1 / np.sqrt(np.where(kept, values, 1.0)), 0.0)
    whiten = root[:, :, None] * vectors.swapaxes(1, 2) / scale[:, None]
    return Evidence(whiten @ bread, (whiten @ score[..., None])[..., 0], precision, pull)


def _compressed(
    residual: FloatArray | ComplexArray, derivative: FloatArray | ComplexArray, n_param: int
) -> tuple[FloatArray, FloatArray]:
    stacked = np.concatenate([derivative.reshape(-1, n_param), residual.reshape(-1, 1)], axis=1)
    if np.iscomplexobj(stacked):
        stacked = np.sqrt(2) * np.concatenate([stacked.real, stacked.imag])
    triangle = np.zeros((n_param, n_param + 1))
    found = np.linalg.qr(stacked, mode="r")[:n_param]
    triangle[: len(found)] = found
    return triangle[:, :-1], triangle[:, -1]
