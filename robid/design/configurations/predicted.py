"""What candidates add to a fit whose model may lack something, by assumed errors or a measured response's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.design.configurations.candidates import ParametersOfInterest, relative_derivatives
from robid.design.configurations.measured import Derivatives, weighted_rows
from robid.design.configurations.prediction import (
    PredictionParts,
    parts_of_one,
    predicted_means,
    second_moment_root,
)
from robid.frf.residual import LOGARITHM, Residual
from robid.robot.description import Robot


@dataclass(frozen=True)
class Lacking:
    """What a model may lack, and what that does to the log responses of some configurations."""

    columns: ComplexArray  # (n_conf, n_freq, n_out, n_in, n_amount) Derivatives of the log response by the amounts
    std: FloatArray  # (n_amount,) Deviation of the amounts that all configurations share
    cluster_std: FloatArray  # (n_amount,) Deviation of what each configuration adds
    least: FloatArray  # (n_amount,) Smallest amounts that make sense

    def at(self, index: int) -> ComplexArray:
        """Those (n_freq, n_element, n_amount) of one configuration."""
        columns = self.columns[index]
        return np.asarray(columns.reshape(len(columns), -1, columns.shape[-1]))

    def share(self, index: int) -> FloatArray:
        """Share (n_freq, n_element) of its weight that each element of one configuration keeps.

        A logarithm does not grow as its derivative does: beside a zero of the response, what may be off by more than
        the response itself says nothing of it, and its error counts as about as large as the response.
        """
        return np.asarray(1 / (1 + np.abs(self.at(index)) ** 2 @ (self.std**2 + self.cluster_std**2)))

    @property
    def root(self) -> FloatArray:
        """What makes independent amounts of unit variance into these, see `second_moment_root`."""
        return second_moment_root(self.std, self.least)


def assumed_prediction(
    robot: Robot,
    configurations: FloatArray,
    frequency_hz: FloatArray,
    sampling_period_s: float,
    delay_s: float,
    relative_error: float,
    wanted: ParametersOfInterest,
    weights: FloatArray,
    lacking: Lacking,
    between: FloatArray,
) -> PredictionParts:
    """Parts of candidates whose responses all have the same relative error, each configuration to be predicted too.

    Args:
        robot: Nominal robot.
        configurations (n_conf, n_joint): Candidates [rad].
        frequency_hz (n_freq,): Excited frequencies [Hz].
        sampling_period_s: Sampling period [s].
        delay_s: Delay from recorded to applied torque [s].
        relative_error: Relative standard deviation of each response element.
        wanted: The parameters.
        weights (n_freq, n_out, n_in): Weights of the elements, in the fit and of the prediction.
        lacking: What the model may lack.
        between (n_wanted,): Deviation of each wanted parameter between configurations.
    """
    own = relative_derivatives(robot, configurations, frequency_hz, sampling_period_s, delay_s, wanted)
    apart, precision = _between(between, wanted.precision), wanted.precision
    found = []
    for index, row in enumerate(own):
        j = row.reshape(len(row), -1, row.shape[-1])
        importance = weights.reshape(len(row), -1) * lacking.share(index)
        pull = (importance / relative_error**2)[..., None] * j
        bread = 2 * np.real(pull.reshape(-1, j.shape[-1]).conj().T @ j.reshape(-1, j.shape[-1]))
        local = parts_of_one(j, pull, lacking.at(index), lacking.cluster_std, apart)
        found.append((bread, bread, bread, *local, *predicted_means(j, lacking.at(index), importance, lacking.root)))
    return stacked(found, precision, lacking.root)


def measured_prediction(
    derivatives: Derivatives,
    weights: FloatArray,
    importance: FloatArray,
    lacking: Lacking,
    between: FloatArray,
    *,
    residual: Residual = LOGARITHM,
    whitening: ComplexArray | None = None,
) -> PredictionParts:
    """Parts of candidates by their measured or simulated responses, each configuration to be predicted too.

    Args:
        derivatives: Derivatives by the parameters, with the response and its covariance.
        weights (n_conf, n_freq, n_out, n_in): Weights of the squared residuals as the fit computes them.
        importance (n_freq, n_out, n_in): Weights of the predicted elements.
        lacking: What the model may lack.
        between (n_wanted,): Deviation of each wanted parameter between configurations.
        residual: Residual of the fit.
        whitening: As for `fitted_information`.
    """
    apart = _between(between, derivatives.precision)
    found = []
    for index, row in enumerate(weighted_rows(derivatives, weights, whitening, residual)):
        n_all, pull = row.own.shape[-1], row.weighted.reshape(-1, row.own.shape[-1]).conj().T
        bread = 2 * np.real(pull @ row.own.reshape(-1, n_all))
        further, share = lacking.at(index), lacking.share(index)
        # The fit has its own weights; there, what may be off by more than the response is as large as that.
        scale = residual.per_relative(derivatives.frf.response[index]).reshape(share.shape) * np.sqrt(share)
        moved = residual.part(scale[..., None] * further)
        local = parts_of_one(row.own, row.weighted, moved, lacking.cluster_std, apart)
        # The prediction is judged by relative errors, whatever the fit's residual.
        j = row.own if residual is LOGARITHM else derivatives.at(index)[0]
        # Friction that was compensated moves the measured response, and no prediction.
        j = np.where(np.arange(n_all) < derivatives.wanted.precision.size, j, 0.0)
        means = predicted_means(j, further, importance.reshape(share.shape) * share, lacking.root)
        found.append((bread, row.meat(), row.best, *local, *means))
    return stacked(found, derivatives.precision, lacking.root)


def _between(between: FloatArray, precision: FloatArray) -> FloatArray:
    """Deviation (n_all,) of all parameters; those that are estimated along are the same everywhere."""
    return np.concatenate([between, np.zeros(precision.size - between.size)])


def stacked(rows: Sequence[tuple[FloatArray | float, ...]], precision: FloatArray, root: FloatArray) -> PredictionParts:
    """Parts of candidates, each with bread, noise, best, lacking, apart, own, mixed and whole, for one draw."""
    bread, noise, best, lacking, apart, own, mixed, whole = (np.array(each)[None] for each in zip(*rows, strict=True))
    means = own.mean(axis=1), mixed.mean(axis=1), whole.mean(axis=1)
    return PredictionParts(bread, noise, best, apart, lacking @ root, precision, *means)
