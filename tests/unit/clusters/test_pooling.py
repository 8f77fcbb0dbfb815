"""The parameters of all clusters together: leaving clusters out, degrees of freedom, coverage."""

import numpy as np
import pytest
from scipy.stats import t

from cluster_systems import dense_clusters
from robid.clusters.evidence import Evidence, summarise
from robid.clusters.pooling import Pooled, estimate_between, pool

BETWEEN = np.array([0.2, 0.0, 0.05])


def known(evidence, precision, pull=None):
    size = len(evidence.pull)
    own = precision * np.eye(size)
    return Evidence(evidence.rows, evidence.target, own, np.zeros(size) if pull is None else pull)


@pytest.mark.parametrize("n_cluster", [2, 5, 9])
def test_equal_clusters_have_the_mean_and_one_freedom_less_than_their_number(n_cluster):
    estimates = np.random.default_rng(1).standard_normal(n_cluster)
    bread = np.full((n_cluster, 1, 1), 4.0)
    evidence = summarise(bread, 4 * estimates[:, None], bread, np.zeros((1, 1)), np.zeros(1))
    found = pool(evidence, np.array([0.3]))
    assert found.shift[0] == pytest.approx(estimates.mean())
    assert found.assumed[0, 0] == pytest.approx((0.25 + 0.3) / n_cluster)
    # Leaving out: the variance of a mean times G / (G - 1).
    assert found.covariance[0, 0] == pytest.approx(estimates.var(ddof=1) / (n_cluster - 1))
    assert found.degrees_of_freedom[0] == pytest.approx(n_cluster - 1)
    assert found.dependence[0] == pytest.approx(1 / n_cluster)


def test_two_unequal_clusters_have_less_than_one_freedom_and_are_told_one():
    bread = np.array([4.0, 1.0])[:, None, None]
    found = pool(summarise(bread, np.array([[4.0], [0.0]]), bread, np.zeros((1, 1)), np.zeros(1)), np.zeros(1))
    assert found.shift[0] == pytest.approx(0.8)
    # By hand: without the first cluster 0, without the second 1.
    assert found.covariance[0, 0] == pytest.approx(0.8**2 + 0.2**2)
    assert found.degrees_of_freedom[0] == pytest.approx(1.0)
    assert found.dependence[0] == pytest.approx(0.8)


@pytest.mark.parametrize("precision", [0.0, 2.0])
def test_the_covariance_is_that_of_leaving_clusters_out(precision):
    clusters = dense_clusters(6, 8, np.array([0.5, 0.0, 0.2]), seed=2)
    pull = precision * np.array([0.2, -0.1, 0.0])
    evidence = known(clusters.evidence, precision, pull)
    found = pool(evidence, BETWEEN)

    def estimate(used):
        total, slope = precision * np.eye(3), pull.copy()
        for index in used:
            rows = clusters.derivative[index]
            weighted = np.linalg.solve(np.eye(8) + (rows * BETWEEN) @ rows.T, rows)
            total, slope = total + rows.T @ weighted, slope + weighted.T @ clusters.measured[index]
        return np.linalg.solve(total, slope), np.linalg.inv(total)

    whole, assumed = estimate(range(6))
    moves = np.array([estimate(set(range(6)) - {out})[0] - whole for out in range(6)])
    np.testing.assert_allclose(found.shift, whole, rtol=1e-9)
    np.testing.assert_allclose(found.assumed, assumed, rtol=1e-9)
    np.testing.assert_allclose(found.covariance, moves.T @ moves + precision * assumed @ assumed, rtol=1e-8)


@pytest.mark.parametrize("precision", [0.0, 2.0])
def test_freedom_is_that_of_the_variance_of_the_variance(precision):
    # A cluster that tells much more than the others leaves few degrees of freedom.
    size = np.array([5.0, 1, 1, 1, 1, 1])
    generator = np.random.default_rng(3)
    derivative = size[:, None, None] * generator.standard_normal((6, 4, 2))
    between = np.array([0.1, 0.0])
    draws = []
    for _ in range(4000):
        own = np.sqrt(between) * generator.standard_normal((6, 2))
        measured = np.einsum("crp,cp->cr", derivative, own) + generator.standard_normal((6, 4))
        # What is known beforehand is drawn too: it errs by as much as it says.
        pull = np.sqrt(precision) * generator.standard_normal(2)
        evidence = Evidence(derivative, measured, precision * np.eye(2), pull)
        found = pool(evidence, between)
        draws.append(np.diag(found.covariance))
    mean, spread = np.mean(draws, axis=0), np.var(draws, axis=0)
    np.testing.assert_allclose(found.degrees_of_freedom, 2 * mean**2 / spread, rtol=0.15)
    assert found.degrees_of_freedom.min() < 4.0
    assert (mean >= 0.95 * np.diag(found.assumed)).all()


def test_what_one_place_knows_alone_is_said_to_depend_on_it():
    rows = np.zeros((4, 2, 2))
    rows[:, 0, 0] = 3.0
    rows[2, 1, 1] = 3.0
    evidence = Evidence(rows, np.zeros((4, 2)), 1e-3 * np.eye(2), np.zeros(2))
    found = pool(evidence, np.zeros(2))
    assert found.dependence[1] > 0.99
    assert found.dependence[0] == pytest.approx(0.25, abs=0.01)


def coverage(draw, n_draw=400):
    """Share of the draws of evidence around zero whose intervals contain it, and how wide they are over the errors."""
    held, wide, errors = [], [], []
    for seed in range(n_draw):
        evidence = draw(seed)
        found = pool(evidence, estimate_between(evidence).variance)
        reach = found.reach(0.95)
        held.append(np.abs(found.shift) <= reach)
        wide.append(reach)
        errors.append(np.abs(found.shift))
    return np.mean(held, axis=0), np.median(wide, axis=0) / np.quantile(errors, 0.95, axis=0)


def test_intervals_hold_where_clusters_differ_and_where_they_do_not():
    held, ratio = coverage(lambda seed: dense_clusters(8, 6, np.array([0.5, 0.0, 0.2]), seed=seed).evidence)
    assert (held > 0.92).all(), held
    assert (ratio < 2.0).all(), ratio


def test_normal_quantiles_of_the_assumed_covariance_do_not_hold():
    # What the small-sample correction is for: if this held, the test above could not fail.
    missed = []
    for seed in range(400):
        evidence = dense_clusters(8, 6, np.array([0.5, 0.5, 0.5]), seed=seed).evidence
        found = pool(evidence, np.zeros(3))
        missed.append(np.abs(found.shift) > t.ppf(0.975, 1e6) * np.sqrt(np.diag(found.assumed)))
    assert np.mean(missed) > 0.15


def pooled_of(assumed, differing, freedom, dependence=0.3):
    size = len(assumed)
    return Pooled(
        np.zeros(size), np.zeros(size), np.diag(assumed), np.diag(differing), freedom, np.full(size, dependence)
    )


def test_one_covariance_has_the_intervals_of_both_where_each_is_the_wider():
    # Assumed alone; few clusters, wider by variance; few clusters, wider by the quantile alone.
    found = pooled_of(np.array([4.0, 1.0, 1.0]), np.array([1.0, 9.0, 0.81]), np.array([20.0, 5.0, 2.0]))
    covariance, freedom = found.spread(0.95)
    np.testing.assert_allclose(np.diag(covariance), [4.0, 9.0, 0.81])
    np.testing.assert_array_equal(freedom, [np.inf, 5.0, 2.0])
    wanted = [1.959964 * 2, t.ppf(0.975, 5) * 3, t.ppf(0.975, 2) * 0.9]
    np.testing.assert_allclose(found.reach(0.95), wanted, rtol=1e-6)


def test_what_is_assumed_keeps_its_correlations_and_the_rest_has_its_own():
    together, against = np.array([[1.0, 0.5], [0.5, 1.0]]), np.array([[10.0, -10.0], [-10.0, 10.0]])
    found = Pooled(np.zeros(2), np.zeros(2), together, against, np.full(2, 4.0), np.zeros(2))
    covariance, _ = found.spread(0.95)
    np.testing.assert_allclose(covariance, [[10.0, 0.5 - 9.0], [0.5 - 9.0, 10.0]])


def test_what_a_single_place_knows_is_not_tested_by_the_others():
    found = pooled_of(np.ones(1), np.full(1, 100.0), np.ones(1), dependence=0.95)
    assert found.untested.all()
    np.testing.assert_allclose(found.reach(0.95), 1.959964, rtol=1e-6)
