"""Differences between clusters by restricted maximum likelihood, against closed forms and other implementations."""

import numpy as np
import pytest
from scipy.optimize import approx_fprime

from cluster_systems import Dense, dense_clusters
from robid.clusters.evidence import Evidence, summarise
from robid.clusters.pooling import BetweenOptions, estimate_between, pool, restricted_deviance
from tolerances import FINITE_DIFFERENCE


def scalar_places(estimates, variances):
    """Clusters that each give an estimate of one parameter."""
    information = 1 / np.asarray(variances)
    bread = information[:, None, None]
    return summarise(bread, (information * estimates)[:, None], bread, np.zeros((1, 1)), np.zeros(1))


def test_equally_good_clusters_have_the_moment_estimate():
    estimates = np.array([0.3, -0.2, 1.1, 0.9, -0.6])
    found = estimate_between(scalar_places(estimates, np.full(5, 0.1)), options=BetweenOptions(largest=10.0))
    assert found.converged
    assert found.variance[0] == pytest.approx(estimates.var(ddof=1) - 0.1, rel=1e-5)


def test_differences_that_noise_explains_are_none():
    estimates = np.array([0.3, -0.2, 0.1, 0.2, -0.1])
    found = estimate_between(scalar_places(estimates, np.full(5, 0.1)))
    assert found.variance[0] == 0.0


def test_a_bound_holds():
    estimates = np.array([30.0, -20.0, 10.0])
    found = estimate_between(scalar_places(estimates, np.full(3, 0.1)), options=BetweenOptions(largest=2.0))
    assert found.variance[0] == pytest.approx(4.0)


@pytest.mark.parametrize("known", [0.0, 3.0])
def test_the_deviance_is_that_of_all_rows(known):
    between = np.array([0.2, 0.0, 0.05])
    clusters = dense_clusters(5, 6, np.array([0.5, 0.0, 0.2]), seed=3)
    covariance, rows, measured = clusters.covariance(between), clusters.stacked, clusters.measured.ravel()
    precision, pull = known * np.eye(3), known * np.array([0.1, 0.2, 0.3])
    weighted = np.linalg.solve(covariance, rows)
    total = rows.T @ weighted + precision
    slope = weighted.T @ measured + pull
    expected = np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(total)[1]
    expected += measured @ np.linalg.solve(covariance, measured) - slope @ np.linalg.solve(total, slope)
    evidence = clusters.evidence

    def both(variance):
        own = Evidence(evidence.rows, evidence.target, precision, pull)
        return restricted_deviance(own, variance)

    # Rows beyond what the parameters explain add a constant.
    hidden = (clusters.measured**2).sum() - (evidence.target**2).sum()
    assert both(between)[0] + hidden == pytest.approx(expected, rel=1e-9)
    slopes = approx_fprime(between + 0.01, lambda at: both(at)[0], 1e-7)
    np.testing.assert_allclose(both(between + 0.01)[1], slopes, rtol=100 * FINITE_DIFFERENCE, atol=1e-4)


def test_known_variances_stay_and_the_others_follow():
    clusters = dense_clusters(12, 8, np.array([0.5, 0.3, 0.0]), seed=4)
    found = estimate_between(clusters.evidence, np.array([np.nan, 0.09, 0.0]))
    assert found.variance[1:].tolist() == [0.09, 0.0]
    slope = restricted_deviance(clusters.evidence, found.variance)[1]
    assert abs(slope[0] * found.variance[0]) < 1e-3
    assert abs(slope[1] * 0.09) > 1e-2


def test_the_end_is_a_minimum_within_bounds():
    for seed in range(20):
        evidence = dense_clusters(8, 6, np.array([0.4, 0.0, 0.1, 0.0]), seed=seed).evidence
        found = estimate_between(evidence)
        slope = restricted_deviance(evidence, found.variance)[1]
        inside = found.variance > 0
        np.testing.assert_allclose((slope * found.variance)[inside], 0.0, atol=2e-2)
        assert (slope[~inside] > -1e-2).all()


def test_variances_are_right_on_average():
    found = [estimate_between(dense_clusters(30, 8, np.array([0.5, 0.2]), seed=seed).evidence) for seed in range(60)]
    mean = np.mean([each.variance for each in found], axis=0)
    # Deviation of a variance from 30 clusters about a quarter, of the mean of 60 some 4 %.
    np.testing.assert_allclose(mean, [0.25, 0.04], rtol=0.25)


def test_statsmodels_finds_the_same_variances():
    lm = pytest.importorskip("statsmodels.regression.mixed_linear_model")
    clusters = dense_clusters(12, 10, np.array([0.8, 0.5]), seed=5)
    groups = np.repeat(np.arange(12), 10)
    rows, measured = clusters.stacked, clusters.measured.ravel()
    free = lm.MixedLMParams.from_components(np.ones(2), np.eye(2))
    theirs = lm.MixedLM(measured, rows, groups, exog_re=rows).fit(reml=True, free=free, method="bfgs", gtol=1e-8)
    deviation = np.sqrt(theirs.scale)
    scaled = Dense(clusters.derivative / deviation, clusters.measured / deviation).evidence
    found = estimate_between(scaled, options=BetweenOptions(largest=10.0))
    np.testing.assert_allclose(found.variance, np.diag(theirs.cov_re), rtol=1e-3)
    pooled = pool(scaled, found.variance)
    np.testing.assert_allclose(pooled.shift, theirs.fe_params, rtol=1e-3)
    # Theirs is from a Hessian by all parameters.
    np.testing.assert_allclose(np.sqrt(np.diag(pooled.assumed)), theirs.bse_fe, rtol=5e-3)


def test_statsmodels_pools_estimates_alike():
    meta = pytest.importorskip("statsmodels.stats.meta_analysis")
    generator = np.random.default_rng(6)
    variances = generator.uniform(0.02, 0.5, 9)
    estimates = 0.4 * generator.standard_normal(9) + np.sqrt(variances) * generator.standard_normal(9)
    theirs = meta.combine_effects(estimates, variances, method_re="dl")
    pooled = pool(scalar_places(estimates, variances), np.array([theirs.tau2]))
    assert pooled.shift[0] == pytest.approx(theirs.mean_effect_re, rel=1e-9)
    assert np.sqrt(pooled.assumed[0, 0]) == pytest.approx(theirs.sd_eff_w_re, rel=1e-9)
