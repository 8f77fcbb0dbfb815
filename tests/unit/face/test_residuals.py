"""The residual of a fit: against the closed covariance of noise, and the model of the data that it was fitted to."""

from dataclasses import replace

import numpy as np
import pytest

import robid
from exact_systems import exact_frf, two_joint_robot, with_spring_factors
from robid.results.residual import scaled_by_group, whitened_responses

PLACES = np.random.default_rng(3).uniform(-1, 1, (3, 2))
LINES = np.geomspace(3.0, 60.0, 12)
FREE = {"free": ("stiffness", "damping", "delay"), "correct_torques": False}


def positive(rng, *shape):
    root = rng.normal(size=shape) + 1j * rng.normal(size=shape)
    return root @ np.swapaxes(root.conj(), -1, -2) + np.eye(shape[-1])


def test_whitened_errors_of_a_structured_covariance_are_independent_and_of_unit_variance():
    rng = np.random.default_rng(4)
    output, given, scale = positive(rng, 1, 1, 3, 3), positive(rng, 1, 1, 2, 2), rng.uniform(0.5, 3, (1, 3, 2))
    # The covariance of vec(error), columns stacked, as the class of responses states it.
    root = np.sqrt(scale[0].T.ravel())
    whole = np.linalg.cholesky(np.kron(given[0, 0], output[0, 0]) * np.outer(root, root))
    drawn = (rng.normal(size=(200_000, 6)) + 1j * rng.normal(size=(200_000, 6))) / np.sqrt(2)
    error = np.swapaxes((drawn @ whole.T).reshape(-1, 2, 3), 1, 2)[None]
    white = whitened_responses(error, output, given, scale[:, None])[0].transpose(0, 2, 1).reshape(-1, 6)
    covariance = white.T @ white.conj() / len(white)
    np.testing.assert_allclose(covariance, np.eye(6), atol=6 / np.sqrt(len(white)))


def test_rows_are_scaled_within_their_group():
    rng = np.random.default_rng(5)
    group = np.repeat(["a", "b"], 500)
    values = rng.normal(size=1000) * np.repeat([1.0, 50.0], 500)
    for name in "ab":
        assert np.mean(scaled_by_group(values, group)[group == name] ** 2) == pytest.approx(1)


@pytest.mark.parametrize(("hold", "period_s"), [("zoh", 2e-3), ("band_limited", 2e-3)])
def test_a_fitted_robot_answers_as_its_data_were_sampled(hold, period_s):
    robot = robid.RobotModel(two_joint_robot(), 1e-3, 0.5e-3)
    truth = with_spring_factors(robot.description, 1.2, 0.8)
    timing = {"sampling_period_s": period_s, "torque_hold": hold, "delay_s": 1.5e-3}
    measured = exact_frf(truth, PLACES, LINES, **timing, relative_noise=1e-4)
    fit = robid.fit_model("elastic", robot, measured, **FREE, delay_s=1e-3)
    found = robot.with_fit(fit)
    assert found.sampling_period_s == period_s
    assert found.delay_s == pytest.approx(1.5e-3, rel=0.02)
    distance = np.abs(found.response(PLACES, LINES) / measured.response - 1)
    assert np.median(distance) < 5e-3
    # What the robot file says of its controller is another robot's timing.
    other = replace(found, sampling_period_s=1e-3, delay_s=0.5e-3, held=True)
    assert np.median(np.abs(other.response(PLACES, LINES) / measured.response - 1)) > 0.02


def test_the_residual_of_a_right_model_is_noise_of_unit_variance():
    robot = robid.RobotModel(two_joint_robot(), 1e-3)
    measured = exact_frf(robot.description, PLACES, LINES, relative_noise=0.01)
    fit = robid.fit_model("elastic", robot, measured, free=("stiffness", "damping"), correct_torques=False)
    left = fit.residual
    np.testing.assert_allclose(left.values, measured.response - left.model)
    assert left.axes == ("configuration", "frequency", "output", "input")
    power = np.mean(np.abs(left.whitened) ** 2)
    assert power == pytest.approx(1, abs=4 / np.sqrt(left.whitened.size))
    assert "configuration 3" in repr(left)
