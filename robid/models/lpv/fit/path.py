"""The regularisation path, and which of its structures to keep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.models.lpv.fit.blocks import measure, spread
from robid.models.lpv.fit.options import PathOptions, SparsityOptions
from robid.models.lpv.fit.problem import Problem, cost, solve
from robid.models.lpv.fit.sparse import SparseFit, fit_sparse
from robid.results.levenberg import Status


@dataclass(frozen=True)
class PathPoint:
    """What one price gives.

    Attributes:
        gamma: The price of a block, in units of the cost.
        kept (4, n_function): Blocks of A, B, C and D that are left.
        relative (4, n_function): Their relative norms before the refit.
        parameters (n_function + 1, n_local): The model fitted again on this structure, without prices.
        refit_cost: Its cost.
        validation_cost: Its cost on the validation data.
        status: How the refit ended.
        steps: Cone programs solved.
    """

    gamma: float
    kept: BoolArray
    relative: FloatArray
    parameters: FloatArray
    refit_cost: float
    validation_cost: float
    status: Status
    steps: int


@dataclass(frozen=True)
class Path:
    """All points, the model without prices first (gamma 0), and which one was chosen."""

    points: tuple[PathPoint, ...]
    chosen: int

    @property
    def best(self) -> PathPoint:
        """The point that was chosen."""
        return self.points[self.chosen]


def follow_path(
    problem: Problem,
    validation: Problem,
    starts: tuple[FloatArray, ...],
    largest: FloatArray,
    options: PathOptions,
    sparsity: SparsityOptions,
) -> Path:
    """Fits at every price, refits each structure exactly, and chooses the sparsest that validates.

    At one price, the start whose refit costs least, blocks counted at their price, stays.

    Args:
        problem: The responses to fit.
        validation: Responses of positions, or realizations, that the fit does not see.
        starts: Models (n_function + 1, n_local) fitted without prices, in different bases.
        largest (n_function,): Largest value of each basis function.
        options: Prices and the choice.
        sparsity: The penalised fit.
    """
    n_free = starts[0].size
    unit = cost(problem, starts[0]) / max(problem.n_data - n_free / 2, 1.0)
    gammas = unit * np.geomspace(options.smallest, options.largest, options.count)
    known: dict[bytes, tuple[FloatArray, float, Status]] = {}
    points = [_full_point(problem, validation, starts[0], largest)]
    for gamma in gammas.tolist():
        fits = [fit_sparse(problem, start, largest, gamma, sparsity) for start in starts]
        found = [_point(problem, validation, fit, _refit(problem, fit, known), largest, gamma) for fit in fits]
        points.append(min(found, key=lambda one: one.refit_cost + one.gamma * np.count_nonzero(one.kept)))
    return Path(tuple(points), choose_point(points, options.allowance))


def _full_point(problem: Problem, validation: Problem, start: FloatArray, largest: FloatArray) -> PathPoint:
    parameters, minimum = solve(problem, start)
    fit = SparseFit(start, np.ones((4, len(largest)), bool), 0)
    return _point(problem, validation, fit, (parameters, minimum.cost, minimum.status), largest, 0.0)


def _refit(
    problem: Problem, fit: SparseFit, known: dict[bytes, tuple[FloatArray, float, Status]]
) -> tuple[FloatArray, float, Status]:
    """Fits a structure without prices, once."""
    structure = fit.kept.tobytes()
    if structure not in known:
        parameters, minimum = solve(problem, fit.parameters, free=spread(fit.kept, problem.sizes))
        known[structure] = parameters, minimum.cost, minimum.status
    return known[structure]


def _point(
    problem: Problem,
    validation: Problem,
    fit: SparseFit,
    refit: tuple[FloatArray, float, Status],
    largest: FloatArray,
    gamma: float,
) -> PathPoint:
    parameters, refit_cost, status = refit
    relative = measure(fit.parameters, largest, problem.sizes).relative
    left_out = cost(validation, parameters)
    return PathPoint(gamma, fit.kept, relative, parameters, refit_cost, left_out, status, fit.steps)


def choose_point(points: list[PathPoint], allowance: float) -> int:
    """Returns the index of the fewest blocks within the allowance; of those the least cost, then the least price.

    A fit that has not converged is taken only where none within the allowance has.
    """
    limit = (1 + allowance) * min(point.validation_cost for point in points)
    return min(
        (index for index, point in enumerate(points) if point.validation_cost <= limit),
        key=lambda index: (
            points[index].status != "converged",
            np.count_nonzero(points[index].kept),
            points[index].refit_cost,
            index,
        ),
    )
