"""Which motors of a rigid fit count: what is lost in noise is left out, and a wrong sign is told by what drives."""

from dataclasses import replace

import numpy as np
import pytest

from rigid_logs import fourier_motion, shot_along, with_masses
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


def _rubbing(robot, joint, seed, sign=1.0, friction=20.0):
    """A log in which friction of one motor is much larger than the torque of its links, with some noise."""
    shot = shot_along(robot, fourier_motion(robot, N_SAMPLE, seed=seed), seed=seed)
    torque, speed = shot.torque.copy(), np.gradient(shot.position[:, joint])
    drawn = np.random.default_rng(seed + 90).standard_normal(len(torque))
    size = torque[:, joint].std()
    torque[:, joint] += size * (friction * speed / speed.std() + 0.5 * drawn)
    torque[:, joint] *= sign
    return replace(shot, torque=torque)


def test_a_sign_that_differs_between_records_is_no_matter_of_noise(robot):
    same = [_rubbing(robot, 2, seed) for seed in (0, 1)]
    assert "channels" not in assess_rigid(robot, fit_rigid(robot, same, OPTIONS), OPTIONS).causes
    mixed = [same[0], _rubbing(robot, 2, 1, sign=-1.0)]
    solution = fit_rigid(robot, mixed, OPTIONS)
    assert motors_of(solution, _names(robot)).judged.all()
    grade = assess_rigid(robot, solution, OPTIONS)
    assert grade.value == DO_NOT_USE
    assert grade.causes[0] == "channels"


def test_a_torque_that_goes_with_another_joint_is_no_matter_of_noise(robot):
    shot = _rubbing(robot, 1, 0)
    other = _rubbing(robot, 2, 0)
    torque = shot.torque.copy()
    torque[:, 1], torque[:, 2] = other.torque[:, 2], shot.torque[:, 1]
    solution = fit_rigid(robot, [replace(shot, torque=torque)], OPTIONS)
    assert motors_of(solution, _names(robot)).judged.all()
    grade = assess_rigid(robot, solution, OPTIONS)
    assert grade.value == DO_NOT_USE
    assert grade.causes[0] == "channels"


def test_what_is_not_judged_is_left_out_of_the_error_that_is_told(robot):
    solution = fit_rigid(robot, [_noisy(robot, 2, 30.0)], OPTIONS)
    held = validate_rigid(robot, solution, [_noisy(robot, 2, 30.0, seed=8)], OPTIONS)
    error = held.prediction.measured - held.prediction.predicted
    whole = np.sqrt((error[:, :2] ** 2).sum() / (held.prediction.measured[:, :2] ** 2).sum())
    assert whole < 0.1 < held.total_error
    assert f"{whole:.2g}" in held.outcome.verdict


def _rotors(robot, factor):
    joints = (
        replace(one, motor=replace(one.motor, inertia_kgm2=factor * one.motor.inertia_kgm2)) for one in robot.joints
    )
    return replace(robot, joints=tuple(joints))


@pytest.mark.parametrize("factor", [1.0, 4.0, 8.0])
def test_rotors_that_the_file_has_too_large_are_no_sensors_behind_gears(robot, factor):
    motion = fourier_motion(robot, N_SAMPLE)
    rough = _rotors(robot, factor)
    assert (
        "torque_sensor"
        not in assess_rigid(rough, fit_rigid(rough, [shot_along(robot, motion)], OPTIONS), OPTIONS).causes
    )
    behind = shot_along(_rotors(robot, 0.0), motion)
    grade = assess_rigid(rough, fit_rigid(rough, [behind], OPTIONS), OPTIONS)
    assert (grade.value, grade.causes[0]) == (DO_NOT_USE, "torque_sensor")


def test_a_gear_ratio_that_the_file_assumes_is_named_before_its_masses(robot):
    shot = shot_along(with_masses(robot, [30.0] * 3), fourier_motion(robot, N_SAMPLE))
    new = shot_along(with_masses(robot, [30.0] * 3), fourier_motion(robot, N_SAMPLE, seed=8))
    assumed = replace(robot, assumed=tuple(f"{one.name}.motor.gear_ratio" for one in robot.joints))
    solution = fit_rigid(assumed, [shot], OPTIONS)
    grade = assess_rigid(assumed, solution, OPTIONS)
    assert (grade.value, grade.causes[0]) == (DO_NOT_USE, "gear_ratio")
    assert "gear_ratio" not in assess_rigid(robot, solution, OPTIONS).causes
    # What predicts new motions is not condemned by the file.
    held = validate_rigid(assumed, solution, [new], OPTIONS, grade.findings)
    assert held.outcome.grade.value >= PREDICTS
