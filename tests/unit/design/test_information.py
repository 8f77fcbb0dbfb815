"""The D-optimal choice against known optima, brute force and its own certificate."""

from itertools import combinations

import numpy as np
import pytest

from robid.design.information import _exchange, _greedy, choose, design_configurations, information, relaxed_design
from robid.design.options import DesignOptions
from robid.errors import DataError, SettingsError


def random_matrices(n_conf, n_row, n_param, seed):
    jacobian = np.random.default_rng(seed).normal(size=(n_conf, n_row, n_param))
    return information(jacobian, np.array(1.0))


def log_determinant(matrix):
    return np.linalg.slogdet(matrix)[1]


def test_information_of_real_and_complex_residuals():
    generator = np.random.default_rng(1)
    jacobian = generator.normal(size=(2, 3, 4, 2)) + 1j * generator.normal(size=(2, 3, 4, 2))
    variance = generator.uniform(0.5, 2, (2, 3, 4))
    expected = np.zeros((2, 2, 2))
    for index in np.ndindex(2, 3, 4):
        row = jacobian[index]
        expected[index[0]] += 2 * np.real(np.outer(row.conj(), row)) / variance[index]
    np.testing.assert_allclose(information(jacobian, variance), expected, rtol=1e-12)
    real = jacobian.real
    weighted = np.einsum("cijp,cij,cijq->cpq", real, 1 / variance, real)
    np.testing.assert_allclose(information(real, variance), weighted, rtol=1e-12)


def test_complex_information_is_the_inverse_covariance_of_the_estimate():
    generator = np.random.default_rng(2)
    jacobian = generator.normal(size=(1, 30, 2)) + 1j * generator.normal(size=(1, 30, 2))
    noise = (generator.normal(size=(4000, 30)) + 1j * generator.normal(size=(4000, 30))) * np.sqrt(0.3 / 2)
    stacked = np.concatenate([jacobian[0].real, jacobian[0].imag])
    estimates = np.linalg.lstsq(stacked, np.concatenate([noise.real, noise.imag], axis=1).T, rcond=None)[0]
    predicted = np.linalg.inv(information(jacobian, np.array(0.3))[0])
    np.testing.assert_allclose(np.cov(estimates), predicted, atol=0.08 * predicted.max())


@pytest.mark.parametrize(("degree", "support"), [(2, [-1, 0, 1]), (3, [-1, -(5**-0.5), 5**-0.5, 1])])
def test_polynomial_regression_has_its_textbook_optimum(degree, support):
    points = np.union1d(np.linspace(-1, 1, 21), support)
    matrices = information(points[:, None, None] ** np.arange(degree + 1), np.array(1.0))
    weights, gap = relaxed_design(matrices, iterations=20000, gap=1e-5)
    assert gap <= 1e-5 * (degree + 1)
    expected = np.where(np.isin(points, support), 1 / (degree + 1), 0)
    np.testing.assert_allclose(weights, expected, atol=2e-3)


def test_certificate_bounds_every_other_weighting():
    matrices = random_matrices(12, 2, 4, seed=3)
    weights, gap = relaxed_design(matrices, iterations=50, gap=1e-9)
    reached = log_determinant(np.einsum("i,ijk->jk", weights, matrices))
    assert 1e-9 < gap < 4
    for other in np.random.default_rng(4).dirichlet(np.full(12, 0.5), size=500):
        assert log_determinant(np.einsum("i,ijk->jk", other, matrices)) <= reached + gap
    better, _ = relaxed_design(matrices, iterations=20000, gap=1e-9)
    assert reached < log_determinant(np.einsum("i,ijk->jk", better, matrices)) <= reached + gap


def test_updates_never_lower_the_determinant():
    matrices = random_matrices(15, 3, 5, seed=5)
    values = [
        log_determinant(np.einsum("i,ijk->jk", relaxed_design(matrices, iterations=n, gap=0)[0], matrices))
        for n in range(30)
    ]
    assert np.all(np.diff(values) > -1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_choice_against_brute_force(seed):
    matrices = random_matrices(12, 2, 4, seed=seed)
    weights, _ = relaxed_design(matrices, iterations=2000, gap=1e-6)
    chosen = choose(matrices, 4, weights)
    assert len(set(chosen)) == 4
    best = max(log_determinant(matrices[list(subset)].sum(axis=0)) for subset in combinations(range(12), 4))
    assert log_determinant(matrices[chosen].sum(axis=0)) >= best - 0.02 * 4


def test_exchange_never_loses_to_greedy_and_sometimes_wins():
    gains = []
    for seed in range(12):
        matrices = random_matrices(20, 2, 6, seed=100 + seed)
        floor = 1e-9 * matrices.mean(axis=0)
        greedy = _greedy(matrices, 5, floor)
        exchanged = _exchange(matrices, greedy, floor)
        before, after = (log_determinant(matrices[subset].sum(axis=0)) for subset in (greedy, exchanged))
        gains.append(after - before)
    assert min(gains) >= 0
    assert max(gains) > 0.01


def test_design_certifies_its_efficiency_and_predicts_deviations():
    matrices = random_matrices(12, 2, 4, seed=6) * np.array([1, 1e3, 1e-3, 1])[:, None] * np.array([1, 1e3, 1e-3, 1])
    names = ("a", "b", "c", "d")
    design = design_configurations(
        matrices, np.zeros((12, 1)), names, DesignOptions(count=4, gap=1e-6, iterations=5000)
    )
    total = matrices[design.chosen].sum(axis=0)
    np.testing.assert_allclose(design.predicted_relative_std, np.sqrt(np.diag(np.linalg.inv(total))), rtol=1e-6)
    best, _ = relaxed_design(matrices, iterations=50000, gap=1e-10)
    optimum = log_determinant(np.einsum("i,ijk->jk", best, matrices))
    true = np.exp((log_determinant(total / 4) - optimum) / 4)
    assert design.efficiency <= true + 1e-9
    assert design.efficiency == pytest.approx(true, rel=1e-4)
    assert design.weights.sum() == pytest.approx(1)


def test_all_candidates_with_equal_optimal_weights_are_fully_efficient():
    matrices = np.array([np.diag([1.0, 0, 0]), np.diag([0, 1.0, 0]), np.diag([0, 0, 1.0])])
    design = design_configurations(matrices, np.zeros((3, 1)), ("a", "b", "c"), DesignOptions(count=3))
    assert design.efficiency == pytest.approx(1, abs=1e-12)
    np.testing.assert_allclose(design.predicted_relative_std, 1)


def test_unseen_combination_is_named():
    matrices = random_matrices(10, 3, 3, seed=7)
    tie = np.array([[1, 0, 0], [0, 1.0, 0], [0, 0, 1], [0, 0.5, 0]]).T
    wide = tie.T @ matrices @ tie
    with pytest.raises(DataError) as caught:
        design_configurations(wide, np.zeros((10, 1)), ("gear_1", "gear_2", "gear_3", "arm"), DesignOptions(count=3))
    assert "+1 log(arm) -0.5 log(gear_2)" in str(caught.value)
    assert "gear_1" not in str(caught.value)


def test_parameter_without_any_effect_is_named():
    matrices = random_matrices(5, 3, 2, seed=8)
    matrices[:, 1] = matrices[:, :, 1] = 0
    with pytest.raises(DataError, match="do not depend on: damper"):
        design_configurations(matrices, np.zeros((5, 1)), ("spring", "damper"), DesignOptions(count=2))


def test_too_few_configurations_or_candidates_are_refused():
    matrices = random_matrices(6, 1, 4, seed=9)
    names = ("a", "b", "c", "d")
    with pytest.raises(DataError, match="best 2 configurations") as caught:
        design_configurations(matrices, np.zeros((6, 1)), names, DesignOptions(count=2))
    assert caught.value.remedy == "Raise count."
    with pytest.raises(SettingsError, match="7 configurations cannot be chosen from 6"):
        design_configurations(matrices, np.zeros((6, 1)), names, DesignOptions(count=7))


def test_not_finite_information_is_refused():
    matrices = random_matrices(5, 3, 2, seed=8)
    matrices[2, 0, 0] = np.nan
    with pytest.raises(DataError, match="not finite"):
        design_configurations(matrices, np.zeros((5, 1)), ("a", "b"), DesignOptions(count=2))
