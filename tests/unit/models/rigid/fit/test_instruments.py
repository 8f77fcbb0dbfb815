"""Instrumental variables where least squares is biased: noise in the columns themselves."""

from dataclasses import replace

import numpy as np
import pytest

from rigid_models import random_rows
from robid.errors import DataError
from robid.models.rigid.fit.conclusion import instrumental_variables, solve_instruments
from robid.models.rigid.fit.options import InstrumentOptions
from robid.models.rigid.fit.regression import ordinary_least_squares, reduce_rows
from robid.models.rigid.fit.residuals import long_run_covariance
from robid.models.rigid.fit.rows import Rows

TRUTH = np.array([1.0, -2.0, 3.0])


def _noisy_rows(seed=0, n_row=4000):
    """Columns with noise that is also in the torque, as in closed loop; instruments are the true columns."""
    generator = np.random.default_rng(seed)
    true = generator.standard_normal((n_row, 1, 3))
    noise = generator.standard_normal((n_row, 1, 3))
    torque = true @ TRUTH + 0.3 * noise.sum(axis=2) + 0.1 * generator.standard_normal((n_row, 1))
    used = generator.uniform(size=torque.shape) < 0.9
    columns = true + 0.7 * noise
    half = n_row // 2
    parts = (slice(half), slice(half, None))
    return tuple(Rows(columns[part], torque[part], used[part], true[part]) for part in parts)


def test_estimate_is_consistent_where_least_squares_is_not():
    rows = _noisy_rows()
    start = ordinary_least_squares(reduce_rows(rows))
    found, influence = solve_instruments(rows, start.weights)
    assert np.abs(start.parameters - TRUTH).max() > 0.5
    assert np.all(np.abs(found.parameters - TRUTH) < 4 * found.standard_deviation)
    columns = np.concatenate([one.columns[one.used] for one in rows])
    torque = np.concatenate([one.torque[one.used] for one in rows])
    instruments = np.concatenate([one.instruments[one.used] for one in rows])
    np.testing.assert_allclose(found.parameters, np.linalg.solve(instruments.T @ columns, instruments.T @ torque))
    assert np.abs(sum(influence.of(one).sum(axis=0) for one in rows)).max() < 1e-10


def test_its_covariances_are_those_of_its_errors():
    errors, own, long_run = [], [], []
    for seed in range(120):
        rows = _noisy_rows(seed, n_row=600)
        found, influence = solve_instruments(rows, np.ones(1))
        errors.append(found.parameters - TRUTH)
        own.append(np.diag(found.covariance))
        long_run.append(np.diag(long_run_covariance(rows, [influence], 600).of(0)))
    # The residual is correlated with the columns, not with the instruments, so the plain formula holds too.
    np.testing.assert_allclose(np.var(errors, axis=0) / np.mean(own, axis=0), 1.0, atol=0.4)
    np.testing.assert_allclose(np.var(errors, axis=0) / np.mean(long_run, axis=0), 1.0, atol=0.4)


def test_iterations_simulate_until_the_parameters_stay():
    simulated = []

    def instrumented(parameters):
        """A model whose instruments are right to the degree that its parameters are."""
        simulated.append(parameters)
        error = np.abs(parameters - TRUTH).max()
        return tuple(
            Rows(one.columns, one.torque, one.used, (1 - error / 10) * one.instruments + error / 10 * one.columns)
            for one in _noisy_rows()
        )

    start = ordinary_least_squares(reduce_rows(_noisy_rows()))
    found, _, rows = instrumental_variables(instrumented, start, InstrumentOptions(tolerance=1e-3))
    assert found.status == "converged"
    assert found.iterations == len(simulated) > 2
    assert np.abs(found.parameters - TRUTH).max() < 0.1 * np.abs(start.parameters - TRUTH).max()
    assert len(rows) == 2
    few = instrumental_variables(instrumented, start, InstrumentOptions(tolerance=1e-9, iteration_limit=1))[0]
    assert few.status == "iteration_limit"


def test_rows_without_instruments_or_with_idle_ones_are_refused():
    with pytest.raises(ValueError, match="no instruments"):
        solve_instruments(random_rows(), np.ones(1))
    one = _noisy_rows()[0]
    idle = np.repeat(one.instruments[..., :1], 3, axis=2)
    with pytest.raises(ValueError, match="do not determine"):
        solve_instruments((Rows(one.columns, one.torque, one.used, idle),), np.ones(1))


def test_a_start_that_is_no_robot_is_left_on_the_way_to_known_values():
    """Least squares on badly filtered rows may have a negative inertia, whose simulation is lost."""
    asked = []

    def instrumented(parameters):
        asked.append(parameters)
        return _noisy_rows() if parameters[2] > 1 else None

    plain = ordinary_least_squares(reduce_rows(_noisy_rows()))
    lost = replace(plain, parameters=np.array([0.0, 0.0, -4.0]))
    known = np.array([1.0, 1.0, 2.0])
    found = instrumental_variables(instrumented, lost, InstrumentOptions(), known)[0]
    assert np.all(np.abs(found.parameters - TRUTH) < 4 * found.standard_deviation)
    np.testing.assert_allclose(
        asked[:4], [lost.parameters + share * (known - lost.parameters) for share in (0, 0.5, 0.8, 1)]
    )
    with pytest.raises(DataError, match="D181") as caught:
        instrumental_variables(lambda _: None, plain, InstrumentOptions(), known)
    assert "instruments: none" in caught.value.remedy
