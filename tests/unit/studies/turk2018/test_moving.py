"""The travelling slide: the true drive linearised wherever it is, known errors, eq. 20 without distortion."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import ball_screw, two_joint_robot
from robid.errors import DataError
from robid.frf.estimate import estimate_frf
from robid.frf.options import EstimateOptions
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response
from robid.signals.quantities import Channel, motor_channels
from robid.signals.record import Record
from robid.signals.waveforms import multisine, time_signal
from robid.simulate.experiment import SimulatedExperiment, simulate
from robid.simulate.options import Controller, Imperfections, SimulateOptions, Truth
from robid.simulate.truth import TrueRobot
from robid.studies.turk2018.moving import (
    Travelled,
    deviation,
    drive_amplitudes,
    freeze_drive,
    measured_amplitudes,
    split_errors,
    total_over_noise,
    travel_figures,
)

STEP, COUNT = 2.5e-4, 4096
LINES = np.arange(11, 150, 2)
OUTPUTS = ("rail", "rail.arm")
LOOP = Controller(sampling_period_s=STEP, position_gain_1_s=12.0, speed_bandwidth_hz=25.0, integral_time_s=0.4)


def truth_of(robot, **truth):
    return TrueRobot(robot, Truth(**truth), Imperfections(), STEP * LOOP.delay_samples, 1, 2)


def excitation(rms=1.0, n_real=1):
    phase = np.random.default_rng(1).uniform(0, 2 * np.pi, (n_real, 1, LINES.size))
    return time_signal(multisine(np.full((1, LINES.size), rms * np.sqrt(2 / LINES.size)), phase), LINES, COUNT)


@pytest.fixture(scope="module")
def travelling():
    """A slide that travels over 0.3 m without friction and without noise."""
    robot = ball_screw(viscous=0.02)
    way = 0.15 * robot.gear_ratio[0] * np.sin(2 * np.pi * np.arange(COUNT) / COUNT)
    reference = excitation()
    options = SimulateOptions(transient_periods=4, steps_per_sample=1)
    none = np.zeros(0, int)
    experiment = SimulatedExperiment(
        robot, LOOP, options, reference, "torque", LINES, none, 2, OUTPUTS[1:], way[:, None]
    )  # fmt: skip
    record = simulate(experiment, np.array([0.05]), 0)
    motion = record.outputs[0, 0, 0]
    return record.inputs[0, 0, 0, ..., 0], motion, motion[..., 1] + record.output_offset[0, 1]


def error_of(drive, torque, motion, position):
    measured = measured_amplitudes(motion, LINES)
    error = split_errors(measured - drive_amplitudes(drive, torque, position, LINES))
    return deviation(error.total) / deviation(split_errors(measured).total)


def test_the_true_drive_explains_a_travel_that_nothing_else_disturbs(travelling):
    torque, motion, position = travelling
    assert np.ptp(position) > 0.28
    truth = truth_of(ball_screw(viscous=0.02))
    drive = freeze_drive(truth, OUTPUTS, position.min(), position.max(), STEP)
    assert error_of(drive, torque, motion, position).max() < 3e-4
    standing = np.full_like(position, position.mean())
    assert error_of(drive, torque, motion, standing).min() > 0.015


def test_a_softer_drive_does_not(travelling):
    torque, motion, position = travelling
    robot = ball_screw(viscous=0.02)
    softer = replace(robot, springs=tuple(replace(one, stiffness=0.9 * one.stiffness) for one in robot.springs))
    drive = freeze_drive(truth_of(softer), OUTPUTS, position.min(), position.max(), STEP)
    assert error_of(drive, torque, motion, position).min() > 0.02


def test_standing_still_it_has_the_response_of_the_linearised_robot():
    robot, place = ball_screw(viscous=0.02), 0.1
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, np.array([[place]])), OUTPUTS)
    omega = 2 * np.pi * LINES / (COUNT * STEP)
    wanted = response(linear, nominal_parameters(robot, linear, STEP), omega / (2 * np.pi), STEP).sampled[0, :, :, 0]
    torque = np.repeat(excitation()[0, 0, None, :, 0], 2, axis=0)
    drive = freeze_drive(truth_of(robot, torque_constant_factor={"rail": 2.0}), OUTPUTS, 0.0, 0.2, STEP)
    found = drive_amplitudes(drive, torque, np.full_like(torque, place), LINES)
    given = measured_amplitudes(torque[..., None], LINES)
    recorded = 2.0 * wanted / -(omega[:, None] ** 2)
    error = np.linalg.norm(found[1] / given[1] - recorded, axis=0) / np.linalg.norm(recorded, axis=0)
    assert error.max() < 1e-3


def test_drives_that_do_not_rest_alike_everywhere_are_refused():
    for robot in (two_joint_robot(), replace(ball_screw(), gravity_m_s2=9.81 * ball_screw().joints[0].rotation[:, 2])):
        with pytest.raises(DataError, match="D223"):
            freeze_drive(truth_of(robot), OUTPUTS, -0.1, 0.1, STEP)


def travelled(fitted, unmoved=3.0):
    """Errors of 2 at half of the lines that repeat, of the true drive 1, noise aside."""
    generator = np.random.default_rng(3)
    shape = (7, 2000, 2)
    noise = 0.1 * generator.standard_normal((*shape, 2)) @ np.array([1, 1j])
    measured = 10 * np.ones(shape) + noise
    true = measured - noise - 1.0
    return Travelled(
        np.linspace(10, 150, 2000), ("motor", "slide"), ("rad", "m"), measured,
        measured - noise - fitted, measured - noise - unmoved, true,
    )  # fmt: skip


def test_figures_of_known_errors():
    figures = travel_figures(travelled(np.array([1.1, 2.0])), np.array([2.9, 2.58]))
    assert figures["global.ratio_mismatch_percent"] == figures["global.ratio_mismatch_percent.slide"]
    size = np.sqrt(0.02)
    wanted = {
        "ratio_mismatch_percent.motor": 100 * (np.hypot(1.1, size) / np.hypot(1, size) - 1),
        "ratio_mismatch_percent.slide": 100 * (np.hypot(2, size) / np.hypot(1, size) - 1),
        "acceleration_mismatch_percent.slide": 100 * (np.hypot(2, size) / np.hypot(1, size) - 1),
        "unmoved_mismatch_percent.motor": 100 * (np.hypot(3, size) / np.hypot(1, size) - 1),
        "error_percent.slide": 10 * np.hypot(2, size),
        "true_error_percent.motor": 10 * np.hypot(1, size),
        "error_over_stochastic.slide": np.hypot(2, size) / size * np.sqrt(7 / 6),
        "true_error_over_stochastic.motor": np.hypot(1, size) / size * np.sqrt(7 / 6),
        "total_over_noise.motor": 2.9,
    }
    for name, value in wanted.items():
        assert figures[f"global.{name}"] == pytest.approx(value, rel=0.02), name


def test_accelerations_weigh_the_fast_lines():
    slow = np.where(np.arange(2000) < 200, 4.0, 1.0)[:, None]
    found = travel_figures(travelled(slow), np.zeros(2))
    assert found["global.ratio_mismatch_percent.motor"] > 40
    assert abs(found["global.acceleration_mismatch_percent.motor"]) < 1


def test_an_unstable_model_reaches_nothing():
    figures = travel_figures(travelled(np.nan), np.zeros(2))
    assert np.isnan(figures["global.ratio_mismatch_percent"])
    assert np.isfinite(figures["global.true_error_percent.motor"])


@pytest.mark.parametrize(("distortion", "wanted"), [(0.0, 0.5), (3.0, np.sqrt(9 + 0.25))])
def test_total_over_noise_without_distortion_is_that_of_averaging(distortion, wanted):
    """Of noise alone `1 / sqrt(P)`; what differs from realization to realization comes on top."""
    frf = estimate_frf(noisy_record(distortion), EstimateOptions(estimator="indirect", compensation="none"))
    found = total_over_noise(frf, ("rail.arm", "rail"), 4)
    np.testing.assert_allclose(found, wanted, rtol=0.1)


def noisy_record(distortion, n_real=12):
    """Realizations of four periods: outputs are the torque with noise, and another distortion each."""
    generator = np.random.default_rng(5)
    reference = excitation(1.0, n_real)[None]
    inputs = np.repeat(reference[:, :, :, None], 4, axis=3)
    shape = (*inputs.shape[:-1], 2)
    each = generator.standard_normal((*shape[:3], 1, *shape[4:]))
    return Record(
        sampling_period_s=STEP,
        inputs=inputs,
        outputs=inputs + 0.01 * (generator.standard_normal(shape) + distortion * each),
        output_offset=np.zeros((1, 2)),
        input_channels=motor_channels(OUTPUTS[:1], "torque"),
        output_channels=(*motor_channels(OUTPUTS[:1], "angle"), Channel(OUTPUTS[1], "position", "m", "arm")),
        configurations=np.zeros((1, 1)),
        reference=reference,
        reference_channels=motor_channels(OUTPUTS[:1], "torque"),
        excited_lines=LINES,
    )


def test_a_response_without_variances_is_refused():
    frf = estimate_frf(noisy_record(0.0, n_real=1), EstimateOptions(estimator="indirect", compensation="none"))
    with pytest.raises(DataError, match="several realizations"):
        total_over_noise(frf, OUTPUTS, 4)
