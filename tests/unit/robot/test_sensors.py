"""Trackers and accelerometers of the linearised robot against closed forms and finite differences."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from exact_systems import sensed_everywhere, two_mass_robot
from robid.errors import DataError
from robid.robot.description import Sensor
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response

FREQUENCY_HZ = np.array([0.7, 2.0, 9.0, 31.0, 72.0])
X, Y, Z = np.eye(3)


def responses(robot, angle, names):
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, np.atleast_2d(angle)), names)
    return response(linear, nominal_parameters(robot, linear, 0.0), FREQUENCY_HZ, None).sampled[..., 0]


@pytest.mark.parametrize("angle", [0.0, 0.8])
def test_a_tracker_sees_the_lever_of_the_arm(angle):
    sensor = Sensor("tip", "tracker", 0, np.array([0.5, 0.0, 0.2]), Y)
    robot = replace(two_mass_robot(), sensors=(sensor,))
    arm, tip = responses(robot, angle, ("drive.arm", "tip"))[0].T
    np.testing.assert_allclose(tip, 0.5 * np.cos(angle) * arm, rtol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 0.8])
def test_an_accelerometer_sees_gravity_as_it_turns(angle):
    # The link balances about its axis, so that gravity does not move it.
    sensor = Sensor("felt", "accelerometer", 0, np.array([0.5, 0.0, 0.2]), Y)
    robot = replace(two_mass_robot(), sensors=(sensor,), gravity_m_s2=np.array([0.0, -9.81, 0.0]))
    arm, felt = responses(robot, angle, ("drive.arm", "felt"))[0].T
    omega = 2 * np.pi * FREQUENCY_HZ
    # It shows L a + g cos(q); where the arm moves by dq, g cos(q) by -g sin(q) dq.
    np.testing.assert_allclose(felt, arm * (0.5 + 9.81 * np.sin(angle) / omega**2), rtol=1e-12)


def test_rows_are_derivatives_of_what_the_engine_s_sensors_show():
    robot = sensed_everywhere()
    model = build_model(robot, sensors=True)
    rest = solve_statics(model, np.array([[-0.3, 0.5]]))
    linear = linearize(model, rest, ("tip", "felt"))
    to_spring = np.linalg.inv(np.vstack([np.eye(model.mujoco.nv)[model.motor], model.deflection]))
    data = mujoco.MjData(model.mujoco)

    def shown(position, acceleration):
        data.qpos[:], data.qvel[:], data.qacc[:] = position, 0.0, acceleration
        mujoco.mj_fwdPosition(model.mujoco, data)
        mujoco.mj_fwdVelocity(model.mujoco, data)
        mujoco.mj_rnePostConstraint(model.mujoco, data)
        mujoco.mj_sensorPos(model.mujoco, data)
        mujoco.mj_sensorAcc(model.mujoco, data)
        return np.array([row.axis @ data.sensor(row.name).data for row in robot.sensors])

    still = np.zeros(model.mujoco.nv)
    for column, direction in enumerate(to_spring.T):
        step = 1e-6 * direction
        moved = (shown(rest.position[0] + step, still) - shown(rest.position[0] - step, still)) / 2e-6
        pushed = shown(rest.position[0], direction) - shown(rest.position[0], still)
        scale = np.abs(linear.output[0, :, column]).max() + 1e-6
        np.testing.assert_allclose(moved[0], linear.output[0, 0, column], atol=1e-6 * scale)
        np.testing.assert_allclose(moved[1], -linear.tilt[0, 1, column], atol=1e-5 * scale)
        np.testing.assert_allclose(pushed[1], linear.output[0, 1, column], atol=1e-9 * scale)
    assert not linear.tilt[0, 0].any()


def test_an_output_that_is_not_there_is_refused_with_those_that_are():
    model = build_model(sensed_everywhere())
    with pytest.raises(DataError, match=r"`tpi` is nothing .* elbow\.arm, tip, felt"):
        linearize(model, solve_statics(model, np.zeros((1, 2))), ("shoulder", "tpi"))
