"""Expected errors of predictions against simulated fits, and choices by them against brute force."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from design_systems import as_counts
from robid.design.configurations.comparison import (
    alternative,
    fitted_deviations,
    next_visits,
    random_alternatives,
)
from robid.design.configurations.for_prediction import PredictionPlan, design_for_prediction
from robid.design.configurations.options import DesignOptions
from robid.design.configurations.predicted import Lacking, stacked
from robid.design.configurations.prediction import (
    ExpectedError,
    joined,
    parts_of_one,
    predicted_means,
    second_moment_root,
    with_further,
)
from robid.errors import DataError

N_FREQ, N_ELEMENT, N_ALL, N_AMOUNT = 4, 2, 3, 5
STD, CLUSTER = np.array([0.3, 0.2, 0.5, 0.1, 0.4]), np.array([0.1, 0.0, 0.2, 0.0, 0.1])
LEAST = np.array([-np.inf, -1.0, 0.0, -np.inf, 0.0])
PRECISION = np.array([0.0, 0.0, 4.0])
BETWEEN = np.array([0.05, 0.02, 0.0])
VARIANCE = 0.04


def columns_of(n_cand, seed):
    """Derivatives by parameters and by what the model lacks, which leans on them."""
    generator = np.random.default_rng(seed)
    own, further = (generator.normal(size=(2, n_cand, N_FREQ, N_ELEMENT, size)) for size in (N_ALL, N_AMOUNT))
    own, further = own[0] + 1j * own[1], further[0] + 1j * further[1]
    return own, further + own[..., :1]


def parts_of(own, further):
    root, importance = second_moment_root(STD, LEAST), np.ones((N_FREQ, N_ELEMENT))
    rows = []
    for j, h in zip(own, further, strict=True):
        pull = j / VARIANCE
        flat = j.reshape(-1, N_ALL)
        bread = 2 * np.real(pull.reshape(-1, N_ALL).conj().T @ flat)
        local = parts_of_one(j, pull, h, CLUSTER, BETWEEN)
        rows.append((bread, bread, bread, *local, *predicted_means(j, h, importance, root)))
    return stacked(rows, PRECISION, root)


def simulated_error(own, further, counts, draws, seed):
    """Mean square error of predictions by fits of drawn robots, noise and differences between configurations."""
    generator, squares = np.random.default_rng(seed), []
    used = np.flatnonzero(counts)
    visited = np.repeat(used, counts[used])
    rows = own[visited].reshape(-1, N_ALL)
    stacked = np.concatenate([rows.real, rows.imag]) * np.sqrt(2 / VARIANCE)
    known = np.diag(np.sqrt(PRECISION))
    design = np.concatenate([stacked, known])
    for _ in range(draws):
        common = STD * generator.normal(size=N_AMOUNT)
        common[LEAST == 0] = np.abs(common[LEAST == 0])
        parameters = np.where(PRECISION > 0, generator.normal(size=N_ALL) / np.sqrt(np.maximum(PRECISION, 1e-300)), 0)
        parameters[PRECISION == 0] = 0.0
        apart = {c: CLUSTER * generator.normal(size=N_AMOUNT) for c in used}
        moved = {c: BETWEEN * generator.normal(size=N_ALL) for c in used}
        target = [
            own[c] @ (parameters + moved[c])
            + further[c] @ (common + apart[c])
            + np.sqrt(VARIANCE / 2) * (generator.normal(size=(2, N_FREQ, N_ELEMENT)).T @ [1, 1j]).T
            for c in visited
        ]
        measured = np.ravel(target)
        data = np.concatenate([measured.real, measured.imag]) * np.sqrt(2 / VARIANCE)
        found = np.linalg.lstsq(design, np.concatenate([data, np.zeros(N_ALL)]), rcond=None)[0]
        squares.append(np.mean(np.abs(own @ (parameters - found) + further @ common) ** 2))
    return np.mean(squares), np.std(squares) / np.sqrt(draws)


@pytest.mark.parametrize("chosen", [[0, 1, 2], [3, 3, 4], [5]])
def test_expected_error_is_that_of_simulated_fits(chosen):
    own, further = columns_of(6, 1)
    parts = parts_of(own, further)
    counts = as_counts(chosen, 6)
    error = ExpectedError(parts, parts.known(None))
    expected = sum(error.errors(counts))
    simulated, deviation = simulated_error(own, further, counts, 3000, 2)
    assert expected == pytest.approx(simulated, abs=4 * deviation)
    # The bias is most of it here, so both parts are seen.
    assert 0.05 < error.errors(counts)[0] / expected < 0.95


def test_second_moments_are_those_of_normal_and_half_normal_amounts():
    drawn = STD * np.random.default_rng(3).normal(size=(400_000, N_AMOUNT))
    drawn[:, LEAST == 0] = np.abs(drawn[:, LEAST == 0])
    root = second_moment_root(STD, LEAST)
    np.testing.assert_allclose(root @ root.T, drawn.T @ drawn / len(drawn), atol=1e-3)


def test_one_more_of_each_is_the_sum_with_it():
    parts = parts_of(*columns_of(8, 4))
    error = ExpectedError(parts, parts.known(np.eye(2)))
    counts = as_counts([0, 1, 1, 2], 8)
    each = error.with_each(counts, np.arange(8))
    np.testing.assert_allclose(each, [error.worth(counts + as_counts([at], 8)) for at in range(8)], rtol=1e-10)


def test_nothing_comes_below_the_bound():
    parts = parts_of(*columns_of(20, 5))
    error = ExpectedError(parts, parts.known(None))
    plan = PredictionPlan(DesignOptions(count=4, criterion="prediction"), error, np.ones(20), 4, 4.0)
    relaxed = plan.relaxed()
    bound, generator = error.bound(relaxed, 4.0), np.random.default_rng(6)
    found = [sum(error.errors(as_counts(generator.choice(20, 4, replace=False), 20))) for _ in range(300)]
    assert bound <= min(found)
    assert plan.choice_bound() <= min(found)
    assert plan.choice_bound() >= bound * (1 - 1e-6)
    # Without what the model lacks, and without differences, the bound on any weights is the A-optimal variance.
    bare = replace(
        parts, lacking=0 * parts.lacking, mixed=0 * parts.mixed, whole=0 * parts.whole, apart=0 * parts.apart
    )
    error = ExpectedError(bare, bare.known(None))
    own = replace(plan, error=error).relaxed()
    total = error.prior + 4 * np.tensordot(own.weights, parts.bread[0], 1)
    assert error.bound(own, 4.0) == pytest.approx(np.trace(parts.own[0] @ np.linalg.inv(total)), rel=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_choice_against_brute_force(seed):
    parts = parts_of(*columns_of(10, 10 + seed))
    error = ExpectedError(parts, parts.known(None))
    options = DesignOptions(count=3, criterion="prediction")
    plan = PredictionPlan(options, error, np.ones(10), 3, 3.0)
    counts = plan.choose(plan.relaxed())
    every = [sum(error.errors(as_counts(each, 10))) for each in combinations(range(10), 3)]
    assert sum(error.errors(counts)) <= 1.02 * min(every)


def test_visits_and_budgets_are_kept():
    parts = parts_of(*columns_of(10, 20))
    cost = np.linspace(1, 3, 10)
    options = DesignOptions(count=3, criterion="prediction", experiments=6, budget=9.0)
    matrices = parts.best[:, :, :2, :2]
    configurations = np.arange(20.0).reshape(10, 2)
    design = design_for_prediction(parts, matrices, configurations, ("a", "b"), options, cost=cost)
    assert design.counts @ cost <= 9.0 * (1 + 1e-12)
    assert (design.counts > 0).sum() <= 3
    assert 3 <= design.counts.sum() <= 6
    # Nothing more is affordable.
    assert design.counts.sum() == 6 or design.counts @ cost + cost[design.chosen].min() > 9.0
    assert 0 < design.efficiency <= design.choice_efficiency <= 1
    assert (design.gain > 0).any()
    single = DesignOptions(count=3, criterion="prediction")
    with pytest.raises(DataError, match="a"):
        design_for_prediction(parts, 0 * matrices, configurations, ("a", "b"), single)


def test_few_combinations_of_what_the_model_lacks_are_enough():
    parts = parts_of(*columns_of(12, 30))
    small = parts.compressed()
    for chosen in ([0, 1, 2], [4, 7, 9, 11]):
        both = [sum(ExpectedError(each, each.known(None)).errors(as_counts(chosen, 12))) for each in (parts, small)]
        assert both[0] == pytest.approx(both[1], rel=0.01)


def test_parts_of_two_tasks_are_those_of_one():
    own, further = columns_of(6, 40)
    whole = parts_of(own, further)
    both = joined([parts_of(own[:4], further[:4]), parts_of(own[4:], further[4:])], [4, 2])
    for name in ("bread", "lacking", "own", "mixed", "whole"):
        np.testing.assert_allclose(getattr(both, name), getattr(whole, name), rtol=1e-10)


def test_random_choices_bracket_their_median_and_parts_add_up():
    parts = parts_of(*columns_of(20, 50))
    error = ExpectedError(parts, parts.known(None))
    middle, best, worst = random_alternatives(error, 4, 4, fitted_deviations(error, 2))
    assert best.prediction_error < middle.prediction_error < worst.prediction_error
    one = alternative("d", error, as_counts([0, 1, 2, 3], 20), fitted_deviations(error, 2))
    assert one.prediction_error**2 == pytest.approx(one.noise_error**2 + one.bias_error**2)
    assert one.relative_std <= one.worst_relative_std


def test_amounts_of_one_configuration_go_row_by_row():
    columns = np.arange(2 * 3 * 2 * 2 * 4).reshape(2, 3, 2, 2, 4).astype(complex)
    lacking = Lacking(columns, np.ones(4), np.zeros(4), np.zeros(4))
    assert lacking.at(1)[2, 3].tolist() == columns[1, 2, 1, 1].tolist()


def test_the_next_visit_is_the_best_of_all_that_are_offered():
    """One configuration that was visited is no candidate: it counts, is not offered, and is not to be predicted."""
    own, further = columns_of(9, 60)
    parts = with_further(parts_of(own[:8], further[:8]), parts_of(own[8:], further[8:]))
    error = ExpectedError(parts, parts.known(None))
    visited = as_counts([2, 2, 8], 9)
    now, best = next_visits(error, visited, 2, 8)
    assert now.prediction_error**2 == pytest.approx(sum(error.errors(visited)))
    after = [visited + as_counts([at], 9) for at in range(8)]
    by_purpose = {each.purpose: each for each in best}
    squares = [sum(error.errors(each)) for each in after]
    volumes = [np.linalg.det(error.covariance(each)[0, :2, :2]) for each in after]
    assert by_purpose["prediction"].candidate == int(np.argmin(squares))
    assert by_purpose["parameters"].candidate == int(np.argmin(volumes))
    assert by_purpose["prediction"].after.prediction_error ** 2 == pytest.approx(min(squares))
    alone = parts_of(own[:8], further[:8])
    np.testing.assert_array_equal(parts.own, alone.own)


def test_a_visit_that_draws_the_fit_away_from_the_rest_is_not_proposed_for_predictions():
    """What the model lacks moves one parameter to opposite sides in two candidates; after one visit of each, K = 0."""
    own, noise, rows = np.ones((2, 1, 1)), 1e-4, []
    for side in (1.0, -1.0):
        pull, further = own / noise, side * own
        bread = 2 * np.tensordot(pull, own, ((0, 1), (0, 1)))
        local = parts_of_one(own, pull, further, np.zeros(1), np.zeros(1))
        rows.append((bread, bread, bread, *local, *predicted_means(own, further, np.ones((2, 1)), np.eye(1))))
    parts = stacked(rows, np.zeros(1), np.eye(1))
    _, best = next_visits(ExpectedError(parts, np.zeros((1, 1))), np.array([1, 1]), 1, 2)
    assert [each.purpose for each in best] == ["parameters"]
