"""Least squares of any number of rows, plain, weighted and by Huber, from rows that are reduced to a triangle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Literal

import numpy as np
from scipy.linalg import solve_triangular

from robid.arrays import BoolArray, FloatArray, IntArray
from robid.models.rigid.fit.options import HuberOptions
from robid.models.rigid.fit.rows import Rows, RowSource

_PASSES = 200
_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Regression:
    """Parameters of the inverse dynamics and how certain they are."""

    parameters: FloatArray  # (n_param,): estimates
    covariance: FloatArray  # (n_param, n_param): their covariance by the estimator's own formula
    deviation: FloatArray  # (n_joint,): standard deviation of each joint's residual [N m, or N]
    n_row: IntArray  # (n_joint,): rows of each joint
    weights: FloatArray  # (n_joint,): weight of each joint's rows
    condition: float  # condition number of the weighted rows' columns, each divided by its norm
    iterations: int = 1  # passes that the estimator took
    status: Literal["converged", "iteration_limit"] = "converged"  # how it ended

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
        # Weights come of residuals and residuals of weights (feasible generalised least squares): to the fixed point.
        before = found.deviation
        found = _solve(reduction, before**-2.0, pooled=False)
        if np.all(np.abs(found.deviation - before) <= _TOLERANCE * before):
            return replace(found, iterations=iteration + 1)
    return replace(found, iterations=_PASSES + 1, status="iteration_limit")


def solve_factor(factor: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Solves the least-squares problem of a triangular factor (n_param + 1, n_param + 1) of `[W y]`.

    Returns parameters (n_param,), `(W' W)^-1` (n_param, n_param) and the condition number of W with columns of norm
    one.

    Raises:
        ValueError: If the columns are dependent.
    """
    # F' F = [W y]' [W y] with F = [R z; 0 r]: R x = z are the normal equations, which are never formed: their condition
    # would be the square of that of W. Columns of unit norm, as kg m^2 and N m are no common measure.
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
    # The weights are inverse variances already; only unweighted rows take their variance from the cost.
    total, n_param = reduction.n_row.sum(), reduction.n_param
    # The parameters' degrees of freedom are shared by the joints as their rows are.
    deviation = np.sqrt(cost / (reduction.n_row * (1 - n_param / total)))
    if pooled:
        covariance = covariance * cost.sum() / (total - n_param)
    return Regression(parameters, covariance, deviation, reduction.n_row, weights, condition)


_GAUSSIAN = 0.6745  # median of a standard Gaussian's magnitude


@dataclass(frozen=True)
class HuberRegression(Regression):
    """Huber's estimate."""

    # (n_joint,): robust deviation of each joint's residual.
    scale: FloatArray = field(default_factory=lambda: np.zeros(0))
    share_down_weighted: float = 0.0  # share of the rows that lost weight


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
        if not np.all(scale > 0):
            raise ValueError("Half of a joint's residuals are equal, so they have no scale: is its torque quantised?")
        row_weights = partial(lambda residual, scale: huber_weights(residual / scale, chosen.bend), scale=scale)
        weighted, residual = reduce_weighted(source, parameters, row_weights)
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
    # Weighted squares, w r^2 = min(|r|, bend) |r|: beyond the bend they grow with |r| alone.
    squares = np.array([huber_weights(joint, options.bend) @ joint**2 for joint in standardised])
    freedom = n_row * (1 - n_param / n_row.sum())
    down = 1 - sum(np.count_nonzero(np.abs(joint) <= options.bend) for joint in standardised) / n_row.sum()
    if options.covariance == "weighted":
        covariance = inverse * squares.sum() / freedom.sum()
    else:
        _, plain, _ = solve_factor(reduction.weighted(scale**-2.0))
        scores = sum(float(np.sum(np.clip(joint, -options.bend, options.bend) ** 2)) for joint in standardised)
        # What multiplies `(W' W)^-1` for an M-estimator (Huber 1981, eq. 7.6.10), residuals in deviations.
        linear = 1 - down
        correction = 1 + n_param / n_row.sum() * down / linear
        covariance = plain * correction**2 * (scores / freedom.sum()) / linear**2
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


@dataclass(frozen=True)
class Reduction:
    """Rows of each joint reduced by QR."""

    factors: FloatArray  # (n_joint, n_param + 1, n_param + 1): factor F of each joint, `F' F = [W y]' [W y]`
    n_row: IntArray  # (n_joint,): rows that went into it

    @property
    def n_param(self) -> int:
        """Number of parameters."""
        return int(self.factors.shape[2]) - 1

    def weighted(self, weights: FloatArray) -> FloatArray:
        """Returns the triangular factor of all rows, each joint's multiplied by the root of its weight (n_joint,)."""
        # Weights are constant within a joint, so that its factor may be scaled in place of its rows.
        stacked = (np.sqrt(weights)[:, None, None] * self.factors).reshape(-1, self.n_param + 1)
        return np.asarray(np.linalg.qr(stacked, mode="r"))

    def cost(self, parameters: FloatArray) -> FloatArray:
        """Returns the sum (n_joint,) of squared residuals of each joint."""
        # F [-x; 1] has the norm of y - W x: the factor holds what least squares leaves, too.
        residual = self.factors @ np.append(-parameters, 1.0)
        return np.asarray(np.sum(residual**2, axis=1))


def reduce_rows(source: RowSource) -> Reduction:
    """Reduces the rows of a pass.

    Raises:
        ValueError: If no rows come.
    """
    running = _Running()
    for rows in source:
        running.add(np.concatenate([rows.columns, rows.torque[..., None]], axis=2), rows.used)
    return running.result()


def reduce_weighted(
    source: RowSource, parameters: FloatArray, weigh: Callable[[FloatArray], FloatArray]
) -> tuple[Reduction, FloatArray]:
    """Reduces rows with weights that follow from their residuals, in one pass.

    Residuals (n_row, n_joint) at the parameters (n_param,) come along, NaN where a row is not used.
    """
    running, kept = _Running(), []
    for rows in source:
        residual = _residual(rows, parameters)
        joined = np.concatenate([rows.columns, rows.torque[..., None]], axis=2)
        joined *= np.sqrt(weigh(residual))[..., None]
        running.add(joined, rows.used)
        kept.append(residual)
    return running.result(), np.concatenate(kept)


def residuals(source: RowSource, parameters: FloatArray) -> FloatArray:
    """Returns the residual (n_row, n_joint) of every row in one pass; NaN where a row is not used."""
    return np.concatenate([_residual(rows, parameters) for rows in source])


class _Running:
    """Triangular factors that grow by blocks."""

    def __init__(self) -> None:
        self._factors: list[FloatArray] = []
        self._count: list[int] = []

    def add(self, joined: FloatArray, used: BoolArray) -> None:
        """Adds rows (n_row, n_joint, n_param + 1), those that are used (n_row, n_joint)."""
        if not self._factors:
            self._factors = [np.zeros((0, joined.shape[2]))] * joined.shape[1]
            self._count = [0] * joined.shape[1]
        for joint, factor in enumerate(self._factors):
            chosen = joined[used[:, joint], joint]
            self._factors[joint] = _stack(factor, chosen)
            self._count[joint] += len(chosen)

    def result(self) -> Reduction:
        """Returns what the blocks came to."""
        if not sum(self._count):
            raise ValueError("There are no rows to fit: the record is shorter than its filters, or too slow.")
        factors = [np.pad(f, ((0, f.shape[1] - f.shape[0]), (0, 0))) for f in self._factors]
        return Reduction(np.stack(factors), np.array(self._count))


def _stack(factor: FloatArray, rows: FloatArray) -> FloatArray:
    """Reduces rows below a factor; the columns of a joint that are all zero, half of a chain's, cost nothing."""
    # Joint j feels links j and beyond alone, so its columns of the links before are zero in every row.
    active = np.any(factor, axis=0) | np.any(rows, axis=0)
    reduced = np.linalg.qr(np.vstack([factor[:, active], rows[:, active]]), mode="r")
    whole = np.zeros((len(reduced), rows.shape[1]))
    whole[:, active] = reduced
    return whole


def _residual(rows: Rows, parameters: FloatArray) -> FloatArray:
    return np.where(rows.used, rows.torque - rows.columns @ parameters, np.nan)
