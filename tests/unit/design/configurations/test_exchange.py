"""Rounding and exchange against published numbers and brute force."""

from itertools import combinations, combinations_with_replacement

import numpy as np
import pytest

from design_systems import as_counts, make_exchange, random_parts
from robid.design.configurations.exchange import best_exchange, efficient_rounding
from robid.design.configurations.relaxed import relaxed_design
from robid.design.configurations.visits import merged


def test_rounding_gives_exact_shares_and_is_efficient_between_them():
    """Pukelsheim and Rieder (1992): no transfer raises the least `n_i / w_i` over the largest `(n_i - 1) / w_i`."""
    weights = np.array([1, 2, 3]) / 6
    assert efficient_rounding(weights, 6).tolist() == [1, 2, 3]
    assert efficient_rounding(weights, 12).tolist() == [2, 4, 6]
    for experiments in range(3, 60):
        counts = efficient_rounding(weights, experiments)
        assert counts.sum() == experiments
        assert (counts / weights).min() >= ((counts - 1) / weights).max() - 1e-12


def test_rounding_leaves_out_zero_weights_and_refuses_too_few():
    assert efficient_rounding(np.array([0.5, 0, 0.5]), 5).tolist() in ([3, 0, 2], [2, 0, 3])
    with pytest.raises(ValueError, match="at least 3"):
        efficient_rounding(np.ones(3), 2)


@pytest.mark.parametrize("criterion", ["d", "a", "e"])
@pytest.mark.parametrize("seed", range(6))
def test_choice_of_different_candidates_against_brute_force(criterion, seed):
    parts = random_parts(12, 2, 4, seed)
    problem = make_exchange(parts, 4, criterion=criterion)
    weights = relaxed_design(parts[0, :, 0], criterion=criterion).weights
    counts = best_exchange(problem, weights, restarts=4, seed=1)
    assert counts.sum() == 4
    assert counts.max() == 1
    best = max(problem.worth(as_counts(subset, 12)) for subset in combinations(range(12), 4))
    assert problem.worth(counts) >= 0.98 * best


@pytest.mark.parametrize("seed", range(4))
def test_repeats_among_few_candidates_against_brute_force(seed):
    parts = random_parts(7, 1, 3, seed)
    problem = make_exchange(parts, 5, repeats=True, distinct=3)
    weights = relaxed_design(parts[0, :, 0]).weights
    counts = best_exchange(problem, weights, restarts=4, seed=1)
    assert counts.sum() == 5
    assert (counts > 0).sum() <= 3
    every = (as_counts(one, 7) for one in combinations_with_replacement(range(7), 5))
    best = max(problem.worth(one) for one in every if (one > 0).sum() <= 3)
    assert problem.worth(counts) >= 0.99 * best


@pytest.mark.parametrize("seed", range(4))
def test_budget_is_kept_and_well_spent(seed):
    parts = random_parts(10, 2, 3, seed)
    cost = np.random.default_rng(seed).uniform(0.5, 3, 10)
    problem = make_exchange(parts, 4, cost=cost, budget=5.0)
    counts = best_exchange(problem, np.ones(10), restarts=4, seed=1)
    assert counts @ cost <= 5.0 * (1 + 1e-9)
    affordable = [as_counts(one, 10) for one in combinations(range(10), 4) if cost[list(one)].sum() <= 5]
    assert problem.worth(counts) >= 0.97 * max(problem.worth(one) for one in affordable)


def test_exchange_never_loses_to_greedy_and_sometimes_wins():
    gains = []
    for seed in range(12):
        problem = make_exchange(random_parts(20, 2, 6, 100 + seed), 5)
        greedy = problem.greedy(np.zeros(20, int))
        gains.append(problem.worth(problem.improved(greedy)) / problem.worth(greedy))
    assert min(gains) >= 1
    assert max(gains) > 1.002


@pytest.mark.parametrize("criterion", ["d", "a", "e"])
@pytest.mark.parametrize("seed", range(6))
def test_screening_by_slopes_leaves_no_gaining_move(criterion, seed):
    problem = make_exchange(random_parts(25, 2, 4, seed), 6, criterion=criterion)
    counts = problem.improved(as_counts(range(6), 25))
    reached = problem.worth(counts)
    for taken in np.flatnonzero(counts):
        for other in np.flatnonzero(counts == 0):
            moved = counts.copy()
            moved[[taken, other]] += [-1, 1]
            assert problem.worth(moved) <= reached * (1 + 1e-9)


def test_bread_and_meat_are_merged_to_the_inverse_sandwich():
    parts = random_parts(1, 5, 3, seed=3, n_part=2)[0, 0]
    covariance = np.linalg.inv(parts[0]) @ parts[1] @ np.linalg.inv(parts[0])
    np.testing.assert_allclose(np.linalg.inv(merged(parts)), covariance, rtol=1e-9)


def test_choice_for_a_fits_own_weights_against_brute_force():
    parts = random_parts(10, 3, 3, seed=4, n_part=2)
    problem = make_exchange(parts, 3)
    counts = best_exchange(problem, np.ones(10), restarts=6, seed=1)
    every = (as_counts(one, 10) for one in combinations(range(10), 3))
    best = max(problem.worth(one) for one in every)
    assert problem.worth(counts) >= 0.98 * best
