"""Errors that a rigid fit expects on other motions, what they are related to, and how far torque constants reach."""

from dataclasses import replace

import numpy as np
import pytest

from rigid_logs import fourier_motion, shot_along
from rigid_robots import random_chain
from robid.models.rigid.fit.expected import Known, expected_error, random_motion
from robid.models.rigid.fit.fitting import fit_rigid
from robid.models.rigid.fit.options import PreprocessingOptions, RigidFitOptions
from robid.models.rigid.fit.shots import travel_of
from robid.models.rigid.fit.sizes import rated_torques
from robid.robot.regressor.model import build_rigid_model

OPTIONS = RigidFitOptions(filters=PreprocessingOptions(position_cut_hz=10.0), physical=False)
N_SAMPLE = 3000


@pytest.fixture(scope="module")
def robot():
    return replace(random_chain(4, 3, slides=0.0), gravity_m_s2=np.array([0.0, 0.0, -9.81]))


def _with_motors(robot, **by_joint):
    pairs = [zip(by_joint, values, strict=True) for values in zip(*by_joint.values(), strict=True)]
    joints = zip(robot.joints, pairs, strict=True)
    return replace(robot, joints=tuple(replace(j, motor=replace(j.motor, **dict(own))) for j, own in joints))


def _poor(robot, seed):
    return shot_along(robot, fourier_motion(robot, N_SAMPLE, seed=seed, share=0.05), noise=0.05, seed=seed)


def _model(robot, names):
    whole = build_rigid_model(robot, OPTIONS.model)
    return whole.only([whole.names.index(name) for name in names])


def test_rated_torques_are_the_files_or_those_of_motors_of_that_size(robot):
    rms = np.array([1.0, 0.2, 3.0])
    sized = _with_motors(robot, max_torque_nm=[10.0, 12.0, 100.0], rated_torque_nm=[None, None, None])
    found = rated_torques(sized, rms)
    assert found.torque_nm.tolist() == [1.0, 1.0, 3.0]
    assert not found.stated.any()
    stated = rated_torques(_with_motors(sized, rated_torque_nm=[None, 5.0, None]), rms)
    assert stated.torque_nm.tolist() == [1.0, 5.0, 3.0]
    assert stated.stated.tolist() == [False, True, False]
    assert stated.size(rms).tolist() == [1.0, 0.5, 3.0]
    unlimited = _with_motors(robot, max_torque_nm=[np.inf] * 3, inertia_kgm2=[1e-4, 1e-3, 1.1e-3])
    assert rated_torques(unlimited, rms).torque_nm.tolist() == [1.0, 3.0, 3.0]


def test_without_uncertain_parameters_the_expected_error_is_what_is_left(robot):
    solution = fit_rigid(robot, [_poor(robot, 0)], OPTIONS)
    certain = Known(solution.estimate.value, 0 * solution.estimate.covariance, np.inf)
    left, size = np.array([0.1, 0.2, 0.3]), np.array([1.0, 4.0, 2.0])
    error, bound = expected_error(robot, _model(robot, solution.estimate.names), certain, solution.travel, left, size)
    np.testing.assert_allclose(error, left / size)
    np.testing.assert_allclose(bound, left / size)


def test_the_expected_error_is_that_of_the_covariance_along_random_motions(robot):
    solution = fit_rigid(robot, [_poor(robot, 0)], OPTIONS)
    gaussian = Known(solution.estimate.value, solution.estimate.covariance, np.inf)
    model, size = _model(robot, solution.estimate.names), np.array([1.0, 4.0, 2.0])
    error, bound = expected_error(robot, model, gaussian, solution.travel, np.zeros(3), size)
    generator = np.random.default_rng(77)
    off = generator.multivariate_normal(np.zeros(len(gaussian.value)), gaussian.covariance, 200)
    motions = [model.columns(*random_motion(robot, solution.travel, generator)) for _ in range(200)]
    wanted = np.mean([np.sqrt(((rows @ away) ** 2).mean(axis=0)) for rows, away in zip(motions, off, strict=True)], 0)
    np.testing.assert_allclose(error, wanted / size, rtol=0.25)
    assert np.all((bound > 1.3 * error) & (bound < 5 * error))


def test_errors_of_parameters_that_a_poor_motion_hardly_tells_apart_cancel_in_what_is_expected(robot):
    expected, found = [], []
    for seed in range(8):
        shot = shot_along(robot, fourier_motion(robot, N_SAMPLE, seed=0, share=0.05), noise=0.05, seed=seed)
        solution = fit_rigid(robot, [shot], OPTIONS)
        model, generator = _model(robot, solution.estimate.names), np.random.default_rng(100 + seed)
        away = solution.estimate.value - solution.estimate.nominal
        rows = [model.columns(*random_motion(robot, solution.travel, generator)) for _ in range(12)]
        rms = np.sqrt(np.nanmean(solution.residuals.torque**2, axis=0))
        found.append(np.mean([np.sqrt(((each @ away) ** 2).mean(axis=0)) for each in rows], axis=0) / rms)
        expected.append(solution.expected.error)
    ratio = np.mean(expected, axis=0) / np.mean(found, axis=0)
    assert np.all((ratio > 0.6) & (ratio < 1.7))


def test_random_motions_stay_within_the_limits(robot):
    travel = travel_of(robot, [_poor(robot, 0)])
    for seed in range(20):
        position, *_ = random_motion(robot, travel, np.random.default_rng(seed))
        arm = position @ robot.arm_per_motor.T
        assert np.all((arm >= robot.lower - 1e-9) & (arm <= robot.upper + 1e-9))


def test_the_bound_holds_on_motions_that_were_not_fitted(robot):
    within = []
    for seed in range(12):
        solution = fit_rigid(robot, [_poor(robot, seed)], OPTIONS)
        model, generator = _model(robot, solution.estimate.names), np.random.default_rng(100 + seed)
        rows = np.concatenate([model.columns(*random_motion(robot, solution.travel, generator)) for _ in range(4)])
        away = solution.estimate.value - solution.estimate.nominal
        rms = np.sqrt(np.nanmean(solution.residuals.torque**2, axis=0))
        error = np.sqrt(((rows @ away) ** 2).mean(axis=0)) / rms
        within += (error <= solution.expected.bound).tolist()
    assert np.mean(within) > 0.85


def test_a_torque_constant_that_is_off_lies_inside_the_interval_of_masses_not_of_what_predicts(robot):
    shot = shot_along(robot, fourier_motion(robot, N_SAMPLE), noise=0.02)
    exact = fit_rigid(robot, [shot], OPTIONS).estimate
    move = 1e-3
    moved = [
        (
            fit_rigid(robot, [replace(shot, torque=shot.torque * (1 + move * unit))], OPTIONS).estimate.value
            - exact.value
        )
        / move
        for unit in np.eye(3)
    ]
    std = [joint.nuisance_std.torque_relative_std for joint in robot.joints]
    wanted = np.sqrt(np.sum((np.array(std)[:, None] * moved) ** 2, axis=0))
    reach = exact.effective_upper - exact.value
    found = np.sqrt((exact.upper - exact.value) ** 2 - reach**2) / 1.96
    # Weights change with the torques as well, which the linear measure leaves out.
    np.testing.assert_allclose(found, wanted, rtol=0.1, atol=0.02 * wanted.max())
    assert np.all(exact.upper - exact.value >= reach)
