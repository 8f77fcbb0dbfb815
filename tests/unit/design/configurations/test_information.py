"""Designs of configurations: what they promise against known truth, and what they refuse."""

from itertools import combinations

import numpy as np
import pytest

from robid.design.configurations.information import design_configurations, information
from robid.design.configurations.options import DesignOptions
from robid.design.configurations.relaxed import relaxed_design
from robid.design.configurations.visits import FittedInformation
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


def designed(matrices, names="abcd", **changes):
    """The design of the matrices under some options, arguments of their own apart."""
    own = {name: changes.pop(name) for name in ("prior", "cost", "fitted") if name in changes}
    n_conf = matrices.shape[-3]
    return design_configurations(matrices, np.zeros((n_conf, 1)), tuple(names), DesignOptions(**changes), **own)


def test_design_certifies_its_efficiency_and_predicts_deviations():
    matrices = random_matrices(12, 2, 4, seed=6) * np.array([1, 1e3, 1e-3, 1])[:, None] * np.array([1, 1e3, 1e-3, 1])
    design = designed(matrices, count=4)
    total = matrices[design.chosen].sum(axis=0)
    np.testing.assert_allclose(design.predicted_relative_std, np.sqrt(np.diag(np.linalg.inv(total))), rtol=1e-6)
    optimum = log_determinant(np.einsum("i,ijk->jk", design.weights, matrices))
    true = np.exp((log_determinant(total / 4) - optimum) / 4)
    assert design.efficiency == pytest.approx(true, rel=1e-7)
    assert design.gap <= 1e-8
    assert design.weights.sum() == pytest.approx(1)
    np.testing.assert_array_equal(design.counts, np.isin(np.arange(12), design.chosen))


def test_choice_efficiency_bounds_the_best_subset_more_tightly():
    for seed in range(4):
        matrices = random_matrices(10, 2, 4, seed=seed)
        design = designed(matrices, count=4)
        best = max(log_determinant(matrices[list(one)].sum(axis=0)) for one in combinations(range(10), 4))
        reached = np.exp((log_determinant(matrices[design.chosen].sum(axis=0)) - best) / 4)
        assert design.efficiency < design.choice_efficiency <= reached + 1e-9


@pytest.mark.parametrize("criterion", ["a", "e"])
def test_other_criteria_choose_in_log_parameters_whatever_their_scale(criterion):
    matrices = random_matrices(12, 3, 3, seed=4) * np.array([1, 30, 1])[:, None] * np.array([1, 30, 1])
    design = designed(matrices, "abc", count=4, criterion=criterion)

    def variance(subset):
        inverse = np.linalg.inv(matrices[list(subset)].sum(axis=0))
        return np.trace(inverse) if criterion == "a" else np.linalg.eigvalsh(inverse)[-1]

    assert variance(design.chosen) <= 1.02 * min(variance(one) for one in combinations(range(12), 4))
    assert 0 < design.efficiency <= design.choice_efficiency <= 1


def test_all_candidates_with_equal_optimal_weights_are_fully_efficient():
    matrices = np.array([np.diag([1.0, 0, 0]), np.diag([0, 1.0, 0]), np.diag([0, 0, 1.0])])
    design = designed(matrices, "abc", count=3)
    assert design.efficiency == pytest.approx(1, abs=1e-7)
    assert design.choice_efficiency == pytest.approx(1, abs=1e-7)
    np.testing.assert_allclose(design.predicted_relative_std, 1)


def test_experiments_are_shared_out_and_their_loss_is_stated():
    matrices = np.array([np.diag([1.0, 0]), np.diag([0, 1.0]), np.diag([0.1, 0.1])])
    even, odd = designed(matrices, "ab", count=2, experiments=10), designed(matrices, "ab", count=2, experiments=5)
    assert even.counts.tolist() == [5, 5, 0]
    assert even.rounding_loss == pytest.approx(0, abs=1e-7)
    assert sorted(odd.counts) == [0, 2, 3]
    assert odd.rounding_loss == pytest.approx(1 - np.sqrt(6) / 2.5, abs=1e-7)
    assert odd.efficiency == pytest.approx(np.sqrt(6) / 2.5, abs=1e-7)
    np.testing.assert_allclose(np.sort(odd.predicted_relative_std), [3**-0.5, 2**-0.5])


def test_few_different_configurations_share_many_experiments():
    design = designed(random_matrices(20, 1, 4, seed=5), count=5, experiments=23)
    assert design.counts.sum() == 23
    assert len(design.chosen) <= 5
    assert 0 <= design.rounding_loss < 0.02


def test_prior_counts_by_the_planned_number_of_experiments():
    matrices = random_matrices(12, 2, 4, seed=11)
    prior = 50 * random_matrices(1, 2, 4, seed=12)[0]
    design = designed(matrices, count=3, prior=prior)
    np.testing.assert_allclose(design.weights, relaxed_design(matrices, prior=prior / 3).weights, atol=1e-6)
    best = max(combinations(range(12), 3), key=lambda one: log_determinant(prior + matrices[list(one)].sum(axis=0)))
    assert tuple(design.chosen) == best
    total = prior + matrices[design.chosen].sum(axis=0)
    np.testing.assert_allclose(design.predicted_relative_std, np.sqrt(np.diag(np.linalg.inv(total))), rtol=1e-8)


def test_gain_ranks_what_to_measure_next():
    matrices, prior = random_matrices(6, 2, 3, seed=13), random_matrices(1, 5, 3, seed=14)[0]
    expected = [log_determinant(prior + one) - log_determinant(prior) for one in matrices]
    np.testing.assert_allclose(designed(matrices, "abc", count=2, prior=prior).gain, expected, rtol=1e-9)
    fresh = designed(matrices, "abc", count=2)
    total = matrices[fresh.chosen].sum(axis=0)
    expected = [log_determinant(total + one) - log_determinant(total) for one in matrices]
    np.testing.assert_allclose(fresh.gain, expected, rtol=1e-9)


def test_costs_are_kept_and_steer_the_choice():
    matrices = random_matrices(12, 2, 3, seed=15)
    cost = np.where(np.arange(12) < 6, 1.0, 100.0)
    design = designed(matrices, "abc", count=3, budget=3.0, cost=cost)
    assert design.chosen.max() < 6
    np.testing.assert_allclose(design.weights, relaxed_design(matrices / cost[:, None, None]).weights, atol=1e-6)
    assert designed(matrices, "abc", count=3, cost=cost).counts @ cost <= 3 * cost.mean()
    with pytest.raises(SettingsError, match="does not pay 3 experiments: the cheapest cost 3"):
        designed(matrices, "abc", count=3, budget=2.5, cost=cost)


def test_draws_of_the_parameters_are_averaged():
    draws = np.stack([random_matrices(10, 2, 3, seed=seed) for seed in (16, 17, 18)])
    design = designed(draws, "abc", count=3)

    def mean(subset):
        return log_determinant(draws[:, list(subset)].sum(axis=1)).mean()

    best = max(mean(one) for one in combinations(range(10), 3))
    assert mean(design.chosen) >= best - 0.06
    variance = np.mean([np.diag(np.linalg.inv(one[design.chosen].sum(axis=0))) for one in draws], axis=0)
    np.testing.assert_allclose(design.predicted_relative_std, np.sqrt(variance), rtol=1e-8)
    np.testing.assert_allclose(design.information, draws.mean(axis=0))


def test_design_for_a_fits_own_weights_promises_its_sandwich():
    generator = np.random.default_rng(19)
    jacobian, variance = generator.normal(size=(10, 6, 3)), generator.uniform(0.2, 5, (10, 6))
    optimal = information(jacobian, variance)
    bread, meat = information(jacobian, np.array(1.0)), information(jacobian, 1 / variance)
    fitted = FittedInformation(bread[None], meat[None], optimal[None], np.zeros(3))
    design = designed(optimal, "abc", count=3, fitted=fitted)

    def covariance(subset):
        inverse = np.linalg.inv(bread[list(subset)].sum(axis=0))
        return inverse @ meat[list(subset)].sum(axis=0) @ inverse

    np.testing.assert_allclose(design.predicted_relative_std, np.sqrt(np.diag(covariance(design.chosen))), rtol=1e-8)
    best = min(log_determinant(covariance(one)) for one in combinations(range(10), 3))
    assert log_determinant(covariance(design.chosen)) <= best + 0.06
    assert design.efficiency < designed(optimal, "abc", count=3).efficiency


def shared_parts(n_conf, n_row, n_wanted, n_more, seed):
    """Jacobian, variances and weights of residuals with nuisances that all candidates share."""
    generator = np.random.default_rng(seed)
    jacobian = generator.normal(size=(n_conf, n_row, n_wanted + n_more))
    return jacobian, generator.uniform(0.2, 5, (n_conf, n_row)), generator.uniform(0.5, 2, (n_conf, n_row))


@pytest.mark.parametrize("known", [np.zeros(3), np.array([3.0, 0.5, 10])])
def test_shared_nuisances_go_out_of_the_sum_and_what_is_known_counts_once(known):
    """Against least squares with all residuals of the chosen candidates stacked, and every other choice of as many."""
    jacobian, variance, weight = shared_parts(9, 4, 3, 2, seed=23)
    precision = np.array([0, 0, 0, 0.5, 40])
    bread, best = information(jacobian, 1 / weight), information(jacobian, variance)
    fitted = FittedInformation(
        bread[None], information(jacobian, 1 / (weight**2 * variance))[None], best[None], precision
    )
    design = designed(best[:, :3, :3], "abc", count=3, fitted=fitted, prior=np.diag(known))
    whole = precision + np.append(known, [0, 0])

    def covariance(subset, weights):
        rows, spread = jacobian[list(subset)].reshape(-1, 5), variance[list(subset)].ravel()
        gain = np.linalg.solve(
            rows.T * weights[list(subset)].ravel() @ rows + np.diag(whole),
            np.hstack([rows.T * weights[list(subset)].ravel(), np.diag(np.sqrt(whole))]),
        )
        return (gain * np.append(spread, np.ones(5)) @ gain.T)[:3, :3]

    own = covariance(design.chosen, weight)
    np.testing.assert_allclose(design.predicted_relative_std, np.sqrt(np.diag(own)), rtol=1e-8)
    every = list(combinations(range(9), 3))
    assert log_determinant(own) <= min(log_determinant(covariance(one, weight)) for one in every) + 0.06
    # No weights of any three candidates beat the bound that the efficiency is held against.
    most = -min(log_determinant(covariance(one, 1 / variance)) for one in every)
    assert design.efficiency * np.exp((most + log_determinant(own)) / 3) <= 1 + 1e-9
    assert design.efficiency > 0.5


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


def test_fewer_experiments_than_parameters_need_are_refused():
    with pytest.raises(DataError, match="best 3 experiments in at most 2 configurations do not depend on") as caught:
        designed(random_matrices(6, 1, 4, seed=9), count=2, experiments=3)
    assert caught.value.remedy == "Raise experiments or count."
    assert designed(random_matrices(6, 1, 4, seed=9), count=2, prior=np.eye(4)).counts.sum() == 2


def test_candidates_that_are_all_alike_are_refused():
    one = random_matrices(1, 5, 3, seed=20)
    factor = np.linspace(1, 2, 6)[:, None, None]
    for same in (np.repeat(one, 6, axis=0), one * factor):
        with pytest.raises(DataError, match="all alike") as caught:
            designed(same, "abc", count=2)
        assert "differ" in caught.value.remedy
    assert designed(one[:, :1, :1] * factor, "a", count=2).chosen.tolist() == [4, 5]


def test_not_finite_information_is_refused():
    matrices = random_matrices(5, 3, 2, seed=8)
    matrices[2, 0, 0] = np.nan
    with pytest.raises(DataError, match="1 of 5 candidates is not finite, first that of candidate 2"):
        designed(matrices, "ab", count=2)
