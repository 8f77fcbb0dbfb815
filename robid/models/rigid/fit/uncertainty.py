"""Intervals that respect residuals correlated in time and between joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from robid.arrays import FloatArray
from robid.models.rigid.fit.huber import HuberRegression
from robid.models.rigid.fit.least_squares import Regression, solve_factor
from robid.models.rigid.fit.reduction import Reduction
from robid.models.rigid.fit.rows import Rows, RowSource

_LARGEST_FREEDOM = 100


@dataclass(frozen=True)
class Influence:
    """An estimator linearised: how each kept sample moves the parameters.

    Attributes:
        parameters (n_param,): Where it is linearised.
        bread (n_param, n_param): Parameters a weighted score.
        weights (n_joint,): Weight of each joint's rows.
        limit (n_joint,): Magnitude at which a residual's pull ends; infinite without a bend.
        instrumented: Whether the scores are the instruments' instead of the columns'.
    """

    parameters: FloatArray
    bread: FloatArray
    weights: FloatArray
    limit: FloatArray
    instrumented: bool = False

    def of(self, rows: Rows) -> FloatArray:
        """Returns the move (n_row, n_param) of the parameters by each kept sample."""
        residual = np.where(rows.used, rows.torque - rows.columns @ self.parameters, 0.0)
        pull = np.clip(residual, -self.limit, self.limit) * self.weights
        source = rows.instruments if self.instrumented and rows.instruments is not None else rows.columns
        return np.asarray(np.matmul(pull[:, None, :], source)[:, 0, :] @ self.bread.T)


def least_squares_influence(reduction: Reduction, estimate: Regression) -> Influence:
    """Linearises plain or weighted least squares."""
    _, bread, _ = solve_factor(reduction.weighted(estimate.weights))
    return Influence(estimate.parameters, bread, estimate.weights, np.full(len(estimate.weights), np.inf))


def huber_influence(reduction: Reduction, estimate: HuberRegression, bend: float) -> Influence:
    """Linearises Huber's estimator, with the mean slope of its score."""
    _, bread, _ = solve_factor(reduction.weighted(estimate.weights))
    slope = 1 - estimate.share_down_weighted
    return Influence(estimate.parameters, bread / slope, estimate.weights, bend * estimate.scale)


@dataclass(frozen=True)
class LongRun:
    """Joint covariance of several estimators of the same parameters.

    Attributes:
        covariance (n_estimator * n_param, n_estimator * n_param): The covariance, one estimator after the other.
        freedom: Degrees of freedom of its variances.
        n_param: Number of parameters.
    """

    covariance: FloatArray
    freedom: int
    n_param: int

    def of(self, index: int) -> FloatArray:
        """Returns the covariance (n_param, n_param) of one estimator."""
        part = slice(index * self.n_param, (index + 1) * self.n_param)
        return self.covariance[part, part]

    def difference(self, first: int, second: int) -> FloatArray:
        """Returns the covariance (n_param, n_param) of the difference of two."""
        one = slice(first * self.n_param, (first + 1) * self.n_param)
        other = slice(second * self.n_param, (second + 1) * self.n_param)
        cross = self.covariance[one, other]
        return np.asarray(self.of(first) + self.of(second) - cross - cross.T)

    def half_width(self, index: int, level: float = 0.95) -> FloatArray:
        """Returns half the width (n_param,) of one estimator's intervals."""
        return np.asarray(student.ppf(0.5 + level / 2, self.freedom) * np.sqrt(np.diag(self.of(index))))


def long_run_covariance(
    source: RowSource, influences: Sequence[Influence], n_row: int, n_used: float | None = None
) -> LongRun:
    """Estimates the covariance of estimators whose residuals are correlated in time, in one pass.

    The long-run variance of the influences is the mean of the squares of their first cosine transforms, whose
    number, 0.4 n^(2/3), is the degrees of freedom of Student's t.

    Args:
        source: The rows.
        influences: The estimators.
        n_row: Kept samples of a pass.
        n_used: How many of them count for a joint in the mean; all by default.

    Source:
        Lazarus, Lewis, Stock and Watson (2018), "HAR inference", the equal-weighted cosine estimator.
    """
    counted = n_row if n_used is None else n_used
    freedom = int(np.clip(0.4 * counted ** (2 / 3), 1, _LARGEST_FREEDOM))
    n_param = len(influences[0].parameters)
    transformed = np.zeros((freedom, len(influences) * n_param))
    frequency = np.pi * np.arange(1, freedom + 1) / n_row
    first = 0
    for rows in source:
        moves = np.concatenate([influence.of(rows) for influence in influences], axis=1)
        moment = first + np.arange(len(moves)) + 0.5
        transformed += np.cos(np.outer(frequency, moment)) @ moves
        first += len(moves)
    # Each parameter taken from the residuals takes its share of their variance away.
    factor = 2 / freedom * counted / max(counted - n_param, 1)
    return LongRun(factor * transformed.T @ transformed, freedom, n_param)
