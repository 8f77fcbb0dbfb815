"""Optimal weights of designs against cvxpy with Clarabel."""

import numpy as np
import pytest

from robid.design.configurations.criteria import worth
from robid.design.configurations.relaxed import relaxed_design

cp = pytest.importorskip("cvxpy", reason="cvxpy is not installed")


def random_information(n_cand, n_row, n_param, seed, n_draw):
    generator = np.random.default_rng(seed)
    jacobian = generator.normal(size=(n_draw, n_cand, n_row, n_param)) * generator.lognormal(size=(n_cand, 1, 1))
    return jacobian.swapaxes(-1, -2) @ jacobian


def solved(matrices, criterion, prior, limit):
    """Worth of the optimal weights by a general solver."""
    n_draw, n_cand, size = matrices.shape[:3]
    weights = cp.Variable(n_cand, nonneg=True)
    totals = [cp.reshape(draw.reshape(n_cand, -1).T @ weights, (size, size), order="F") + prior for draw in matrices]
    totals = [0.5 * (total + total.T) for total in totals]
    if criterion == "d":
        goal = cp.Maximize(sum(cp.log_det(total) for total in totals) / n_draw)
    elif criterion == "a":
        goal = cp.Minimize(sum(cp.tr_inv(total) for total in totals) / n_draw)
    else:
        goal = cp.Maximize(cp.minimum(*[cp.lambda_min(total) for total in [*totals, totals[0]]]))
    cp.Problem(goal, [cp.sum(weights) == 1, weights <= limit]).solve(solver="CLARABEL")
    found = np.maximum(weights.value, 0) / np.maximum(weights.value, 0).sum()
    return float(worth(criterion, np.einsum("i,dijk->djk", found, matrices) + prior))


@pytest.mark.filterwarnings("ignore::UserWarning", "ignore::FutureWarning", "ignore::DeprecationWarning")
@pytest.mark.parametrize("criterion", ["d", "a", "e"])
@pytest.mark.parametrize(
    ("n_draw", "known", "limit"), [(1, 0.0, 1.0), (1, 0.0, 0.15), (3, 0.0, 1.0), (1, 5.0, 1.0), (2, 2.0, 0.2)]
)
def test_worth_of_the_optimum(criterion, n_draw, known, limit):
    matrices = random_information(25, 2, 4, seed=5, n_draw=n_draw)
    prior = known * np.diag([1.0, 0.2, 0, 0.5])
    theirs = solved(matrices, criterion, prior, limit)
    ours = relaxed_design(matrices, criterion=criterion, prior=prior, limit=limit)
    tolerance = 1e-4 if criterion == "e" else 1e-6
    assert ours.gap <= tolerance
    assert ours.worth >= theirs * (1 - tolerance)
    assert ours.worth * (1 + ours.gap) >= theirs * (1 - 1e-9)
    assert theirs == pytest.approx(ours.worth, rel=3e-4 if criterion == "e" else 1e-5)
