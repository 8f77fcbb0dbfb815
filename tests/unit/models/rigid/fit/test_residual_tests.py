"""Tests of residuals: how often they speak where they should not, and where they should."""

import itertools

import numpy as np
import pytest
from scipy.signal import lfilter

from rigid_models import random_rows
from robid.models.rigid.fit.regression import ordinary_least_squares, reduce_rows, residuals
from robid.models.rigid.fit.residuals import check_normality, check_whiteness, expected_correlation
from robid.models.rigid.fit.rows import Rows
from robid.signals.filters import design_decimator

DECIMATOR = design_decimator(12)
OWN = DECIMATOR.autocorrelation(10)


def _filtered(generator, n_kept=360):
    return DECIMATOR(generator.standard_normal(12 * (n_kept - 1) + 1 + 2 * DECIMATOR.reach))


def test_filtered_white_noise_is_white_net_of_its_filter_with_and_without_gaps():
    chances = []
    for seed in range(400):
        residual = _filtered(np.random.default_rng(seed))
        if seed % 2:
            residual[(np.arange(360) % 20) < 5] = np.nan
        chances.append(check_whiteness(residual, OWN).p_value)
    assert np.mean(np.array(chances) < 0.05) == pytest.approx(0.05, abs=0.035)
    assert np.mean(np.array(chances) < 0.5) == pytest.approx(0.5, abs=0.08)


def test_noise_that_its_filter_correlates_strongly_is_white_net_of_it():
    own = np.zeros(11)
    own[:4] = np.convolve(np.ones(4), np.ones(4))[3:] / 4
    chances = []
    for seed in range(300):
        noise = np.convolve(np.random.default_rng(seed).standard_normal(2003), np.ones(4), "valid")
        chances.append(check_whiteness(noise, own).p_value)
    assert np.mean(np.array(chances) < 0.05) == pytest.approx(0.05, abs=0.04)


def test_a_filter_forgotten_looks_like_colour():
    alone = np.r_[1.0, np.zeros(10)]
    residual = _filtered(np.random.default_rng(1), 20_000)
    assert check_whiteness(residual, OWN).p_value > 1e-3
    assert check_whiteness(residual, alone).p_value < 1e-6


def test_coloured_noise_is_found():
    noise = np.random.default_rng(0).standard_normal(400)
    found = check_whiteness(lfilter([1.0], [1.0, -0.5], noise), np.r_[1.0, np.zeros(10)])
    assert found.p_value < 1e-6
    assert found.correlation[0] == found.largest == pytest.approx(0.5, abs=0.1)


def test_gaussian_residuals_are_gaussian_and_others_are_not():
    generator = np.random.default_rng(0)
    chances = [check_normality(generator.standard_normal(300)).p_value for _ in range(400)]
    assert np.mean(np.array(chances) < 0.05) == pytest.approx(0.05, abs=0.04)
    heavy = check_normality(np.append(generator.standard_t(3, 500), np.nan))
    assert heavy.p_value < 1e-6
    assert heavy.excess_kurtosis > 1
    assert 0.005 < heavy.outlier_share < 0.05
    assert check_normality(generator.exponential(size=500)).skewness == pytest.approx(2, abs=0.7)


def test_too_few_residuals_say_nothing():
    assert np.isnan(check_normality(np.ones(5)).p_value)
    assert np.isnan(check_whiteness(np.ones(15), OWN).p_value)


@pytest.mark.parametrize("blocks", [1, 9, 60])
def test_a_fit_takes_correlation_out_of_white_residuals(blocks):
    """Slow columns explain slow noise: what is left is negatively correlated, as expected."""
    slow = np.cos(np.pi * np.outer(np.arange(120) + 0.5, np.arange(12)) / 120)
    (rows,) = random_rows(n_row=120, parameters=(0.0,) * 12)
    cuts = np.linspace(0, 120, blocks + 1).astype(int)
    columns = slow[:, None, :]
    alone = np.r_[1.0, np.zeros(4)]
    found, expected = [], None
    for seed in range(300):
        torque = np.random.default_rng(seed).standard_normal((120, 1))
        source = tuple(Rows(columns[a:b], torque[a:b], rows.used[a:b]) for a, b in itertools.pairwise(cuts))
        reduction = reduce_rows(source)
        estimate = ordinary_least_squares(reduction)
        if expected is None:
            expected = expected_correlation(source, reduction, estimate, alone)[0]
        found.append(check_whiteness(residuals(source, estimate.parameters)[:, 0], alone).correlation)
    assert expected[1] < -0.08
    np.testing.assert_allclose(np.mean(found, axis=0), expected[1:], atol=4 / np.sqrt(120 * 300) + 0.01)
