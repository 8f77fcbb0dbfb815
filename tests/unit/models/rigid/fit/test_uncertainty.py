"""Intervals that respect correlated residuals: their size in simple cases, and their coverage."""

import numpy as np
import pytest
from scipy.signal import lfilter

from block_bootstrap import bootstrap_blocks
from rigid_models import random_rows
from robid.models.rigid.fit.options import HuberOptions
from robid.models.rigid.fit.regression import huber, ordinary_least_squares, reduce_rows, weighted_least_squares
from robid.models.rigid.fit.residuals import huber_influence, least_squares_influence, long_run_covariance
from robid.models.rigid.fit.rows import Rows

TRUTH = np.array([1.0, -2.0, 3.0, 0.5])


def _coloured_rows(seed, n_row=400, n_joint=2):
    """Slow regressors, and noise that is correlated in time and between the joints."""
    generator = np.random.default_rng(seed)
    drawn = generator.standard_normal((n_row + 100, n_joint, len(TRUTH)))
    columns = lfilter([1.0], [1.0, -0.7], drawn, axis=0)[100:]
    columns[..., 0] = 1.0
    common = generator.standard_normal((n_row + 100, 1))
    noise = lfilter([1.0], [1.0, -0.6], common + generator.standard_normal((n_row + 100, n_joint)), axis=0)[100:]
    torque = columns @ TRUTH + noise * np.linspace(1, 0.3, n_joint)
    used = generator.uniform(size=torque.shape) < 0.95
    cut = n_row // 3
    return Rows(columns[:cut], torque[:cut], used[:cut]), Rows(columns[cut:], torque[cut:], used[cut:])


def _long_run(rows):
    reduction = reduce_rows(rows)
    found = weighted_least_squares(reduction)
    return found, long_run_covariance(rows, [least_squares_influence(reduction, found)], 400)


def test_covariance_of_white_residuals_is_the_classical_one():
    ratios = []
    for seed in range(40):
        rows = random_rows(n_row=3000, seed=seed, blocks=3)
        reduction = reduce_rows(rows)
        found = ordinary_least_squares(reduction)
        long_run = long_run_covariance(rows, [least_squares_influence(reduction, found)], 3000)
        ratios.append(np.diag(long_run.of(0)) / np.diag(found.covariance))
    assert long_run.freedom == 83
    np.testing.assert_allclose(np.mean(ratios, axis=0), 1.0, atol=4 * np.sqrt(2 / 83 / 40))


def test_blocks_do_not_matter():
    (whole,) = random_rows(n_row=500)
    split = tuple(Rows(whole.columns[a:b], whole.torque[a:b], whole.used[a:b]) for a, b in ((0, 77), (77, 500)))
    reduction = reduce_rows((whole,))
    influence = least_squares_influence(reduction, ordinary_least_squares(reduction))
    one, two = (long_run_covariance(rows, [influence], 500).covariance for rows in ((whole,), split))
    np.testing.assert_allclose(one, two, rtol=1e-9)


def test_difference_of_two_estimators_has_its_own_covariance():
    differences, predicted = [], []
    for seed in range(150):
        rows = random_rows(n_row=800, seed=seed, noise=lambda generator: generator.standard_t(3, size=(800, 1)))
        reduction = reduce_rows(rows)
        squares, robust = ordinary_least_squares(reduction), huber(rows, reduction)
        influences = [least_squares_influence(reduction, squares), huber_influence(reduction, robust, 1.345)]
        long_run = long_run_covariance(rows, influences, 800)
        differences.append(squares.parameters - robust.parameters)
        predicted.append(np.diag(long_run.difference(0, 1)))
    np.testing.assert_allclose(np.var(differences, axis=0) / np.mean(predicted, axis=0), 1.0, atol=0.45)


def test_bootstrap_and_long_run_agree_where_residuals_are_correlated():
    rows = _coloured_rows(0)
    found, long_run = _long_run(rows)
    drawn = bootstrap_blocks(rows, found.weights, 400, n_draw=400)
    ratio = drawn.std(axis=0) / np.sqrt(np.diag(long_run.of(0)))
    assert np.all((ratio > 0.6) & (ratio < 1.6))
    np.testing.assert_allclose(drawn.mean(axis=0), found.parameters, atol=0.5 * drawn.std(axis=0).max())
    assert np.sqrt(np.diag(long_run.of(0)))[0] > 1.3 * found.standard_deviation[0]  # white formulas flatter


def test_bootstrap_refuses_a_wrong_count_of_rows():
    with pytest.raises(ValueError, match="number of kept samples, 400"):
        bootstrap_blocks(_coloured_rows(0), np.ones(2), 300)


def _covered(n_seed):
    plain, robust, drawn = [], [], []
    for seed in range(n_seed):
        rows = _coloured_rows(seed)
        found, long_run = _long_run(rows)
        error = np.abs(found.parameters - TRUTH)
        plain.append(error <= 1.96 * found.standard_deviation)
        robust.append(error <= long_run.half_width(0))
        if seed < n_seed // 4:
            limits = np.quantile(bootstrap_blocks(rows, found.weights, 400, n_draw=200), [0.025, 0.975], axis=0)
            drawn.append((limits[0] <= TRUTH) & (limits[1] >= TRUTH))
    return np.mean(plain), np.mean(robust), np.mean(drawn)


def test_coverage_of_95_percent_intervals():
    plain, robust, drawn = _covered(600)
    assert plain < 0.88
    assert 0.92 <= robust <= 0.98
    assert 0.88 <= drawn <= 0.98  # percentiles of few blocks are somewhat short


def test_huber_intervals_cover_under_heavy_tails():
    inside = []
    for seed in range(100):
        rows = random_rows(n_row=500, seed=seed, noise=lambda generator: generator.standard_t(3, size=(500, 1)))
        reduction = reduce_rows(rows)
        found = huber(rows, reduction, HuberOptions())
        long_run = long_run_covariance(rows, [huber_influence(reduction, found, 1.345)], 500)
        inside.append(np.abs(found.parameters - [1.0, -2.0, 3.0]) <= long_run.half_width(0))
    assert 0.91 <= np.mean(inside) <= 0.99
