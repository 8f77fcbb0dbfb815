"""What each place says of the parameters, to first order around a point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray

_NOTHING = 1e-12  # scaled information relative to the largest of a place, below which a place says nothing


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
