"""The predicted motion against simulated rigid drives and python-control; limits and the share of them that is used."""

import re
from dataclasses import replace

import numpy as np
import pytest

from exact_systems import two_mass_robot
from robid.design.excitation.excitation import design_excitation
from robid.design.excitation.loop import nominal_loop
from robid.design.excitation.options import MultisineOptions
from robid.design.excitation.prediction import predict
from robid.errors import SettingsError
from robid.signals.waveforms import crest_factor
from robid.simulate.controller import speed_gains
from robid.simulate.options import Controller
from two_drives import OPTIONS, STEP, make_loop, make_robot, simulate_rigid


@pytest.mark.parametrize("inject", ["speed_reference", "torque"])
def test_prediction_agrees_with_a_simulated_rigid_drive(inject):
    rms = (8.0, 12.0) if inject == "speed_reference" else (0.5, 0.8)
    options = MultisineOptions(period_s=1, low_hz=2, high_hz=40, count=15, rms=rms, inject=inject, phase_starts=2)
    excitation = design_excitation(options, 2, 1, STEP)
    controller = Controller(position_gain_1_s=6, speed_bandwidth_hz=20, integral_time_s=0.1)
    static = np.array([[0.0, 0.0], [3.0, -2.0]])
    plan = predict(excitation, make_loop(excitation, controller, static), options).plan
    torque, speed, angle = simulate_rigid(excitation, controller, static[1], periods=6)
    np.testing.assert_allclose(plan.torque_peak[1], np.abs(torque).max(axis=(0, 1)), rtol=1e-4)
    np.testing.assert_allclose(plan.torque_rms[1], np.sqrt(np.mean(torque**2, axis=(0, 1))), rtol=1e-4)
    np.testing.assert_allclose(plan.excursion_peak[1], np.abs(angle).max(axis=(0, 1)) / 50, rtol=1e-4)
    np.testing.assert_allclose(plan.speed_peak[1], np.abs(speed).max(axis=(0, 1)), rtol=1e-2)
    np.testing.assert_allclose(plan.speed_crest[1], crest_factor(np.moveaxis(speed, 0, 1)).max(axis=0), rtol=1e-2)
    np.testing.assert_allclose(plan.excursion_margin, 1 - plan.excursion_peak / np.radians(5))
    assert plan.torque_peak[0, 0] < plan.torque_peak[1, 0]


def test_exceeded_limits_name_motor_configuration_peak_and_the_admissible_rms():
    excitation = design_excitation(OPTIONS, 2, 1, STEP)
    static = np.array([[0.0, 0.0], [0.0, 20.0]])
    free = predict(excitation, make_loop(excitation, static=static, robot=make_robot(1e3, 1e3)), OPTIONS).plan
    tight = make_robot(0.8 * free.speed_peak[0, 0], 0.98 * free.torque_peak[1, 1])
    with pytest.raises(SettingsError) as caught:
        predict(excitation, make_loop(excitation, static=static, robot=tight), OPTIONS)
    message = str(caught.value)
    peak = f"{free.speed_peak[0, 0]:.4g} rad/s exceeds {0.8 * free.speed_peak[0, 0]:.4g} rad/s"
    assert f"motor axis_1, configuration 1 and 1 more: speed peak {peak}" in message
    assert re.search(r"motor axis_2, configuration 2: torque peak", message)
    admissible = float(re.search(r"axis_1.*admissible rms ([\d.]+) rad/s", message)[1])
    assert admissible == pytest.approx(0.8 * OPTIONS.rms[0], rel=2e-3)
    factor = float(re.search(r"at most ([\d.]+)", message)[1])
    scaled = design_excitation(replace(OPTIONS, rms=tuple(factor * value for value in OPTIONS.rms)), 2, 1, STEP)
    plan = predict(scaled, make_loop(scaled, static=static, robot=tight), OPTIONS).plan
    assert 0 <= min(plan.speed_margin.min(), plan.torque_margin.min(), plan.excursion_margin.min()) < 0.01


def test_a_motor_that_cannot_hold_the_arm_has_no_admissible_rms():
    excitation = design_excitation(OPTIONS, 2, 1, STEP)
    static = np.array([[70.0, 0.0]])
    with pytest.raises(SettingsError, match="static torque alone") as caught:
        predict(excitation, make_loop(excitation, static=static), OPTIONS)
    assert "Leave out the configurations" in caught.value.remedy


@pytest.mark.parametrize("share", [0.3, 1.0])
def test_the_nearest_limit_is_reached_to_the_share_that_is_asked_for(share):
    static = np.array([[0.0, 0.0], [3.0, -9.0]])
    options = replace(OPTIONS, limit_share=share, phase_iterations=0)
    excitation = design_excitation(options, 2, 2, STEP)
    loop = make_loop(excitation, static=static)
    used = predict(excitation, loop, options)
    plan = used.plan
    margins = [plan.speed_margin, plan.torque_margin, plan.excursion_margin]
    assert 1 - min(margin.min() for margin in margins) == pytest.approx(share, rel=1e-9)
    factor = used.rms / np.array(OPTIONS.rms)
    assert factor[0] == pytest.approx(factor[1], rel=1e-12)
    given = replace(options, limit_share=None, rms=tuple(used.rms))
    again = predict(design_excitation(given, 2, 2, STEP), loop, given)
    np.testing.assert_allclose(again.reference, used.reference, atol=1e-9)
    for name in ("speed_rms", "speed_peak", "torque_rms", "torque_peak", "excursion_peak", "snr_db", "speed_crest"):
        np.testing.assert_allclose(getattr(plan, name), getattr(again.plan, name), rtol=1e-9)


def test_the_excursion_limit_is_a_setting():
    excitation = design_excitation(OPTIONS, 2, 1, STEP)
    loop = make_loop(excitation)
    peak_deg = np.degrees(predict(excitation, loop, OPTIONS).plan.excursion_peak.max())
    with pytest.raises(SettingsError, match="arm excursion peak"):
        predict(excitation, loop, replace(OPTIONS, max_excursion_deg=0.99 * peak_deg))
    predict(excitation, loop, replace(OPTIONS, max_excursion_deg=1.01 * peak_deg))


def test_the_excursion_of_a_linear_axis_has_a_limit_of_its_own():
    excitation = design_excitation(OPTIONS, 2, 1, STEP)
    turning = make_robot()
    robot = replace(turning, joints=tuple(replace(joint, type="prismatic") for joint in turning.joints))
    loop = make_loop(excitation, robot=robot)
    options = replace(OPTIONS, max_excursion_deg=1e-9)
    peak_m = predict(excitation, loop, options).plan.excursion_peak.max()
    with pytest.raises(SettingsError, match=rf"arm excursion peak {peak_m:.4g} m exceeds"):
        predict(excitation, loop, replace(options, max_excursion_m=0.99 * peak_m))
    predict(excitation, loop, replace(options, max_excursion_m=1.01 * peak_m))


def test_a_share_that_the_static_torque_uses_up_is_refused():
    options = replace(OPTIONS, limit_share=0.5)
    excitation = design_excitation(options, 2, 1, STEP)
    with pytest.raises(SettingsError, match=r"axis_1 needs more than 50 % .* configuration 2") as caught:
        predict(excitation, make_loop(excitation, static=[[0.0, 0.0], [31.0, 0.0]]), options)
    assert caught.value.where == "excitation.limit_share"


def test_the_duration_counts_every_period():
    excitation = design_excitation(OPTIONS, 2, 3, STEP)
    plan = predict(excitation, make_loop(excitation, static=np.zeros((4, 2))), OPTIONS, periods=5, transient_periods=1)
    assert plan.plan.duration_s == pytest.approx(4 * 3 * 2 * 6 * 1.0)


def test_speed_and_torque_of_a_two_mass_drive_agree_with_python_control():
    control = pytest.importorskip("control")
    motor, load, spring, damper = 4.78e-3, 4.752e-3, 546.4, 0.05
    options = MultisineOptions(period_s=1, low_hz=5, high_hz=90, count=30, rms=3.0, phase_iterations=0)
    controller = Controller(position_gain_1_s=6, speed_bandwidth_hz=15, integral_time_s=0.1)
    excitation = design_excitation(options, 1, 1, STEP)
    robot = two_mass_robot(motor, load, spring, damper)
    loop = nominal_loop(robot, controller, np.zeros((1, 1)), excitation.frequency_hz)
    matrix = np.zeros((4, 4))
    matrix[0, 2] = matrix[1, 3] = 1
    matrix[2] = np.array([-spring, spring, -damper, damper]) / motor
    matrix[3] = np.array([spring, -spring, damper, -damper]) / load
    drive = control.ss(matrix, [[0], [0], [1 / motor], [0]], [[1, 0, 0, 0]], 0)
    z = control.tf("z")
    plant = control.tf(control.c2d(drive, STEP, "zoh")) / z
    proportional, integral = (gain[0] for gain in speed_gains(controller, np.array([motor])))
    rate = (1 - 1 / z) / STEP
    inner = proportional + integral / rate
    outer = inner * (6 + rate)
    ahead = inner * (1 + 6 * STEP / 2 * (1 + 1 / z) / (1 - 1 / z))
    point = np.exp(2j * np.pi * excitation.frequency_hz * STEP)
    torque = (control.feedback(1, plant * outer) * ahead)(point)
    to_torque, to_angle = (gain[:, 0, 0] for gain in loop.gains(0, "speed_reference"))
    # The nominal response counts two aliases on each side of the held angle.
    np.testing.assert_allclose(to_torque, torque, rtol=2e-4)
    np.testing.assert_allclose(to_angle, plant(point) * torque, rtol=2e-4)
    plan = predict(excitation, loop, options).plan
    amplitude = np.abs(excitation.spectrum[0, 0, :, 0])
    assert plan.torque_rms[0, 0] == pytest.approx(np.sqrt(np.sum((amplitude * np.abs(torque)) ** 2) / 2), rel=2e-4)
