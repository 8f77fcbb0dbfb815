"""Huber's estimator by iteratively reweighted least squares."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Literal

import numpy as np

from robid.arrays import FloatArray
from robid.models.rigid.fit.least_squares import Regression, ordinary_least_squares, solve_factor
from robid.models.rigid.fit.options import HuberOptions
from robid.models.rigid.fit.reduction import Reduction, reduce_weighted, residuals
from robid.models.rigid.fit.rows import RowSource

_GAUSSIAN = 0.6745  # median of a standard Gaussian's magnitude


@dataclass(frozen=True)
class HuberRegression(Regression):
    """Huber's estimate.

    Attributes:
        scale (n_joint,): Robust deviation of each joint's residual.
        share_down_weighted: Share of the rows that lost weight.
    """

    scale: FloatArray = field(default_factory=lambda: np.zeros(0))
    share_down_weighted: float = 0.0


def robust_scale(residual: FloatArray) -> FloatArray:
    """Returns the deviation (n_joint,) that the median of each joint's residuals (n_row, n_joint) speaks of.

    Source:
        Janot et al. (2009), eq. 18, with the median subtracted inside the magnitude.
    """
    centred = (joint[np.isfinite(joint)] - np.nanmedian(joint) for joint in residual.T)
    return np.array([np.median(np.abs(joint)) for joint in centred]) / _GAUSSIAN


def huber_weights(standardised: FloatArray, bend: float) -> FloatArray:
    """Returns the weight of each residual in deviations; that of an unused row (NaN) is 0 (eq. 16)."""
    magnitude = np.abs(np.nan_to_num(standardised, nan=np.inf))
    return np.asarray(bend / np.maximum(magnitude, bend))


def huber(source: RowSource, reduction: Reduction, options: HuberOptions | None = None) -> HuberRegression:
    """Estimates with weights that fall beyond the bend, scale and parameters in turn, from least squares on.

    Args:
        source: The rows; one pass for each iteration and one before.
        reduction: The same rows reduced without weights.
        options: Weights and when to stop.

    Raises:
        ValueError: If the median residual of a joint is zero.

    Source:
        Janot et al. (2009), eq. 14-19 (Holland and Welsch 1977); a scale for each joint. The scale is that of the
        residuals one pass before, so that a pass gives both.
    """
    chosen = options or HuberOptions()
    parameters = ordinary_least_squares(reduction).parameters
    scale = robust_scale(residuals(source, parameters))
    status: Literal["converged", "iteration_limit"] = "iteration_limit"
    iterations = 0
    while status != "converged" and iterations < chosen.iteration_limit:
        iterations += 1
        _check_scale(scale)
        weighted, residual = reduce_weighted(source, parameters, partial(_row_weights, scale=scale, bend=chosen.bend))
        before, scale_before, scale = parameters, scale, robust_scale(residual)
        parameters, inverse, condition = solve_factor(weighted.weighted(scale_before**-2.0))
        small_step = chosen.tolerance * np.sqrt(np.diag(inverse))
        settled = np.all(np.abs(scale - scale_before) <= chosen.tolerance * scale)
        if settled and np.all(np.abs(parameters - before) <= small_step):
            status = "converged"
    fit = (parameters, inverse, condition)
    return _estimate(fit, residual, scale, reduction, iterations, status, chosen)


def sweep_bend(
    source: RowSource, reduction: Reduction, bends: Sequence[float], options: HuberOptions | None = None
) -> tuple[HuberRegression, ...]:
    """Estimates with each of several bends: towards 0 they minimise magnitudes, towards infinity squares."""
    return tuple(huber(source, reduction, replace(options or HuberOptions(), bend=bend)) for bend in bends)


def _row_weights(residual: FloatArray, scale: FloatArray, bend: float) -> FloatArray:
    return huber_weights(residual / scale, bend)


def _check_scale(scale: FloatArray) -> None:
    if not np.all(scale > 0):
        raise ValueError("Half of a joint's residuals are equal, so they have no scale: is its torque quantised?")


def _estimate(
    fit: tuple[FloatArray, FloatArray, float],
    residual: FloatArray,
    scale: FloatArray,
    reduction: Reduction,
    iterations: int,
    status: Literal["converged", "iteration_limit"],
    options: HuberOptions,
) -> HuberRegression:
    parameters, inverse, condition = fit
    n_row, n_param = reduction.n_row, len(parameters)
    standardised = [joint[np.isfinite(joint)] / own for joint, own in zip(residual.T, scale, strict=True)]
    squares = np.array([huber_weights(joint, options.bend) @ joint**2 for joint in standardised])
    freedom = n_row * (1 - n_param / n_row.sum())
    down = 1 - sum(np.count_nonzero(np.abs(joint) <= options.bend) for joint in standardised) / n_row.sum()
    if options.covariance == "weighted":
        covariance = inverse * squares.sum() / freedom.sum()
    else:
        _, plain, _ = solve_factor(reduction.weighted(scale**-2.0))
        scores = sum(float(np.sum(np.clip(joint, -options.bend, options.bend) ** 2)) for joint in standardised)
        covariance = plain * _asymptotic_factor(scores / freedom.sum(), down, n_param / n_row.sum())
    return HuberRegression(
        parameters=parameters,
        covariance=covariance,
        deviation=np.sqrt(squares / freedom) * scale,
        n_row=n_row,
        weights=scale**-2.0,
        condition=condition,
        iterations=iterations,
        status=status,
        scale=scale,
        share_down_weighted=float(down),
    )


def _asymptotic_factor(mean_square_score: float, share_down: float, param_per_row: float) -> float:
    """What multiplies `(W' W)^-1` for an M-estimator (Huber 1981, eq. 7.6.10), residuals in deviations."""
    linear = 1 - share_down
    correction = 1 + param_per_row * share_down / linear
    return correction**2 * mean_square_score / linear**2
