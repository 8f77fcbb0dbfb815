"""The sampled response against exact discretisation and against MuJoCo's own linearisation."""

import control
import mujoco
import numpy as np
import pytest

from exact_systems import two_joint_robot, two_mass_robot
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response


def two_mass_state_space(motor, load, stiffness, damping):
    """States motor angle, load angle, their speeds; input motor torque; outputs both angles."""
    mass = np.diag([motor, load])
    coupling = np.array([[1.0, -1.0], [-1.0, 1.0]])
    lower = -np.linalg.solve(mass, np.hstack([stiffness * coupling, damping * coupling]))
    A = np.vstack([np.hstack([np.zeros((2, 2)), np.eye(2)]), lower])
    B = np.array([[0.0], [0.0], [1 / motor], [0.0]])
    return control.ss(A, B, np.eye(2, 4), np.zeros((2, 1)))


@pytest.mark.parametrize(("period_s", "highest_hz"), [(1e-3, 100.0), (4e-4, 250.0)])
@pytest.mark.parametrize("delay_samples", [0, 1, 3])
def test_hold_delay_and_aliases_against_exact_discretisation(period_s, highest_hz, delay_samples):
    values = (4.780e-3, 4.752e-3, 546.4, 0.05)
    frequency = np.geomspace(5.0, highest_hz, 80)
    omega = 2 * np.pi * frequency
    sampled = control.c2d(two_mass_state_space(*values), period_s, "zoh")
    angle = np.array([sampled(np.exp(1j * w * period_s))[:, 0] for w in omega])
    wanted = -(omega**2)[:, None] * angle * np.exp(-1j * omega * delay_samples * period_s)[:, None]
    robot = two_mass_robot(*values)
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, np.zeros((1, 1))), ("drive", "drive.arm"))
    parameters = nominal_parameters(robot, linear, delay_samples * period_s)
    found = response(linear, parameters, frequency, period_s).sampled[0, :, :, 0]
    assert np.abs(found[:, 0] / wanted[:, 0] - 1).max() < 1e-4
    # The load's own response falls with the square of frequency, and what the sampling folds back does not.
    assert (np.abs(found[:, 1] - wanted[:, 1]) < 1e-4 * np.abs(wanted).max(axis=1)).all()


def test_linearisation_is_the_limit_of_the_simulators_own():
    robot = two_joint_robot()
    model = build_model(robot)
    rest = solve_statics(model, np.array([[0.4, -0.9]]))
    linear = linearize(model, rest)
    frequency = np.array([2.0, 9.0, 25.0, 60.0])
    wanted = response(linear, nominal_parameters(robot, linear, 0.0), frequency, None).sampled[0]
    data, n = mujoco.MjData(model.mujoco), model.mujoco.nv
    model.mujoco.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    errors = []
    for step in (4e-5, 2e-5, 1e-5):
        model.mujoco.opt.timestep = step
        data.qpos[:], data.qvel[:], data.ctrl[:] = rest.position[0], 0.0, rest.motor_torque[0]
        A, B = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, 2))
        mujoco.mjd_transitionFD(model.mujoco, data, 1e-4, True, A, B, None, None)
        found = []
        for w in 2 * np.pi * frequency:
            state = np.linalg.solve(np.exp(1j * w * step) * np.eye(2 * n) - A, B)
            found.append(-(w**2) * state[model.motor])
        errors.append(np.abs(np.array(found) - wanted).max() / np.abs(wanted).max())
    slopes = np.diff(np.log(errors)) / np.log(0.5)
    assert errors[-1] < 2e-3
    np.testing.assert_allclose(slopes, 1.0, atol=0.15)
