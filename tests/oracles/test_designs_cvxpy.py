"""Optimal weights of designs against cvxpy with Clarabel."""

import numpy as np
import pytest

from robid.design.configurations.criteria import worth
from robid.design.configurations.information import design_configurations
from robid.design.configurations.options import DesignOptions
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


@pytest.mark.filterwarnings("ignore::UserWarning", "ignore::FutureWarning", "ignore::DeprecationWarning")
@pytest.mark.parametrize("criterion", ["d", "a"])
def test_weights_where_parameters_differ_between_configurations(criterion):
    """Each candidate's information by plain inverses, its optimum by the general solver."""
    alone = random_information(20, 6, 4, seed=8, n_draw=1)
    between = np.array([0.5, 0.1, 1.0, 0.3])
    allowed = np.linalg.inv(np.linalg.inv(alone) + np.diag(between**2))
    theirs, any_shares = (solved(allowed, criterion, np.zeros((4, 4)), limit) for limit in (1 / 5, 1.0))
    options = DesignOptions(count=5, criterion=criterion)
    design = design_configurations(alone[0], np.zeros((20, 1)), tuple("abcd"), options, between=between)
    ours = float(worth(criterion, np.einsum("i,dijk->djk", design.weights, allowed)))
    assert design.gap <= 1e-6
    assert ours >= theirs * (1 - 1e-6)
    assert ours * (1 + design.gap) >= theirs * (1 - 1e-9)
    chosen = float(worth(criterion, allowed[:, design.chosen].sum(axis=1))) / 5
    assert design.choice_efficiency == pytest.approx(chosen / theirs, rel=1e-4)
    assert design.efficiency == pytest.approx(chosen / any_shares, rel=1e-4)


@pytest.mark.filterwarnings("ignore::UserWarning", "ignore::FutureWarning", "ignore::DeprecationWarning")
def test_shares_of_visits_where_parameters_differ_between_configurations():
    """`(1 / w H^-1 + T)^-1` by its Schur complement: no real shares beat the bound that whole numbers are held to."""
    alone = random_information(3, 6, 3, seed=9, n_draw=1)
    between, visits = np.diag([0.5, 0.2, 1.0]) ** 2, 11
    design = design_configurations(
        alone[0],
        np.zeros((3, 1)),
        tuple("abc"),
        DesignOptions(count=3, experiments=visits),
        between=np.sqrt(np.diag(between)),
    )
    shares = cp.Variable(3, nonneg=True)
    told = [cp.Variable((3, 3), symmetric=True) for _ in range(3)]
    inverse = np.linalg.inv(between)
    # K <= (1 / w H^-1 + T)^-1 = T^-1 - T^-1 (w H + T^-1)^-1 T^-1
    limits = [
        cp.bmat([[inverse - one, inverse], [inverse, share * matrix + inverse]]) >> 0
        for one, share, matrix in zip(told, shares, alone[0], strict=True)
    ]
    problem = cp.Problem(cp.Maximize(cp.log_det(sum(told))), [*limits, cp.sum(shares) == visits])
    problem.solve(solver="CLARABEL")
    most = float(np.exp(problem.value / 3))
    matrices = [np.linalg.inv(np.linalg.inv(n * one) + between) for n, one in zip(design.counts, alone[0], strict=True)]
    own = float(worth("d", sum(matrices)[None]))
    assert 1 - design.rounding_loss <= own / most + 1e-6
    assert own / most == pytest.approx(1 - design.rounding_loss, abs=0.02)
