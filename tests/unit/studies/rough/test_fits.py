"""True errors of motors, and what becomes of data that are refused."""

from dataclasses import replace

import numpy as np
import pytest

from rigid_logs import PERIOD_S, fourier_motion, shot_along, with_masses
from rigid_robots import random_chain
from robid.models.rigid.fit.fitting import fit_rigid
from robid.models.rigid.fit.options import PreprocessingOptions, RigidFitOptions
from robid.models.rigid.fit.shots import Shot
from robid.models.rigid.judge.scales import Motions
from robid.signals.quantities import motor_channels
from robid.studies.rough.fits import OPTIONS, Judge, judged, motor_errors

LIMIT = RigidFitOptions(filters=PreprocessingOptions(position_cut_hz=10.0), physical=False, instruments="none")
BAND_HZ = 10.0


@pytest.fixture(scope="module")
def robot():
    return replace(random_chain(4, 3, slides=0.0), gravity_m_s2=np.array([0.0, 0.0, -9.81]))


@pytest.fixture(scope="module")
def solution(robot):
    return fit_rigid(robot, [shot_along(robot, fourier_motion(robot, 5000), noise=0.0)], LIMIT)


@pytest.fixture(scope="module")
def new(robot):
    return shot_along(robot, fourier_motion(robot, 4000, seed=5), noise=0.0)


def test_errors_are_relative_to_the_torque_or_to_a_tenth_of_the_rated_one(robot, solution, new):
    none = np.zeros(3)
    exact = motor_errors(robot, solution, [new], none, BAND_HZ, OPTIONS.model)
    assert exact.max() < 0.02  # what filters leave of the steps of friction
    # Torques that are a quarter too large: off by a fifth of themselves.
    more = replace(new, torque=1.25 * new.torque)
    assert motor_errors(robot, solution, [more], none, BAND_HZ, OPTIONS.model) == pytest.approx([0.2] * 3, abs=0.02)
    size = np.sqrt(np.mean(more.torque**2, axis=0))
    rated = np.array([0.0, 20.0, 5.0]) * size  # a tenth is twice and half of the torque
    found = motor_errors(robot, solution, [more], rated, BAND_HZ, OPTIONS.model)
    assert found == pytest.approx([0.2, 0.1, 0.2], abs=0.02)


def test_another_robot_is_not_explained(robot, solution):
    other = shot_along(with_masses(robot, (1.0, 1.0, 3.0)), fourier_motion(robot, 4000, seed=5), noise=0.0)
    assert motor_errors(robot, solution, [other], np.zeros(3), BAND_HZ, OPTIONS.model).max() > 0.3


def test_refused_data_have_no_error_and_are_not_to_be_used(robot, new):
    channels = motor_channels([joint.name for joint in robot.joints], "angle")
    judge = Judge(robot, np.ones(3), Motions(channels, np.arange(3), ()), [new], BAND_HZ)
    still = Shot(np.zeros((4000, 3)), new.torque, PERIOD_S, held=False)
    said = judged(judge, [still])
    assert said.grade == 0
    assert "D187" in said.sentence
    assert np.isnan(said.error).all()
    assert np.isnan(said.bound).all()
