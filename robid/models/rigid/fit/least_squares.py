"""Least squares from reduced rows, plain and with a weight per joint."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.linalg import solve_triangular

from robid.arrays import FloatArray, IntArray
from robid.models.rigid.fit.reduction import Reduction

_PASSES = 20
_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Regression:
    """Parameters of the inverse dynamics and how certain they are.

    Attributes:
        parameters (n_param,): Estimates.
        covariance (n_param, n_param): Their covariance by the estimator's own formula.
        deviation (n_joint,): Standard deviation of each joint's residual [N m, or N].
        n_row (n_joint,): Rows of each joint.
        weights (n_joint,): Weight of each joint's rows.
        condition: Condition number of the weighted rows' columns, each divided by its norm.
        iterations: Passes that the estimator took.
        status: How it ended.
    """

    parameters: FloatArray
    covariance: FloatArray
    deviation: FloatArray
    n_row: IntArray
    weights: FloatArray
    condition: float
    iterations: int = 1
    status: Literal["converged", "iteration_limit"] = "converged"

    @property
    def standard_deviation(self) -> FloatArray:
        """Standard deviation (n_param,) of each parameter."""
        return np.sqrt(np.diag(self.covariance))


def ordinary_least_squares(reduction: Reduction) -> Regression:
    """Estimates with equal weights.

    Source:
        Janot et al. (2009), eq. 5, 7 (with the square that it lacks) and 8.
    """
    return _solve(reduction, np.ones(len(reduction.n_row)), pooled=True)


def weighted_least_squares(reduction: Reduction) -> Regression:
    """Estimates with the inverse of each joint's residual variance as its weight, until the variances stay.

    Raises:
        ValueError: If a joint has no residual to weight by.
    """
    found = ordinary_least_squares(reduction)
    for iteration in range(1, _PASSES + 1):
        if not np.all(found.deviation > 0):
            raise ValueError("A joint without a residual has no weight: does its motor's torque vary?")
        before = found.deviation
        found = _solve(reduction, before**-2.0, pooled=False)
        if np.all(np.abs(found.deviation - before) <= _TOLERANCE * before):
            return replace(found, iterations=iteration + 1)
    return replace(found, iterations=_PASSES + 1, status="iteration_limit")


def solve_factor(factor: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Solves the least-squares problem of a triangular factor of `[W y]`.

    Args:
        factor (n_param + 1, n_param + 1): The factor.

    Returns:
        Parameters (n_param,), `(W' W)^-1` (n_param, n_param) and the condition number of W with columns of norm one.

    Raises:
        ValueError: If the columns are dependent.
    """
    triangle, right = factor[:-1, :-1], factor[:-1, -1]
    scale = np.linalg.norm(triangle, axis=0)
    if not np.all(scale > 0):
        raise ValueError("A parameter moves no torque of any row: leave it out, or excite it.")
    values = np.linalg.svd(triangle / scale, compute_uv=False)
    if values[-1] <= len(values) * np.finfo(float).eps * values[0]:
        raise ValueError("The rows do not determine all parameters: fit base parameters.")
    inverse = solve_triangular(triangle / scale, np.eye(len(triangle))) / scale[:, None]
    return inverse @ right, inverse @ inverse.T, float(values[0] / values[-1])


def _solve(reduction: Reduction, weights: FloatArray, pooled: bool) -> Regression:
    parameters, covariance, condition = solve_factor(reduction.weighted(weights))
    cost = reduction.cost(parameters)
    total, n_param = reduction.n_row.sum(), reduction.n_param
    # The parameters' degrees of freedom are shared by the joints as their rows are.
    deviation = np.sqrt(cost / (reduction.n_row * (1 - n_param / total)))
    if pooled:
        covariance = covariance * cost.sum() / (total - n_param)
    return Regression(parameters, covariance, deviation, reduction.n_row, weights, condition)
