"""Which order local models need, the same one at every position."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.fit.lpv.local import fit_local_models
from robid.fit.lpv.problem import Problem
from robid.fit.lpv.state_space import Sizes


@dataclass(frozen=True)
class OrderChoice:
    """What each order costs.

    Attributes:
        orders: Numbers of states that were tried.
        cost (n_order,): Cost of all local models; infinite where one of them is refused.
        score (n_order,): Cost in mean squared errors, and half the logarithm of the data for every combination of
            parameters that a response determines.
        chosen: The order with the least score.
    """

    orders: tuple[int, ...]
    cost: FloatArray
    score: FloatArray
    chosen: int


def choose_order(problem: Problem, orders: tuple[int, ...]) -> OrderChoice:
    """Fits local models of several orders and chooses one by the Bayesian information criterion.

    Args:
        problem: The responses; its own order plays no part.
        orders: Numbers of states to try.

    Raises:
        DataError: If no order gives stable local models.
    """
    cost = np.array([_total(problem, order) for order in orders])
    if not np.isfinite(cost).any():
        raise DataError(
            f"No order of {', '.join(str(order) for order in orders)} gives stable local models.",
            remedy="Name all integrators that the response has, or measure more lines and periods.",
        )
    n_pos, _, n_out, n_in = problem.response.shape
    determined = np.array([n_pos * (order * (n_out + n_in) + n_out * n_in) for order in orders])
    best = int(np.argmin(cost))
    unit = cost[best] / max(problem.n_data - determined[best] / 2, 1.0)
    score = cost / unit + determined * np.log(2 * problem.n_data) / 2
    return OrderChoice(orders, cost, score, orders[int(np.argmin(score))])


def _total(problem: Problem, order: int) -> float:
    sizes = Sizes(order, problem.sizes.n_in, problem.sizes.n_out)
    try:
        return float(fit_local_models(replace(problem, sizes=sizes)).cost.sum())
    except DataError:
        return np.inf
