"""Rows of motors that stand still do not count, and rounded positions are no motion."""

from dataclasses import replace

import numpy as np
import pytest

from rigid_logs import PERIOD_S, fourier_motion, shot_along
from rigid_robots import random_chain
from robid.models.rigid.fit.cut_off import motion_band
from robid.models.rigid.fit.fitting import fit_rigid
from robid.models.rigid.fit.options import PreprocessingOptions, RigidFitOptions
from robid.robot.regressor.drives import RigidOptions

N_SAMPLE, N_JOINT = 4000, 2
COULOMB = (3.0, 2.0)


@pytest.fixture(scope="module")
def robot():
    chain = random_chain(5, N_JOINT, slides=0.0)
    joints = tuple(
        replace(
            joint,
            motor=replace(joint.motor, friction=replace(joint.motor.friction, coulomb_nm=coulomb)),
        )
        for joint, coulomb in zip(chain.joints, COULOMB, strict=True)
    )
    return replace(chain, joints=joints)


def _stopping(robot, share, seed=0):
    """A log that moves, comes to rest for a share of it, and then carries by friction what gravity does not ask."""
    moving = fourier_motion(robot, N_SAMPLE, seed=seed)
    n_rest = int(share / (1 - share) * N_SAMPLE)
    last = np.stack([moving[0, -1], np.zeros(N_JOINT), np.zeros(N_JOINT)])
    shot = shot_along(robot, np.concatenate([moving, np.repeat(last[:, None], n_rest, axis=1)], axis=1), seed=seed)
    torque = shot.torque.copy()
    torque[N_SAMPLE:] += 0.9 * np.array(COULOMB)
    position = shot.position + 1e-6 * np.random.default_rng(seed + 9).standard_normal(shot.position.shape)
    return replace(shot, position=position, torque=torque)


def _options(**filters):
    model = RigidOptions(friction="coulomb")
    return RigidFitOptions(filters=PreprocessingOptions(position_cut_hz=10.0, **filters), model=model, physical=False)


def _coulomb(estimate):
    return {name: estimate.value[index] for index, name in enumerate(estimate.names) if name.endswith("coulomb")}


@pytest.mark.parametrize("share", [0.3, 0.6])
def test_friction_is_that_of_the_motion_however_long_the_robot_stands(robot, share):
    shot = _stopping(robot, share)
    found = _coulomb(fit_rigid(robot, [shot], _options()).estimate)
    kept = _coulomb(fit_rigid(robot, [shot], _options(drop_rest=False)).estimate)
    assert list(found.values()) == pytest.approx(COULOMB, rel=0.02)
    assert list(kept.values()) != pytest.approx(COULOMB, rel=0.1)


def test_rows_at_rest_are_left_out_and_no_others(robot):
    rows = fit_rigid(robot, [_stopping(robot, 0.4)], _options()).residuals
    used, moving = np.isfinite(rows.torque), rows.time_s < N_SAMPLE * PERIOD_S - 1.0
    assert used[moving].mean() > 0.97
    assert not used[rows.time_s > N_SAMPLE * PERIOD_S + 0.5].any()
    without = _options()
    without = replace(without, model=RigidOptions(friction="viscous"))
    assert np.isfinite(fit_rigid(robot, [_stopping(robot, 0.4)], without).residuals.torque).all()


def test_a_motor_that_rests_throughout_a_record_keeps_its_rows(robot):
    shots = [_stopping(robot, 0.3), _stopping(robot, 0.3, seed=1)]
    position = shots[1].position.copy()
    position[:, 1] = position[0, 1]
    still = [shots[0], replace(shots[1], position=position)]
    rows = fit_rigid(robot, still, _options()).residuals
    assert np.isfinite(rows.torque[rows.shot == 1, 1]).all()


@pytest.mark.parametrize("step", [0.003, 0.1, 0.3, 1.0])
def test_rounded_positions_are_no_motion(robot, step):
    """Of three steps per sample down to a tenth of one."""
    shot = shot_along(robot, fourier_motion(robot, N_SAMPLE))
    rounded = replace(shot, position=step * np.round(shot.position / step))
    assert np.abs(np.diff(shot.position, axis=0)).mean() > 0.03 * step
    assert motion_band([rounded]) == pytest.approx(motion_band([shot]), rel=0.3)
    options = RigidFitOptions(model=RigidOptions(friction="coulomb"), physical=False)
    assert fit_rigid(robot, [rounded], options).residuals.total_error < 0.1
