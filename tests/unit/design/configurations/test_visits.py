"""Designs where parameters differ between configurations: against every plan there is, and against lucky variances."""

from itertools import combinations, combinations_with_replacement

import numpy as np
import pytest

from design_systems import as_counts, make_exchange, random_parts
from robid.design.configurations.exchange import best_exchange
from robid.design.configurations.information import design_configurations, information
from robid.design.configurations.options import BetweenRelativeStd, DesignOptions
from robid.design.configurations.relaxed import relaxed_design
from robid.design.configurations.stability import Trial, stability
from robid.design.configurations.visits import FittedInformation, make_visits, slopes
from tolerances import FINITE_DIFFERENCE

BETWEEN = np.array([0.3, 0.8, 2.0])


def random_matrices(n_conf, n_row, seed):
    return information(np.random.default_rng(seed).normal(size=(n_conf, n_row, 3)), np.array(1.0))


def total(matrices, counts, between=BETWEEN):
    """Information of numbers of visits by inverses alone."""
    used = np.flatnonzero(counts)
    clusters = (np.linalg.inv(np.linalg.inv(counts[index] * matrices[index]) + np.diag(between**2)) for index in used)
    return sum(clusters)


def designed(matrices, names="abc", between=BETWEEN, **changes):
    own = {name: changes.pop(name) for name in ("prior", "cost", "fitted") if name in changes}
    options = DesignOptions(**changes)
    return design_configurations(
        matrices, np.zeros((matrices.shape[-3], 1)), tuple(names), options, between=between, **own
    )


def worth(matrix):
    return np.exp(np.linalg.slogdet(matrix)[1] / len(matrix))


@pytest.mark.parametrize("seed", range(5))
def test_a_choice_promises_what_clusters_allow_and_its_bound_holds_for_every_other(seed):
    matrices = random_matrices(9, 4, seed)
    design = designed(matrices, count=4)
    own = total(matrices, design.counts)
    np.testing.assert_allclose(design.predicted_relative_std, np.sqrt(np.diag(np.linalg.inv(own))), rtol=1e-8)
    every = [worth(total(matrices, as_counts(one, 9))) for one in combinations(range(9), 4)]
    assert worth(own) >= 0.99 * max(every)
    assert design.efficiency <= design.choice_efficiency <= worth(own) / max(every) + 1e-9
    assert design.gap <= 1e-8
    assert design.weights.max() <= 1 / 4 + 1e-9
    shared = worth(sum(4 * each * total(matrices, as_counts([index], 9)) for index, each in enumerate(design.weights)))
    assert design.choice_efficiency == pytest.approx(worth(own) / shared, rel=1e-6)
    np.testing.assert_allclose(design.between_relative_std, BETWEEN)
    one_more = [worth(own + total(matrices, as_counts([index], 9))) for index in range(9)]
    more = np.flatnonzero(design.counts == 0)
    gain = 3 * np.log(np.array(one_more) / worth(own))
    np.testing.assert_allclose(design.gain[more], gain[more], rtol=1e-7)


@pytest.mark.parametrize("criterion", ["d", "a"])
@pytest.mark.parametrize("seed", range(4))
def test_repeats_are_worth_what_they_are_and_no_plan_beats_the_bounds(seed, criterion):
    matrices = random_matrices(6, 4, seed)
    design = designed(matrices, count=3, experiments=6, criterion=criterion)

    def value(counts):
        found = total(matrices, counts)
        return worth(found) if criterion == "d" else 1 / np.trace(np.linalg.inv(found))

    every = (as_counts(one, 6) for one in combinations_with_replacement(range(6), 6))
    values = {tuple(counts): value(counts) for counts in every}
    allowed = max(found for counts, found in values.items() if np.count_nonzero(counts) <= 3)
    own = value(design.counts)
    assert own >= 0.995 * allowed
    np.testing.assert_allclose(
        design.predicted_relative_std**2, np.diag(np.linalg.inv(total(matrices, design.counts))), rtol=1e-8
    )
    assert design.efficiency <= own / max(values.values()) + 1e-9
    assert design.efficiency < design.choice_efficiency <= own / allowed + 1e-9
    shared = max(found for counts, found in values.items() if not np.array(counts)[design.counts == 0].any())
    assert 1 - design.rounding_loss <= own / shared + 1e-9
    assert design.rounding_loss < 0.1


def test_costs_and_what_is_known_beforehand_keep_the_bounds():
    matrices, prior = random_matrices(6, 4, 7), np.diag([2.0, 0.1, 0.4])
    cost = np.array([1.0, 2.0, 1.5, 3.0, 1.0, 2.5])
    design = designed(matrices, count=3, experiments=5, budget=8.0, cost=cost, prior=prior)
    every = (as_counts(one, 6) for size in range(1, 6) for one in combinations_with_replacement(range(6), size))
    values = [worth(prior + total(matrices, one)) for one in every if one @ cost <= 8 and np.count_nonzero(one) <= 3]
    own = worth(prior + total(matrices, design.counts))
    assert own >= 0.98 * max(values)
    assert design.efficiency <= design.choice_efficiency <= own / max(values) + 1e-9
    assert design.counts @ cost <= 8


@pytest.mark.parametrize("criterion", ["d", "a", "e"])
@pytest.mark.parametrize("seed", range(4))
def test_screening_by_slopes_leaves_no_gaining_move_of_repeats(criterion, seed):
    parts = random_parts(8, 4, 3, seed)
    problem = make_exchange(parts, 7, between=0.7, repeats=True, distinct=4, criterion=criterion)
    counts = problem.improved(as_counts([0, 1, 2, 3, 0, 0, 1], 8))
    reached = problem.worth(counts)
    for taken in np.flatnonzero(counts):
        for other in np.arange(8):
            moved = counts.copy()
            moved[[taken]] -= 1
            moved[[other]] += 1
            if np.count_nonzero(moved) <= 4:
                assert problem.worth(moved) <= reached * (1 + 1e-9)


def test_visits_to_one_place_stop_telling_more():
    """Two parameters, one seen by each candidate: the worse one gets visits that would tell nothing in the other."""
    matrices = np.array([np.diag([100.0, 1e-3]), np.diag([1e-3, 1.0]), np.diag([1e-3, 0.9])])
    alike = designed(matrices, "ab", np.zeros(2), count=3, experiments=12)
    apart = designed(matrices, "ab", np.array([1.0, 1.0]), count=3, experiments=12)
    assert alike.counts[0] == 6
    assert apart.counts[0] < 4
    assert apart.counts[1] > 1
    assert apart.counts[2] > 1


def test_the_slope_of_visits_is_that_of_their_information():
    alone, counts, step = random_matrices(3, 4, 3)[None], np.array([1, 2, 5]), 1e-4
    found = slopes(alone, counts, BETWEEN**2)[0]
    for index, count in enumerate(counts):
        ends = [
            np.linalg.inv(np.linalg.inv((count + side * step) * alone[0, index]) + np.diag(BETWEEN**2))
            for side in (1, -1)
        ]
        expected = (ends[0] - ends[1]) / (2 * step)
        np.testing.assert_allclose(found[index], expected, atol=FINITE_DIFFERENCE * np.abs(expected).max())


def test_a_lucky_variance_wins_no_longer():
    """One spring seems perfectly known in a candidate that hardly sees the other."""
    lucky, honest = np.diag([1e9, 1.0]), np.diag([1e4, 50.0])
    matrices = np.array([lucky, honest, np.diag([9e3, 40.0]), np.diag([8e3, 45.0])])
    assert 0 in designed(matrices, "ab", np.zeros(2), count=2).chosen
    default = BetweenRelativeStd().of(("gear_1.stiffness", "gear_1.damping"))
    np.testing.assert_allclose(default, [0.02, 0.2])
    assert 0 not in designed(matrices, "ab", default, count=2).chosen


def test_choices_by_variances_of_few_realizations_are_worth_more_where_clusters_may_differ():
    """Truth by truth: variances from two degrees of freedom each, judged by the true ones and by differences."""
    generator, spread = np.random.default_rng(5), np.full(3, 0.02)
    worths = []
    for _ in range(30):
        jacobian = generator.normal(size=(40, 6, 3))
        variance = 0.02**2 * generator.uniform(0.5, 2, (40, 6))
        estimated = variance * generator.chisquare(2, (40, 6)) / 2
        seen = information(jacobian, estimated)
        pair = (designed(seen, between=np.zeros(3), count=4), designed(seen, between=spread, count=4))
        worths.append([worth(total(information(jacobian, variance), each.counts, spread)) for each in pair])
    gain = np.log(np.array(worths)[:, 1] / np.array(worths)[:, 0])
    assert gain.mean() > 4 * gain.std() / np.sqrt(len(gain))


def sandwich(jacobian, variance, weight, chosen, precision, between):
    """Covariance of a weighted fit by all its residuals' covariance, what differs between clusters in it."""
    rows = jacobian[chosen].reshape(-1, jacobian.shape[-1])
    weights = weight[chosen].ravel()
    spread = np.zeros((rows.shape[0], rows.shape[0]))
    size = jacobian.shape[1]
    for cluster, index in enumerate(chosen):
        here = slice(cluster * size, (cluster + 1) * size)
        spread[here, here] = np.diag(variance[index]) + (jacobian[index] * between**2) @ jacobian[index].T
    gain = np.linalg.inv(rows.T * weights @ rows + np.diag(precision)) @ (rows.T * weights)
    known = np.linalg.inv(rows.T * weights @ rows + np.diag(precision)) * np.sqrt(precision)
    return gain @ spread @ gain.T + known @ known.T


@pytest.mark.parametrize("seed", range(3))
def test_a_fit_with_weights_of_its_own_errs_by_what_clusters_differ_by(seed):
    generator = np.random.default_rng(seed)
    jacobian = generator.normal(size=(8, 5, 5))
    variance, weight = generator.uniform(0.2, 5, (8, 5)), generator.uniform(0.5, 2, (8, 5))
    precision = np.array([0, 0, 0, 0.5, 40])
    bread, best = information(jacobian, 1 / weight), information(jacobian, variance)
    fitted = FittedInformation(
        bread[None], information(jacobian, 1 / (weight**2 * variance))[None], best[None], precision
    )
    design = designed(best[:, :3, :3], count=3, fitted=fitted)
    apart = np.append(BETWEEN, [0, 0])

    def covariance(chosen):
        return sandwich(jacobian, variance, weight, list(chosen), precision, apart)[:3, :3]

    own = covariance(design.chosen)
    np.testing.assert_allclose(design.predicted_relative_std, np.sqrt(np.diag(own)), rtol=1e-8)
    every = list(combinations(range(8), 3))
    assert worth(np.linalg.inv(own)) >= 0.97 * max(worth(np.linalg.inv(covariance(one))) for one in every)

    def optimal(chosen):
        """The best that weights could do: generalised least squares with the whole covariance."""
        whole = np.diag(precision)
        for index in chosen:
            spread = np.diag(variance[index]) + (jacobian[index] * apart**2) @ jacobian[index].T
            whole = whole + jacobian[index].T @ np.linalg.solve(spread, jacobian[index])
        return np.linalg.inv(whole)[:3, :3]

    most = max(worth(np.linalg.inv(optimal(one))) for one in every)
    assert design.efficiency * most / worth(np.linalg.inv(own)) <= 1 + 1e-9
    assert design.efficiency > 0.3


def test_repeats_of_a_fit_with_its_own_weights_err_alike_in_their_place():
    generator = np.random.default_rng(4)
    jacobian, variance, weight = generator.normal(size=(4, 6, 3)), np.full((4, 6), 0.7), np.full((4, 6), 1.3)
    parts = np.stack([information(jacobian, 1 / weight), information(jacobian, 1 / (weight**2 * variance))], axis=1)
    found = make_visits(parts[None], BETWEEN**2).total(np.array([3, 0, 2, 0]))[0]
    tripled = np.concatenate([jacobian[[0]].repeat(3, axis=1), jacobian[[2]].repeat(3, axis=1)])
    weights = np.concatenate([weight[[0]].repeat(3, axis=1), np.where(np.arange(18) < 12, 1.3, 0.0)[None]])
    tripled[1] = np.concatenate([jacobian[2], jacobian[2], np.zeros((6, 3))])
    tripled[0] = np.concatenate([jacobian[0]] * 3)
    expected = sandwich(tripled, np.full((2, 18), 0.7), weights, [0, 1], np.zeros(3), BETWEEN)
    np.testing.assert_allclose(np.linalg.inv(found[0]) @ found[1] @ np.linalg.inv(found[0]), expected, rtol=1e-8)


def test_halves_are_judged_by_what_clusters_allow():
    matrices = random_matrices(8, 4, 11)
    design = designed(matrices, count=3)
    same = stability("realizations", [Trial(matrices, matrices)], design, DesignOptions(count=3), between=BETWEEN)
    np.testing.assert_allclose(same.efficiency, design.efficiency, rtol=1e-6)
    np.testing.assert_array_equal(same.kept, 1)
    other = random_matrices(8, 4, 12)
    found = stability("realizations", [Trial(other, matrices)], design, DesignOptions(count=3), between=BETWEEN)
    chosen = designed(other, count=3)
    ratio = worth(total(matrices, chosen.counts)) / worth(total(matrices, design.counts))
    np.testing.assert_allclose(found.efficiency, design.efficiency * ratio, rtol=1e-6)


def test_none_between_configurations_is_as_before():
    matrices = random_matrices(8, 3, 2)
    found = [designed(matrices, between=each, count=3, experiments=7) for each in (None, np.zeros(3))]
    assert found[0].between_relative_std is None
    np.testing.assert_array_equal(found[0].counts, found[1].counts)
    assert found[0].efficiency == found[1].efficiency
    weights = relaxed_design(matrices).weights
    np.testing.assert_allclose(found[0].weights, weights)
    problem = make_exchange(matrices[None, :, None], 7, repeats=True, distinct=3)
    np.testing.assert_array_equal(found[0].counts, best_exchange(problem, weights, restarts=4, seed=1))
