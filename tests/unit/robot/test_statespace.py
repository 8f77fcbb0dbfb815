"""The state space against the parametric response, continuous and sampled."""

import numpy as np
import pytest

from exact_systems import sensed_everywhere, two_joint_robot, two_mass_robot
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response
from robid.robot.statespace import discretise, state_space
from tolerances import IDENTITY

PERIOD_S = 1e-3
FREQUENCY_HZ = np.array([1.3, 5.0, 11.0, 17.0, 29.0, 47.0, 60.0, 83.0, 140.0])
OMEGA = 2 * np.pi * FREQUENCY_HZ
CASES = {
    "two joints": (two_joint_robot(), np.array([[-0.3, 0.5], [0.9, 1.2]]), ("shoulder", "elbow")),
    "rotors on the links": (two_joint_robot("on_link"), np.array([[-0.3, 0.5]]), ("shoulder", "elbow", "elbow.arm")),
    "motor and load": (two_mass_robot(viscous=0.01), np.zeros((1, 1)), ("drive", "drive.arm")),
}


def systems(case):
    robot, configurations, outputs = CASES[case]
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, configurations), outputs)
    parameters = nominal_parameters(robot, linear, 0.0)
    motors, springs = (tuple(item.name for item in items) for items in (robot.joints, robot.springs))
    each = [state_space(linear, parameters, index, motors, springs, outputs) for index in range(len(configurations))]
    return each, linear, parameters


def transfer(system, points):
    identity = np.eye(len(system.A))
    return np.array([system.C @ np.linalg.solve(point * identity - system.A, system.B) + system.D for point in points])


@pytest.mark.parametrize("case", CASES)
def test_continuous_response(case):
    each, linear, parameters = systems(case)
    wanted = response(linear, parameters, FREQUENCY_HZ, None).sampled
    for system, exact in zip(each, wanted, strict=True):
        angle, speed, acceleration = np.split(transfer(system, 1j * OMEGA), 3, axis=1)
        rate = 1j * OMEGA[:, None, None]
        for found in (rate**2 * angle, rate * speed, acceleration):
            np.testing.assert_allclose(found, exact, rtol=1e-9)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("delay", [0.0, 0.4, 1.0, 1.3, 3.0], ids=lambda delay: f"{delay} samples")
def test_sampled_response_is_the_sum_of_all_aliases(case, delay):
    each, _, _ = systems(case)
    shifts = np.arange(-3000, 3001) * 2 * np.pi / PERIOD_S
    for system in each:
        sampled = discretise(system, PERIOD_S, delay * PERIOD_S)
        found = transfer(sampled, np.exp(1j * OMEGA * PERIOD_S))
        for line in (0, 4, 8):
            omega = OMEGA[line] + shifts
            hold = (1 - np.exp(-1j * omega * PERIOD_S)) / (1j * omega * PERIOD_S) * np.exp(-1j * omega * delay * 1e-3)
            total = np.einsum("w,woi->oi", hold, transfer(system, 1j * omega))
            angles = len(sampled.outputs) // 2
            scale = np.abs(total[:angles]).max()
            assert np.abs(found[line, :angles] - total[:angles]).max() < 1e-8 * scale


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("delay", [0.0, 0.4, 1.0, 1.3])
def test_sampled_response_is_the_fits(case, delay):
    robot, configurations, outputs = CASES[case]
    each, linear, _ = systems(case)
    low = FREQUENCY_HZ[:-1]
    parameters = nominal_parameters(robot, linear, delay * PERIOD_S)
    wanted = response(linear, parameters, low, PERIOD_S).sampled
    for system, exact in zip(each, wanted, strict=True):
        sampled = discretise(system, PERIOD_S, delay * PERIOD_S)
        angle = transfer(sampled, np.exp(2j * np.pi * low * PERIOD_S))[:, : len(outputs)]
        found = -((2 * np.pi * low) ** 2)[:, None, None] * angle
        # The fit sums two aliases on each side.
        assert np.abs(found - exact).max() < 1e-4 * np.abs(exact).max()
    assert len(each) == len(configurations)


def test_a_command_takes_effect_when_the_delay_is_over():
    (system,), _, _ = systems("motor and load")
    for samples in (0, 1, 2, 3):
        sampled = discretise(system, PERIOD_S, samples * PERIOD_S)
        assert len(sampled.A) == len(system.A) + samples
        state, angles = np.zeros(len(sampled.A)), []
        for step in range(samples + 3):
            angles.append(float((sampled.C @ state)[0]))
            state = sampled.A @ state + sampled.B[:, 0] * (step == 0)
        assert angles[: samples + 1] == [0.0] * (samples + 1)
        # A torque held for one period turns the motor by half its acceleration times the period squared.
        np.testing.assert_allclose(angles[samples + 1], 0.5 * PERIOD_S**2 / 4.78e-3, rtol=0.05)


def test_any_share_of_a_period_interpolates_between_whole_ones():
    (system,), _, _ = systems("motor and load")
    point = np.exp(1j * OMEGA * PERIOD_S)
    almost = transfer(discretise(system, PERIOD_S, 2e-3 * (1 - 1e-12)), point)
    np.testing.assert_allclose(almost, transfer(discretise(system, PERIOD_S, 2e-3), point), rtol=IDENTITY)
    below = transfer(discretise(system, PERIOD_S, 2e-3 * (1 - 1e-6)), point)
    np.testing.assert_allclose(below, almost, rtol=1e-4)


def test_names_and_shapes():
    each, _, _ = systems("rotors on the links")
    system = each[0]
    assert system.A.shape == (len(system.states), len(system.states))
    assert system.C.shape == (len(system.outputs), len(system.states))
    assert system.D.shape == (len(system.outputs), len(system.inputs))
    assert system.states[:3] == ("shoulder.motor_angle", "elbow.motor_angle", "gear_1.deflection")
    assert system.outputs[-1] == "elbow.arm.acceleration"
    sampled = discretise(system, PERIOD_S, 1.5e-3)
    assert sampled.states[-4:] == (
        "shoulder.torque[k-1]",
        "elbow.torque[k-1]",
        "shoulder.torque[k-2]",
        "elbow.torque[k-2]",
    )
    assert [name.rpartition(".")[2] for name in sampled.outputs] == ["angle"] * 3 + ["speed"] * 3


def test_sampled_outputs_do_not_depend_on_where_the_torque_acts():
    (system,), _, _ = systems("motor and load")
    names = ("drive.angle", "drive.arm.angle", "drive.speed", "drive.arm.speed")
    assert discretise(system, PERIOD_S, 0.0).outputs == names


def test_a_negative_delay_is_refused():
    (system,), _, _ = systems("motor and load")
    with pytest.raises(ValueError, match="`delay_s` must not be negative"):
        discretise(system, PERIOD_S, -1e-5)


def test_an_accelerometer_feels_gravity_in_the_state_space_too():
    robot = sensed_everywhere()
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, np.array([[-0.3, 0.5]])), ("tip", "felt"))
    parameters = nominal_parameters(robot, linear, 0.0)
    motors, springs = (tuple(row.name for row in rows) for rows in (robot.joints, robot.springs))
    system = state_space(linear, parameters, 0, motors, springs, ("tip", "felt"))
    wanted = response(linear, parameters, FREQUENCY_HZ, None).sampled[0]
    np.testing.assert_allclose(transfer(system, 1j * OMEGA)[:, -2:], wanted, rtol=1e-9)
    assert np.abs(linear.tilt).max() > 0
