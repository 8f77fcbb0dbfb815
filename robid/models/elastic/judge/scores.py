"""Score tests: what freeing doubts would save of a fit's cost, to first order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.models.elastic.fit.nuisance.kinds import Nuisance
from robid.models.elastic.fit.nuisance.response import nuisance_columns
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.fitted import FittedModel
from robid.robot.description import Robot

CHANCE = 50.0
"""Times what a random column explains does what counts: neighbouring lines err alike."""

_WIDER = 5.0  # than its prior is a doubt that would explain a misfit


@dataclass(frozen=True)
class Scores:
    """Normal equations of the doubts, the fit's own parameters eliminated.

    Attributes:
        doubts: The doubts.
        slope (n_doubt,): Half the negative gradient of the cost by the amounts.
        curvature (n_doubt, n_doubt): Half its Gauss-Newton Hessian, with what is known of them beforehand.
        follow (n_param, n_doubt): How far the parameters move by each amount.
        cost: Cost of the residual.
        freedom: Real residuals behind it.
    """

    doubts: tuple[Nuisance, ...]
    slope: FloatArray
    curvature: FloatArray
    follow: FloatArray
    cost: float
    freedom: float


def score(robot: Robot, fitted: FittedModel, options: ElasticOptions, doubts: tuple[Nuisance, ...]) -> Scores:
    """Holds doubts against what a fit leaves.

    Args:
        robot: The robot that the doubts were listed for.
        fitted: The fitted model in the configurations of the fit's own response.
        options: Options of the fit.
        doubts: The doubts.
    """
    problem, internal = fitted.problem, fitted.internal
    residual, derivative = problem.linear(internal)
    columns = nuisance_columns(problem, internal, robot, options, doubts, all_rest=False)
    own, added = _rows(fitted, derivative), _rows(fitted, columns)
    left = _rows(fitted, residual[..., None])[:, 0]
    prior = 0.5 / problem.parameters.prior_std**2
    cost, freedom = float(left @ left), float(problem.residual_kind.parts) * (problem.weight > 0).sum() - own.shape[1]
    # What errs alike over lines says less than it counts: it must not outweigh what is known beforehand.
    known = max(0.5, CHANCE * cost / freedom) / (_WIDER * np.array([doubt.common_std for doubt in doubts])) ** 2
    mixed = own.T @ added
    follow = -np.linalg.lstsq(own.T @ own + np.diag(prior), mixed, rcond=1e-14)[0]
    return Scores(
        doubts=doubts,
        slope=added.T @ left + follow.T @ (own.T @ left - prior * internal),
        curvature=added.T @ added + mixed.T @ follow + np.diag(known),
        follow=follow,
        cost=cost,
        freedom=freedom,
    )


def gain(scores: Scores, chosen: Sequence[int]) -> tuple[float, FloatArray]:
    """Cost that these doubts save together, and their amounts; zero for those whose amount would make no sense."""
    amounts, kept = np.zeros(len(chosen)), np.arange(len(chosen))
    rows = np.array(chosen)
    least, most = (np.array([getattr(scores.doubts[row], end) for row in chosen]) for end in ("least", "most"))
    while kept.size:
        own = rows[kept]
        curvature = scores.curvature[np.ix_(own, own)]
        size = np.sqrt(np.diag(curvature))
        scaled = curvature / np.outer(size, size) + 1e-9 * np.eye(own.size)
        found = np.linalg.solve(scaled, scores.slope[own] / size) / size
        sensible = (least[kept] <= found) & (found <= most[kept])
        if sensible.all():
            amounts[kept] = found
            return float(scores.slope[own] @ found), amounts
        kept = kept[sensible]
    return 0.0, amounts


def _rows(fitted: FittedModel, values: ComplexArray) -> FloatArray:
    """Weighted real rows (n_row, n_column) of (n_conf, n_freq, n_out, n_in, n_column)."""
    flat = fitted.problem.weighted(values).reshape(-1, values.shape[-1])
    return np.concatenate([flat.real, flat.imag])
