"""Which motors of a rigid fit count: what is lost in noise is left out, and a wrong sign is told by what drives."""

from dataclasses import replace

import numpy as np
import pytest

from rigid_logs import fourier_motion, shot_along
from rigid_robots import random_chain
from robid.models.rigid.fit.fitting import fit_rigid
from robid.models.rigid.fit.options import PreprocessingOptions, RigidFitOptions
from robid.models.rigid.judge.motors import motors_of
from robid.models.rigid.judge.plausible import assess_rigid
from robid.models.rigid.judge.validating import validate_rigid
from robid.results.grade import DO_NOT_USE, PREDICTS

OPTIONS = RigidFitOptions(filters=PreprocessingOptions(position_cut_hz=10.0), physical=False)
N_SAMPLE = 5000


@pytest.fixture(scope="module")
def robot():
    return replace(random_chain(4, 3, slides=0.0), gravity_m_s2=np.array([0.0, 0.0, -9.81]))


def _names(robot):
    return [joint.name for joint in robot.joints]


def _noisy(robot, joint, noise, seed=0):
    """A log in which one motor's torque is so many times its size in noise."""
    shot = shot_along(robot, fourier_motion(robot, N_SAMPLE, seed=seed), seed=seed)
    torque = shot.torque.copy()
    drawn = np.random.default_rng(seed + 50).standard_normal(len(torque))
    torque[:, joint] += noise * torque[:, joint].std() * drawn
    return replace(shot, torque=torque)


def test_a_motor_lost_in_noise_is_not_determined_and_condemns_no_other(robot):
    shot, new = _noisy(robot, 2, 30.0), _noisy(robot, 2, 30.0, seed=8)
    solution = fit_rigid(robot, [shot], OPTIONS)
    motors = motors_of(solution, _names(robot))
    assert motors.determined.tolist() == [True, True, False]
    assert motors.left_out == ("joint_2",)
    grade = assess_rigid(robot, solution, OPTIONS)
    held = validate_rigid(robot, solution, [new], OPTIONS, grade.findings)
    assert held.relative_error[2] > 0.3
    assert held.outcome.grade.value >= PREDICTS
    # Whoever asks for that motor is told.
    asked = replace(OPTIONS, judge=("joint_2",))
    assert validate_rigid(robot, solution, [new], asked, grade.findings).outcome.grade.value == DO_NOT_USE


def test_a_motor_with_another_ones_torque_is_no_matter_of_noise(robot):
    shot = shot_along(robot, fourier_motion(robot, N_SAMPLE))
    swapped = replace(shot, torque=shot.torque[:, [1, 0, 2]])
    solution = fit_rigid(robot, [swapped], OPTIONS)
    assert motors_of(solution, _names(robot)).determined[:2].all()
    assert assess_rigid(robot, solution, OPTIONS).value == DO_NOT_USE


@pytest.mark.parametrize("turned", [(0,), (1,), (0, 1, 2)])
def test_a_torque_with_the_wrong_sign_is_named(robot, turned):
    shot = shot_along(robot, fourier_motion(robot, N_SAMPLE))
    sign = np.where(np.isin(np.arange(3), turned), -1.0, 1.0)
    found = assess_rigid(robot, fit_rigid(robot, [replace(shot, torque=sign * shot.torque)], OPTIONS), OPTIONS)
    accused = [finding.message for finding in found.findings if finding.cause == "torque_sign"]
    assert len(accused) == 1
    assert found.value == DO_NOT_USE
    assert accused[0].startswith("all motors" if len(turned) > 1 else f"joint_{turned[0]}:")


def test_a_rough_file_accuses_no_sign(robot):
    shot = shot_along(robot, fourier_motion(robot, N_SAMPLE))
    heavy = robot.payload
    off = replace(robot, payload=replace(heavy, com_m=-heavy.com_m, mass_kg=3 * heavy.mass_kg))
    solution = fit_rigid(off, [shot], OPTIONS)
    assert solution.against_nominal.likeness.min() < 0.5  # the file speaks of something else
    grade = assess_rigid(off, solution, OPTIONS)
    assert "torque_sign" not in grade.causes
    new = shot_along(robot, fourier_motion(robot, N_SAMPLE, seed=8))
    assert validate_rigid(off, solution, [new], OPTIONS, grade.findings).outcome.grade.value >= PREDICTS
