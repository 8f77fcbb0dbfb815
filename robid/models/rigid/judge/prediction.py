"""Torques that a rigid model predicts along motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robid.arrays import FloatArray, IntArray, Quantity
from robid.models.rigid.fit.options import PreprocessingOptions
from robid.models.rigid.fit.preprocessing import prepare
from robid.models.rigid.fit.reading import Reading
from robid.models.rigid.fit.shots import Shot
from robid.robot.regressor.model import RigidModel


@dataclass(frozen=True)
class Prediction:
    """Measured and predicted torques, filtered alike; NaN where a row does not count."""

    time_s: Annotated[FloatArray, Quantity("s", "row", "Time, shots after each other")]
    measured: Annotated[FloatArray, Quantity("N m, or the drives' unit", "row joint", "Measured torque", compact=True)]
    predicted: Annotated[FloatArray, Quantity("N m, or the drives' unit", "row joint", "The model's", compact=True)]

    @property
    def n_row(self) -> IntArray:
        """Rows of each joint (n_joint,) that count."""
        return np.asarray(np.isfinite(self.measured).sum(axis=0))

    @property
    def relative_error(self) -> FloatArray:
        """Norm of the error over that of the measured torque (n_joint,); NaN of a joint without rows."""
        error = np.nansum((self.measured - self.predicted) ** 2, axis=0)
        size = np.nansum(self.measured**2, axis=0)
        return np.asarray(np.sqrt(np.divide(error, size, out=np.full_like(error, np.nan), where=size > 0)))

    @property
    def total_error(self) -> float:
        """Norm of the error over that of the measured torque, all joints together."""
        error = np.nansum((self.measured - self.predicted) ** 2)
        return float(np.sqrt(error / np.nansum(self.measured**2)))

    @property
    def deviation(self) -> FloatArray:
        """Root mean square of the error (n_joint,); NaN of a joint without rows [N m]."""
        error = np.nansum((self.measured - self.predicted) ** 2, axis=0)
        count = self.n_row
        return np.asarray(np.sqrt(np.divide(error, count, out=np.full_like(error, np.nan), where=count > 0)))


def predict(
    model: RigidModel, parameters: FloatArray, shots: Sequence[Shot], filters: PreprocessingOptions
) -> Prediction:
    """Predicts torques along the measured motion of some shots.

    Args:
        model: The model.
        parameters (n_param,): Values of its columns.
        shots: What was recorded.
        filters: Filters of positions, torques and columns.

    Raises:
        ValueError: If a shot is too short for its filters.
    """
    decimator = filters.decimator(shots[0].sampling_period_s)
    motions = [
        prepare(
            shot.position,
            shot.torque,
            shot.sampling_period_s,
            filters,
            held=shot.held,
            load_dependent=model.needs_torque,
            loaded=shot.loaded,
        )
        for shot in shots
    ]
    measured, predicted = [], []
    for rows in Reading(motions, model, decimator):
        measured.append(np.where(rows.used, rows.torque, np.nan))
        predicted.append(np.where(rows.used, rows.columns @ parameters, np.nan))
    if not measured:
        raise ValueError("The filters leave no rows of the record: it is shorter than they reach.")
    whole = np.concatenate(measured)
    time_s = np.arange(len(whole)) * decimator.factor * shots[0].sampling_period_s
    return Prediction(time_s, whole, np.concatenate(predicted))
