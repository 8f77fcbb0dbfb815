"""The designed reference, and the predicted motion against a simulated rigid drive."""

import re
import time
from dataclasses import replace

import numpy as np
import pytest

from robid.design.excitation import design_excitation, predict
from robid.design.options import ExcitationOptions
from robid.errors import SettingsError
from robid.robot.description import Inertial, Joint, Motor, Robot
from robid.simulate.controller import Cascade, angle_reference
from robid.simulate.options import Controller

STEP = 1e-3
INERTIA = np.array([0.01, 0.02])
OPTIONS = ExcitationOptions(period_s=1, low_hz=2, high_hz=40, count=15, rms=(8.0, 12.0))


def make_robot(max_speed=100.0, max_torque=60.0):
    body = Inertial(1.0, np.zeros(3), np.eye(3))
    joints = tuple(
        Joint(f"axis_{index + 1}", np.zeros(3), np.eye(3), body, -1.0, 1.0, Motor(inertia, 50.0, max_speed, max_torque))
        for index, inertia in enumerate(INERTIA)
    )
    return Robot("two drives", np.zeros(3), joints, (), body)


def rigid_response(excitation):
    """Exactly sampled response of two rigid drives with one sample of delay, torque to acceleration."""
    omega = 2 * np.pi * excitation.frequency_hz
    z = np.exp(1j * omega * STEP)
    angle = STEP**2 * (z + 1) / (2 * (z - 1) ** 2) / z
    return (-(omega**2) * angle)[None, :, None, None] * np.diag(1 / INERTIA)


def simulate_rigid(excitation, controller, static, periods):
    """Steps two rigid drives under the real controller; returns the last period's torque, speed and angle."""
    reference = excitation.reference.reshape(-1, *excitation.reference.shape[2:])
    n_row, n_sample, n_motor = reference.shape
    zero = np.zeros((n_row, n_motor))
    target, feed = np.zeros_like(reference), np.zeros_like(reference)
    if excitation.kind == "speed_reference":
        target, feed = angle_reference(reference, STEP), reference
    cascade = Cascade(controller, INERTIA, np.full(n_motor, np.inf), zero, static)
    angle, speed, command = zero, zero, np.broadcast_to(static, zero.shape)
    trace = []
    for index in range(periods * n_sample):
        sample = index % n_sample
        applied, command = command, cascade.command(angle, target[:, sample], feed[:, sample])
        if excitation.kind == "torque":
            command = command + reference[:, sample]
        trace.append((command, speed, angle))
        acceleration = (applied - static) / INERTIA
        angle, speed = angle + STEP * speed + STEP**2 / 2 * acceleration, speed + STEP * acceleration
    return np.array(trace[-n_sample:]).transpose(1, 0, 2, 3)


def test_reference_has_the_asked_rms_lines_and_orthogonality():
    excitation = design_excitation(OPTIONS, 2, 3, STEP)
    assert excitation.reference.shape == (3, 2, 1000, 2)
    np.testing.assert_allclose(np.sqrt(np.mean(excitation.reference**2, axis=2)), np.broadcast_to([8, 12], (3, 2, 2)))
    spectrum = np.fft.rfft(excitation.reference, axis=2) / 500
    np.testing.assert_allclose(spectrum[:, :, excitation.excited_lines], excitation.spectrum, atol=1e-10)
    silent = np.setdiff1d(np.arange(501), excitation.excited_lines)
    assert np.abs(spectrum[:, :, silent]).max() < 1e-10
    gram = np.einsum("reki,rekj->rkij", excitation.spectrum, excitation.spectrum.conj())
    assert np.abs(gram[..., 0, 1]).max() < 1e-10 * np.abs(gram[..., 0, 0]).max()


def test_realizations_and_motors_have_their_own_phases():
    spectrum = design_excitation(OPTIONS, 2, 2, STEP).spectrum[:, 0]
    phase = np.angle(spectrum)
    assert np.abs(phase[0] - phase[1]).min(axis=0).max() > 1e-6
    assert np.abs(phase[0, :, 0] - phase[0, :, 1]).max() > 0.1
    again = design_excitation(OPTIONS, 2, 2, STEP).spectrum[:, 0]
    np.testing.assert_array_equal(spectrum, again)


def test_default_excitation_is_flat_enough_and_fast():
    start = time.process_time()
    excitation = design_excitation(ExcitationOptions(), 6, 4, STEP)
    assert time.process_time() - start < 8
    assert excitation.crest_factor.max() < 2.05
    assert np.median(excitation.crest_factor) < 1.95


@pytest.mark.parametrize("inject", ["speed_reference", "torque"])
def test_prediction_agrees_with_a_simulated_rigid_drive(inject):
    rms = (8.0, 12.0) if inject == "speed_reference" else (0.5, 0.8)
    options = ExcitationOptions(period_s=1, low_hz=2, high_hz=40, count=15, rms=rms, inject=inject)
    excitation = design_excitation(options, 2, 1, STEP)
    controller = Controller(position_gain_1_s=6, speed_bandwidth_hz=20, integral_time_s=0.1)
    static = np.array([[0.0, 0.0], [3.0, -2.0]])
    response = np.repeat(rigid_response(excitation), 2, axis=0)
    plan = predict(excitation, response, controller, static, make_robot()).plan
    torque, speed, angle = simulate_rigid(excitation, controller, static[1], periods=6)
    np.testing.assert_allclose(plan.torque_peak[1], np.abs(torque).max(axis=(0, 1)), rtol=1e-4)
    np.testing.assert_allclose(plan.torque_rms[1], np.sqrt(np.mean(torque**2, axis=(0, 1))), rtol=1e-4)
    np.testing.assert_allclose(plan.excursion_peak[1], np.abs(angle).max(axis=(0, 1)) / 50, rtol=1e-4)
    np.testing.assert_allclose(plan.speed_peak[1], np.abs(speed).max(axis=(0, 1)), rtol=1e-2)
    np.testing.assert_allclose(plan.excursion_margin, 1 - plan.excursion_peak / np.radians(5))
    assert plan.torque_peak[0, 0] < plan.torque_peak[1, 0]


def test_exceeded_limits_name_motor_configuration_peak_and_the_admissible_rms():
    excitation = design_excitation(OPTIONS, 2, 1, STEP)
    response = np.repeat(rigid_response(excitation), 2, axis=0)
    static = np.array([[0.0, 0.0], [0.0, 20.0]])
    free = predict(excitation, response, Controller(), static, make_robot(1e3, 1e3)).plan
    tight = make_robot(0.8 * free.speed_peak[0, 0], 0.98 * free.torque_peak[1, 1])
    with pytest.raises(SettingsError) as caught:
        predict(excitation, response, Controller(), static, tight)
    message = str(caught.value)
    peak = f"{free.speed_peak[0, 0]:.4g} rad/s exceeds {0.8 * free.speed_peak[0, 0]:.4g} rad/s"
    assert f"motor axis_1, configuration 1 and 1 more: speed peak {peak}" in message
    assert re.search(r"motor axis_2, configuration 2: torque peak", message)
    admissible = float(re.search(r"axis_1.*admissible rms ([\d.]+) rad/s", message)[1])
    assert admissible == pytest.approx(0.8 * OPTIONS.rms[0], rel=2e-3)
    factor = float(re.search(r"at most ([\d.]+)", message)[1])
    scaled = design_excitation(replace(OPTIONS, rms=tuple(factor * value for value in OPTIONS.rms)), 2, 1, STEP)
    plan = predict(scaled, response, Controller(), static, tight).plan
    assert 0 <= min(plan.speed_margin.min(), plan.torque_margin.min(), plan.excursion_margin.min()) < 0.01


def test_a_motor_that_cannot_hold_the_arm_has_no_admissible_rms():
    excitation = design_excitation(OPTIONS, 2, 1, STEP)
    static = np.array([[70.0, 0.0]])
    with pytest.raises(SettingsError, match="static torque alone") as caught:
        predict(excitation, rigid_response(excitation), Controller(), static, make_robot())
    assert "Leave out the configurations" in caught.value.remedy


@pytest.mark.parametrize(("rms", "word"), [((1.0,), "1 values for 2 motors"), ((1.0, -2.0), "motor 2 is not positive")])
def test_rms_that_does_not_fit_is_refused(rms, word):
    with pytest.raises(SettingsError, match=word):
        design_excitation(ExcitationOptions(rms=rms), 2, 1, STEP)


def test_fewer_experiments_are_the_first_of_each_block():
    whole = design_excitation(OPTIONS, 2, 3, STEP)
    part = whole.first_experiments(1)
    assert part.reference.shape[:2] == part.spectrum.shape[:2] == part.crest_factor.shape[:2] == (3, 1)
    np.testing.assert_array_equal(part.reference[:, 0], whole.reference[:, 0])
    np.testing.assert_array_equal(whole.first_experiments(None).spectrum, whole.spectrum)
