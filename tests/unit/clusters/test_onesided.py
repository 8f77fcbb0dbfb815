"""Quantities that cannot be negative, against their definition and against drawn samples."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import truncnorm

from robid.clusters.pooling import bound, bounded_moments


@pytest.mark.parametrize("above", [-200.0, -40.0, -30.001, -29.999, -8.0, -1.0, 0.0, 2.0, 40.0])
def test_what_is_left_of_one_normal_variable(above):
    std, least = 0.4, 3.0
    mean, variance = bounded_moments(np.array([least + std * above]), np.array([std]), np.array([least]))
    if above > -20:
        own = truncnorm(-above, np.inf, loc=least + std * above, scale=std)
        assert mean[0] == pytest.approx(own.mean(), rel=1e-9)
        assert variance[0] == pytest.approx(own.var(), rel=1e-6)
    else:
        # Far out what is left is exponential, its mean at std / |above| beyond the bound.
        assert mean[0] - least == pytest.approx(std / abs(above), rel=3 / above**2)
        assert variance[0] == pytest.approx((std / above) ** 2, rel=8 / above**2)


def test_a_half_normal_is_found_exactly():
    precision, pull = bound(np.zeros(1), np.array([[4.0]]), np.zeros(1))
    variance = 1 / (0.25 + precision[0])
    assert variance * pull[0] == pytest.approx(2 * np.sqrt(2 / np.pi), rel=1e-5)
    assert variance == pytest.approx(4 * (1 - 2 / np.pi), rel=1e-5)


def test_what_hangs_together_with_bounded_quantities_follows_them():
    generator = np.random.default_rng(5)
    root, mean = generator.normal(size=(4, 4)), generator.normal(size=4)
    covariance = root @ root.T + 0.1 * np.eye(4)
    least = np.array([0.0, 0.3, -np.inf, -np.inf])
    precision, pull = bound(mean, covariance, least)
    after = np.linalg.inv(np.linalg.inv(covariance) + np.diag(precision))
    drawn = generator.multivariate_normal(mean, covariance, size=2_000_000)
    left = drawn[(drawn >= least).all(axis=1)]
    assert len(left) > 10_000
    np.testing.assert_allclose(after @ (np.linalg.solve(covariance, mean) + pull), left.mean(axis=0), atol=0.03)
    np.testing.assert_allclose(np.sqrt(np.diag(after)), left.std(axis=0), rtol=0.03)
    assert (precision[2:] == 0).all()
    assert (pull[2:] == 0).all()


def test_bounds_far_away_say_nothing():
    precision, pull = bound(np.ones(3), np.eye(3), np.array([-50.0, -np.inf, -60.0]))
    np.testing.assert_allclose(precision, 0.0, atol=1e-9)
    np.testing.assert_allclose(pull, 0.0, atol=1e-9)
