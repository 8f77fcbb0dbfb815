"""Huber's estimator against its own objective, its limits, and least squares that outliers spoil."""

import numpy as np
import pytest
from scipy.optimize import linprog, minimize

from rigid_models import random_rows, stacked
from robid.models.rigid.fit.options import HuberOptions
from robid.models.rigid.fit.regression import (
    huber,
    huber_weights,
    ordinary_least_squares,
    reduce_rows,
    robust_scale,
    sweep_bend,
)
from robid.models.rigid.fit.rows import Rows
from tolerances import RECOVERY

TIGHT = HuberOptions(tolerance=1e-9, iteration_limit=1000)
TRUTH = np.array([1.0, -2.0, 3.0])


def _heavy(generator):
    return generator.standard_t(2, size=(600, 1))


def _heavy_rows(**others):
    return random_rows(n_row=600, noise=_heavy, blocks=4, **others)


def test_estimate_minimises_hubers_objective_at_its_scale():
    rows = _heavy_rows()
    found = huber(rows, reduce_rows(rows), TIGHT)
    columns, torque = stacked(rows)

    def objective(parameters):
        standard = np.abs(torque - columns @ parameters) / found.scale[0]
        return np.sum(np.where(standard < 1.345, standard**2 / 2, 1.345 * standard - 1.345**2 / 2))

    expected = minimize(objective, TRUTH, method="BFGS", options={"gtol": 1e-9})
    np.testing.assert_allclose(found.parameters, expected.x, rtol=1e-6)
    residual = torque - columns @ found.parameters
    assert found.scale[0] == pytest.approx(np.median(np.abs(residual - np.median(residual))) / 0.6745, rel=1e-6)
    assert found.status == "converged"
    assert 0.2 < found.share_down_weighted < 0.5


def test_outliers_move_huber_less_than_least_squares():
    (rows,) = random_rows(n_row=500, deviations=(0.1,))
    torque = rows.torque.copy()
    torque[::20] += 5.0 + rows.columns[::20, :, 0]
    spoiled = (Rows(rows.columns, torque, rows.used),)
    reduction = reduce_rows(spoiled)
    error = np.abs(ordinary_least_squares(reduction).parameters - TRUTH).max()
    assert np.abs(huber(spoiled, reduction).parameters - TRUTH).max() < error / 3


def test_each_joint_has_its_own_scale():
    rows = random_rows(n_row=2000, deviations=(1.0, 0.02), blocks=3)
    found = huber(rows, reduce_rows(rows))
    np.testing.assert_allclose(found.scale, [1.0, 0.02], rtol=0.1)
    np.testing.assert_allclose(found.parameters, TRUTH, atol=5 * 0.02 / np.sqrt(2000))


def test_a_wide_bend_is_least_squares_and_a_narrow_one_the_least_magnitudes():
    rows = _heavy_rows()
    reduction = reduce_rows(rows)
    narrow, wide = sweep_bend(rows, reduction, (1e-3, 1e6), HuberOptions(tolerance=1e-6, iteration_limit=3000))
    squares = ordinary_least_squares(reduction)
    np.testing.assert_allclose(wide.parameters, squares.parameters, rtol=1e-9)
    np.testing.assert_allclose(wide.covariance, squares.covariance, rtol=1e-6)
    assert wide.share_down_weighted == 0
    columns, torque = stacked(rows)
    n_row, unity = len(torque), np.eye(len(torque))
    program = linprog(
        np.r_[np.zeros(3), np.ones(2 * n_row)],
        A_eq=np.hstack([columns, unity, -unity]),
        b_eq=torque,
        bounds=[(None, None)] * 3 + [(0, None)] * (2 * n_row),
    )
    np.testing.assert_allclose(narrow.parameters, program.x[:3], atol=0.05 * squares.standard_deviation.max())


def test_covariance_of_eq_19_is_that_of_the_weighted_rows():
    rows = _heavy_rows()
    options = HuberOptions(covariance="weighted", tolerance=1e-9, iteration_limit=1000)
    found = huber(rows, reduce_rows(rows), options)
    columns, torque = stacked(rows)
    residual = torque - columns @ found.parameters
    weights = huber_weights(residual / found.scale[0], 1.345)
    spread = np.sum(weights * residual**2) / (len(torque) - 3)
    expected = spread * np.linalg.inv(columns.T @ (weights[:, None] * columns))
    np.testing.assert_allclose(found.covariance, expected, rtol=1e-5)
    assert found.deviation[0] == pytest.approx(np.sqrt(spread), rel=1e-5)


def test_asymptotic_covariance_covers_the_truth():
    errors, predicted = [], []
    for seed in range(200):
        rows = _heavy_rows(seed=seed)
        found = huber(rows, reduce_rows(rows))
        errors.append(found.parameters - TRUTH)
        predicted.append(found.standard_deviation)
    ratio = np.std(errors, axis=0) / np.mean(predicted, axis=0)
    np.testing.assert_allclose(ratio, 1.0, atol=0.15)


def test_parameters_return_without_outliers():
    rows = random_rows(n_row=500, deviations=(1e-6,))
    np.testing.assert_allclose(huber(rows, reduce_rows(rows)).parameters, TRUTH, rtol=RECOVERY)


def test_weights_fall_beyond_the_bend_and_unused_rows_have_none():
    np.testing.assert_allclose(huber_weights(np.array([0.0, -1.0, 2.69, -13.45, np.nan]), 1.345), [1, 1, 0.5, 0.1, 0])
    np.testing.assert_allclose(robust_scale(np.array([[1.0], [3.0], [np.nan], [2.0]])), 1 / 0.6745)


def test_residuals_without_a_scale_are_refused():
    (rows,) = random_rows(n_row=50, deviations=(0.0,))
    torque = rows.columns @ TRUTH
    torque[:3] += 1.0
    zero = (Rows(np.zeros_like(rows.columns) + np.eye(3)[np.arange(50) % 3][:, None], np.zeros((50, 1)), rows.used),)
    with pytest.raises(ValueError, match="no scale"):
        huber(zero, reduce_rows(zero))


def test_too_few_iterations_are_a_status():
    rows = _heavy_rows()
    assert huber(rows, reduce_rows(rows), HuberOptions(tolerance=1e-12, iteration_limit=2)).status == "iteration_limit"
