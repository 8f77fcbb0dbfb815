"""Optimal weights against closed forms, the equivalence theorem and their own certificate."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from robid.design.configurations.criteria import derivatives, loss, tangent, worth
from robid.design.configurations.interior import Packed, pack, unpack
from robid.design.configurations.relaxed import relaxed_design


def random_information(n_cand, n_row, n_param, seed, n_draw=None):
    generator = np.random.default_rng(seed)
    shape = (n_cand,) if n_draw is None else (n_draw, n_cand)
    jacobian = generator.normal(size=(*shape, n_row, n_param)) * generator.lognormal(size=(n_cand, 1, 1))
    return jacobian.swapaxes(-1, -2) @ jacobian


def polynomial(points, degree):
    rows = points[:, None] ** np.arange(degree + 1)
    return rows[:, :, None] * rows[:, None, :]


def weighted(weights, matrices):
    return np.einsum("i,...ijk->...jk", weights, matrices)


def test_packed_rows_hold_matrices_and_traces():
    matrices = random_information(7, 3, 4, seed=1, n_draw=2)
    packed = Packed(pack(matrices), 4)
    np.testing.assert_allclose(unpack(packed.rows, 4), matrices, rtol=1e-12)
    factors = random_information(2, 4, 4, seed=2)
    np.testing.assert_allclose(packed.traces(factors), np.einsum("djk,dijk->i", factors, matrices), rtol=1e-12)
    weights = np.linspace(0, 1, 7)
    np.testing.assert_allclose(packed.total(weights), weighted(weights, matrices), rtol=1e-12)


@pytest.mark.parametrize("criterion", ["d", "a", "e"])
def test_derivatives_are_those_of_the_loss(criterion):
    matrices = random_information(6, 5, 4, seed=3, n_draw=2)
    weights, step = np.linspace(0.5, 1.5, 6), 1e-5

    def at(trial):
        return loss(criterion, weighted(trial, matrices), 0.3)

    def slopes_at(trial):
        return derivatives(criterion, weighted(trial, matrices), matrices, 0.3)[0]

    slopes, root = derivatives(criterion, weighted(weights, matrices), matrices, 0.3)
    for index, unit in enumerate(step * np.eye(6)):
        np.testing.assert_allclose((at(weights - unit) - at(weights + unit)) / (2 * step), slopes[index], rtol=1e-6)
        column = (slopes_at(weights - unit) - slopes_at(weights + unit)) / (2 * step)
        np.testing.assert_allclose(column, root @ root[index], rtol=1e-5, atol=1e-7 * np.abs(root @ root.T).max())


@pytest.mark.parametrize("criterion", ["d", "a", "e"])
def test_tangents_bound_the_worth_of_every_other_total(criterion):
    totals = random_information(200, 6, 3, seed=4, n_draw=2).swapaxes(0, 1)
    for here, there in zip(totals[:100], totals[100:], strict=True):
        bound = tangent(criterion, here, 1e-2)
        promised = 1 + (float((bound.factors * (there - here)).sum()) + bound.excess) / bound.scale
        assert worth(criterion, there) / worth(criterion, here) <= promised * (1 + 1e-12)


@pytest.mark.parametrize(("degree", "inner"), [(2, [0]), (3, [5**-0.5]), (4, [0, (3 / 7) ** 0.5])])
def test_polynomials_have_guests_d_optimal_points(degree, inner):
    """Support: ends and zeros of the Legendre polynomial's derivative, with equal weights (Guest, 1958)."""
    support = np.unique(np.concatenate([[-1, 1], inner, np.negative(inner)]))
    points = np.union1d(np.linspace(-1, 1, 41), support)
    found = relaxed_design(polynomial(points, degree), gap=1e-9)
    assert found.gap <= 1e-9
    expected = np.where(np.isin(points, support), 1 / (degree + 1), 0)
    np.testing.assert_allclose(found.weights, expected, atol=1e-6)
    assert set(points[found.weights > 0]) == set(support)


def test_parabola_has_its_a_optimal_weights():
    """Fedorov (1972): quadratic regression on [-1, 1] takes a quarter, a half and a quarter."""
    points = np.linspace(-1, 1, 41)
    found = relaxed_design(polynomial(points, 2), criterion="a", gap=1e-9)
    expected = np.where(points == 0, 0.5, np.where(np.abs(points) == 1, 0.25, 0))
    np.testing.assert_allclose(found.weights, expected, atol=1e-6)
    assert found.worth == pytest.approx(1 / 8, rel=1e-8)


def test_parabola_has_its_e_optimal_weights():
    """Pukelsheim and Studden (1993): a fifth, three fifths and a fifth; the smallest eigenvalue is a fifth."""
    points = np.linspace(-1, 1, 41)
    found = relaxed_design(polynomial(points, 2), criterion="e", gap=1e-4)
    assert found.gap <= 1e-4
    assert found.worth == pytest.approx(1 / 5, rel=1e-4)
    np.testing.assert_allclose(found.weights[[0, 20, 40]], [0.2, 0.6, 0.2], atol=5e-3)


@pytest.mark.parametrize("criterion", ["d", "a"])
@pytest.mark.parametrize("seed", range(3))
def test_equivalence_theorem_holds_at_the_optimum(criterion, seed):
    matrices = random_information(80, 3, 6, seed=seed)
    found = relaxed_design(matrices, criterion=criterion, gap=1e-8)
    inverse = np.linalg.inv(weighted(found.weights, matrices))
    factor = inverse if criterion == "d" else inverse @ inverse
    traces, target = np.einsum("jk,ijk->i", factor, matrices), 6 if criterion == "d" else np.trace(inverse)
    assert found.gap == pytest.approx(max(traces.max() / target - 1, 0), abs=1e-13)
    assert found.gap <= 1e-8
    np.testing.assert_allclose(traces[found.weights > 1e-3], target, rtol=1e-6)
    np.testing.assert_allclose(found.slopes, traces / target, rtol=1e-7)


@pytest.mark.parametrize("criterion", ["d", "a", "e"])
def test_certificate_bounds_every_other_weighting_even_when_stopped_early(criterion):
    matrices = random_information(12, 2, 4, seed=3, n_draw=3)
    early = relaxed_design(matrices, criterion=criterion, iterations=1)
    late = relaxed_design(matrices, criterion=criterion)
    assert early.gap > 10 * late.gap
    others = np.random.default_rng(4).dirichlet(np.full(12, 0.5), size=500)
    best = max(float(worth(criterion, weighted(other, matrices))) for other in [*others, late.weights])
    assert early.worth < best <= early.worth * (1 + early.gap)
    assert best <= late.worth * (1 + late.gap)


def test_prior_and_draws_have_the_optimum_of_a_line_search():
    matrices = random_information(2, 4, 3, seed=6, n_draw=4)
    prior = random_information(1, 4, 3, seed=7)[0]

    def total(share):
        return prior + weighted(np.array([share, 1 - share]), matrices)

    for criterion in ("d", "a", "e"):
        best = minimize_scalar(
            lambda share, own=criterion: -float(worth(own, total(share))),
            bounds=(0, 1),
            method="bounded",
            options={"xatol": 1e-12},
        )
        found = relaxed_design(matrices, criterion=criterion, prior=prior)
        assert found.worth == pytest.approx(-best.fun, rel=1e-8 if criterion != "e" else 1e-4)
        assert 0 <= found.gap <= (1e-8 if criterion != "e" else 1e-4)


def test_strong_prior_sends_the_weight_to_what_it_lacks():
    matrices = np.array([np.diag([1.0, 0.1]), np.diag([0.1, 1.0])])
    assert relaxed_design(matrices).weights == pytest.approx([0.5, 0.5])
    assert relaxed_design(matrices, prior=np.diag([100.0, 0])).weights == pytest.approx([0, 1], abs=1e-6)


def test_limited_weights_obey_their_limit_and_bound_every_choice():
    matrices = random_information(30, 2, 4, seed=8)
    found = relaxed_design(matrices, limit=1 / 6)
    assert found.weights.max() <= 1 / 6
    assert found.weights.sum() == pytest.approx(1)
    free = relaxed_design(matrices)
    assert found.worth < free.worth
    generator = np.random.default_rng(9)
    chosen = [matrices[generator.choice(30, 6, replace=False)].mean(axis=0)[None] for _ in range(2000)]
    assert max(float(worth("d", one)) for one in chosen) <= found.worth * (1 + found.gap)


@pytest.mark.parametrize("n_row", [2, 60])
def test_gap_of_a_large_design_is_reached_in_few_steps(n_row):
    matrices = random_information(300, n_row, 26, seed=10)
    found = relaxed_design(matrices)
    assert found.gap <= 1e-8
    assert found.steps < 60
