"""Causes of a bad rigid fit, each planted in a log and found by trying it."""

from dataclasses import replace

import numpy as np
import pytest

from rigid_logs import PERIOD_S, fourier_motion, shot_along
from rigid_robots import random_chain
from robid.models.rigid.fit.fitting import fit_rigid
from robid.models.rigid.fit.options import PreprocessingOptions, RigidFitOptions
from robid.models.rigid.judge.plausible import assess_rigid
from robid.models.rigid.judge.trials import try_causes

OPTIONS = RigidFitOptions(filters=PreprocessingOptions(position_cut_hz=10.0), physical=False)
N_SAMPLE = 6000


@pytest.fixture(scope="module")
def robot():
    return replace(random_chain(4, 3, slides=0.0), gravity_m_s2=np.array([0.0, 0.0, -9.81]))


@pytest.fixture(scope="module")
def shot(robot):
    return shot_along(robot, fourier_motion(robot, N_SAMPLE))


def _tried(robot, shot, options=OPTIONS):
    solution = fit_rigid(robot, [shot], options)
    return solution, try_causes(robot, [shot], solution, options)


def _plus(shot, torque):
    return replace(shot, torque=shot.torque + torque)


def _quadratic(_robot, shot):
    speed = np.gradient(shot.position, axis=0) / PERIOD_S
    return _plus(shot, 2 * shot.torque.std(axis=0) * np.abs(speed) * speed / np.abs(speed).max(axis=0) ** 2)


def _late(_robot, shot):
    return replace(shot, torque=np.roll(shot.torque, 10, axis=0))


def _balance(robot, shot):
    """What a spring does that gravity cannot: twice an angle."""
    arm = shot.position @ robot.arm_per_motor.T
    torque = np.zeros_like(shot.torque)
    torque[:, 1] = shot.torque[:, 1].std() * np.sin(2 * arm[:, 1])
    return _plus(shot, torque)


def _coarse(_robot, shot):
    return replace(shot, position=np.round(shot.position / 0.2) * 0.2)


@pytest.mark.parametrize(
    ("plant", "cause", "told", "cut_hz"),
    [
        (_quadratic, "friction", "quadratic", 10.0),
        (_late, "delay", "20 ms earlier", 10.0),
        (_balance, "counterbalance", "joint_1", 10.0),
        (_coarse, "filters", "position_cut_hz", 90.0),
    ],
)
def test_what_was_planted_is_what_gains_most(robot, shot, plant, cause, told, cut_hz):
    options = replace(OPTIONS, filters=PreprocessingOptions(position_cut_hz=cut_hz))
    solution, (first, *_) = _tried(robot, plant(robot, shot), options)
    assert first.cause == cause
    assert told in first.change
    assert first.after < 0.4 * first.before
    if solution.residuals.total_error > 0.15:
        grade = assess_rigid(robot, solution, options, tried=(first,))
        assert (grade.value, grade.causes[0]) == (0, cause)


def test_following_what_is_named_mends_the_fit(robot, shot):
    spoiled = _quadratic(robot, shot)
    before, (first, *_) = _tried(robot, spoiled)
    richer = replace(OPTIONS, model=replace(OPTIONS.model, friction="quadratic"))
    after = fit_rigid(robot, [spoiled], richer)
    assert after.residuals.total_error < 0.5 * before.residuals.total_error
    assert after.expected.left_out.max() < 2 * first.after


def test_nothing_is_named_where_all_is_well(robot, shot):
    assert _tried(robot, shot)[1] == ()
