"""The least delay with which motors are passive, for drives whose delay is known."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot, two_mass_robot
from robid.frf.quality import driving_points, undeclared_delay

FREQUENCY_HZ = np.geomspace(2, 120, 60)  # around the antiresonance and the resonance of the drive
STEP_S = 1 / 72 / 120
TEN_DEGREES_S = 1 / 36 / 120


def drive(delay_s, *, hold="zoh", noise=0.0, damping=0.01):
    robot = two_mass_robot(damping=damping)
    place = np.zeros((1, 1))
    frf = exact_frf(robot, place, FREQUENCY_HZ, delay_s=delay_s, torque_hold=hold, relative_noise=noise)
    return driving_points(frf)


@pytest.mark.parametrize("hold", ["zoh", "band_limited"])
@pytest.mark.parametrize("delay_s", [5e-3, 23e-3, 60e-3])
def test_the_least_delay_is_the_true_one_but_for_ten_degrees(delay_s, hold):
    found = undeclared_delay(drive(delay_s, hold=hold, noise=0.01), 0.0)
    assert delay_s - TEN_DEGREES_S - STEP_S <= found <= delay_s + STEP_S


@pytest.mark.parametrize("damping", [0.01, 0.5])
def test_a_reversed_sign_is_no_delay(damping):
    points = drive(1e-3, damping=damping)
    assert undeclared_delay(replace(points, response=-points.response), 0.0) is None


def test_half_of_the_motors_decide():
    points = drive(23e-3)
    noise = np.exp(2j * np.pi * np.random.default_rng(1).random(points.response.shape))
    both = replace(points, response=np.concatenate([points.response, noise], axis=-1))
    assert undeclared_delay(both, 0.0) == undeclared_delay(points, 0.0)


def test_too_few_lines_or_too_narrow_a_band_or_too_much_noise_tell_nothing():
    points = drive(23e-3)
    for seen in (np.arange(60) < 9, FREQUENCY_HZ > 40, np.zeros(60, bool)):
        ratio = np.where(seen, 1e6, 1.0)[None, :, None]
        assert undeclared_delay(replace(points, signal_to_noise=ratio), 0.0) is None


@pytest.mark.parametrize("seed", range(5))
def test_noise_makes_no_delay(seed):
    points, generator = drive(1e-3), np.random.default_rng(seed)
    error = generator.standard_normal((2, *points.response.shape)) / np.sqrt(2)
    for ratio in (3.0, 10.0, 30.0):
        moved = points.response * (1 + (error[0] + 1j * error[1]) / np.sqrt(ratio))
        known = np.full(points.response.shape, ratio)
        assert undeclared_delay(replace(points, response=moved, signal_to_noise=known), 0.0) is None


def test_only_more_than_a_few_samples_beyond_the_declared_are_missing():
    assert undeclared_delay(drive(23e-3), 0.0) == pytest.approx(23e-3, abs=2 * TEN_DEGREES_S)
    assert undeclared_delay(drive(23e-3), 21e-3) is None
    assert undeclared_delay(drive(2e-3), 0.0) is None


def test_motors_whose_angles_are_not_there_tell_nothing():
    robot = two_joint_robot()
    frf = exact_frf(robot, np.zeros((1, 2)), FREQUENCY_HZ, delay_s=0.02, output_names=("shoulder.arm", "elbow.arm"))
    assert undeclared_delay(driving_points(frf), 0.0) is None
