"""A cut-off from the data: where the motion ends, and where the positions' noise begins to spoil the parameters."""

from dataclasses import replace

import numpy as np
import pytest

from rigid_logs import PERIOD_S, fourier_motion, shot_along
from rigid_robots import random_chain
from robid.models.rigid.fit.cut_off import choose_cut_off, motion_band
from robid.models.rigid.fit.fitting import fit_rigid
from robid.models.rigid.fit.options import PreprocessingOptions, RigidFitOptions
from robid.models.rigid.fit.shots import Shot
from robid.robot.regressor.base import find_base_parameters
from robid.robot.regressor.model import build_rigid_model

OPTIONS = RigidFitOptions(physical=False)


@pytest.fixture(scope="module")
def robot():
    return replace(random_chain(4, 3, slides=0.0), gravity_m_s2=np.array([0.0, 0.0, -9.81]))


@pytest.fixture(scope="module")
def model(robot):
    whole = build_rigid_model(robot)
    return whole.only(find_base_parameters(whole).columns.tolist())


def _log(robot, resolution_rad, seed=0):
    """A log whose angles are rounded to so many radians of the motors."""
    shot = shot_along(robot, fourier_motion(robot, 8000, seed=seed), noise=0.02, seed=seed)
    return replace(shot, position=np.round(shot.position / resolution_rad) * resolution_rad)


def _error_elsewhere(robot, model, shot, cut_hz):
    """Error of the torques of another motion without noise, by parameters at a cut-off, over the torques."""
    filters = PreprocessingOptions(position_cut_hz=cut_hz)
    found = fit_rigid(robot, [shot], replace(OPTIONS, filters=filters)).estimate
    assert found.names == model.names
    motion = fourier_motion(robot, 2000, seed=9) @ robot.motor_per_arm.T
    away = model.columns(*motion) @ np.array([found.value - found.nominal, found.nominal]).T
    return float(np.linalg.norm(away[..., 0]) / np.linalg.norm(away[..., 1]))


def test_the_band_of_a_motion_ends_where_its_speed_does():
    time = 1e-3 * np.arange(20_000)[:, None]
    noise = 1e-5 * np.random.default_rng(0).standard_normal((20_000, 2))
    position = np.sin(2 * np.pi * 0.5 * time) + np.array([0.0, 0.05]) * np.sin(2 * np.pi * 12 * time) + noise
    shot = Shot(position, position, 1e-3, held=False)
    for derivative in (1, 2):
        np.testing.assert_allclose(motion_band([shot], derivative), [0.5, 12.0], atol=0.3)


@pytest.mark.parametrize("resolution_rad", [1e-3, 0.03, 0.2])
def test_the_chosen_cut_off_is_as_good_as_the_best_whatever_the_encoder(robot, model, resolution_rad):
    shot = _log(robot, resolution_rad)
    choice = choose_cut_off([shot], model, OPTIONS.filters)
    found = {cut: _error_elsewhere(robot, model, shot, cut) for cut in choice.trial_hz.tolist()}
    best = min(found.values())
    assert found[choice.cut_hz] < max(1.5 * best, 2e-3)
    assert choice.motion_hz.max() <= choice.cut_hz
    if resolution_rad > 0.01:  # some cut-off lets the noise in, so that the choice counts
        assert max(found.values()) > 10 * found[choice.cut_hz]


def test_an_error_on_left_out_pieces_is_that_of_the_noise(robot, model):
    shot = _log(robot, 1e-4)
    choice = choose_cut_off([shot], model, OPTIONS.filters)
    # White noise of 2 % of the torques' deviation, of which the band of the comparison lets its share through.
    noise = 0.02 * shot.torque.std(axis=0) * np.sqrt(choice.band_hz * 2 * PERIOD_S)
    np.testing.assert_allclose(choice.left_out, noise, rtol=0.3)
    assert np.all(choice.residual < choice.left_out)


def test_candidates_can_be_given_and_one_stays_as_it_is(robot, model):
    shot = _log(robot, 1e-3)
    given = choose_cut_off([shot], model, OPTIONS.filters, (40.0, 20.0))
    assert given.trial_hz.tolist() == [20.0, 40.0]
    assert choose_cut_off([shot], model, OPTIONS.filters, (40.0,)).cut_hz == 40.0


def test_a_log_that_is_too_short_is_refused(robot, model):
    shot = _log(robot, 1e-3)
    with pytest.raises(ValueError, match="60 samples"):
        choose_cut_off([replace(shot, position=shot.position[:60], torque=shot.torque[:60])], model, OPTIONS.filters)
