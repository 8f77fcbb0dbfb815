"""Least squares from reduced rows against dense algebra."""

import numpy as np
import pytest

from rigid_models import random_rows, stacked, whole_rows
from robid.models.rigid.fit.regression import ordinary_least_squares, reduce_rows, residuals, weighted_least_squares
from robid.models.rigid.fit.rows import Rows
from tolerances import IDENTITY, RECOVERY


@pytest.mark.parametrize("blocks", [1, 7, 200])
def test_ordinary_least_squares_is_the_dense_one_with_the_square_that_eq_7_lacks(blocks):
    rows = random_rows(blocks=blocks, deviations=(1.0, 0.3))
    found = ordinary_least_squares(reduce_rows(rows))
    columns, torque = stacked(rows)
    expected, cost, _, _ = np.linalg.lstsq(columns, torque, rcond=None)
    covariance = cost[0] / (len(torque) - 3) * np.linalg.inv(columns.T @ columns)
    np.testing.assert_allclose(found.parameters, expected, rtol=IDENTITY)
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-8)
    assert found.condition == pytest.approx(np.linalg.cond(columns / np.linalg.norm(columns, axis=0)), rel=1e-8)
    residual = residuals(rows, found.parameters)
    np.testing.assert_allclose(residual.ravel(), torque - columns @ expected, atol=1e-12)


def test_weights_of_a_joint_are_exact_without_a_second_pass():
    rows = random_rows(deviations=(1.0, 0.05), n_row=300, blocks=3)
    found = weighted_least_squares(reduce_rows(rows))
    columns = np.concatenate([one.columns for one in rows]) * np.sqrt(found.weights)[:, None]
    torque = np.concatenate([one.torque for one in rows]) * np.sqrt(found.weights)
    expected = np.linalg.lstsq(columns.reshape(-1, 3), torque.ravel(), rcond=None)[0]
    np.testing.assert_allclose(found.parameters, expected, rtol=1e-9)
    np.testing.assert_allclose(found.deviation, [1.0, 0.05], rtol=0.15)
    np.testing.assert_allclose(found.weights, found.deviation**-2, rtol=1e-5)
    assert found.status == "converged"
    assert np.all(found.standard_deviation < ordinary_least_squares(reduce_rows(rows)).standard_deviation)


def test_columns_that_are_zero_in_a_joint_and_rows_that_are_dropped_count_for_nothing():
    (rows,) = random_rows(deviations=(0.1, 0.1))
    columns = rows.columns.copy()
    columns[:, 1, :2] = 0.0
    generator = np.random.default_rng(8)
    used = generator.uniform(size=rows.used.shape) < 0.6
    kept = (Rows(columns[:150], rows.torque[:150], used[:150]), Rows(columns[150:], rows.torque[150:], used[150:]))
    found = ordinary_least_squares(reduce_rows(kept))
    dense, torque = stacked(kept)
    np.testing.assert_allclose(found.parameters, np.linalg.lstsq(dense, torque, rcond=None)[0], rtol=1e-9)
    np.testing.assert_array_equal(found.n_row, used.sum(axis=0))


def test_parameters_return_without_noise():
    found = ordinary_least_squares(reduce_rows(random_rows(deviations=(0.0,))))
    np.testing.assert_allclose(found.parameters, [1.0, -2.0, 3.0], rtol=RECOVERY)


def test_columns_that_depend_on_each_other_are_refused():
    (rows,) = random_rows()
    twice = np.concatenate([rows.columns, rows.columns[..., :1] - rows.columns[..., 1:2]], axis=2)
    with pytest.raises(ValueError, match="base parameters"):
        ordinary_least_squares(reduce_rows(whole_rows(twice, rows.torque)))
    with pytest.raises(ValueError, match="moves no torque"):
        ordinary_least_squares(reduce_rows(whole_rows(rows.columns * [1, 0, 1], rows.torque)))
    with pytest.raises(ValueError, match="no rows"):
        reduce_rows((Rows(rows.columns, rows.torque, np.zeros_like(rows.used)),))


def test_a_joint_without_a_residual_has_no_weight():
    (rows,) = random_rows(deviations=(1.0, 1.0))
    columns, torque = rows.columns.copy(), rows.torque.copy()
    columns[:, 1], torque[:, 1] = 0.0, 0.0
    with pytest.raises(ValueError, match="no weight"):
        weighted_least_squares(reduce_rows(whole_rows(columns, torque)))
