"""The flexible-joint inverse against closed forms and against MuJoCo's forward dynamics."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from exact_systems import two_joint_robot, two_mass_robot, with_arm_friction, without_spring
from robid.errors import DataError
from robid.robot.inverse import inverse_motion
from robid.robot.linearize import solve_statics
from robid.robot.model import build_model
from robid.signals.waveforms import smooth_step
from robid.simulate.playback import with_tool_point

STEP = 1e-4
TIME = STEP * np.arange(10000)
MOTOR, LOAD, STIFFNESS, RATIO, VISCOUS = 5e-3, 40.0, 5e4, 100.0, 1e-3
POINT = np.array([0.5, 0.1, 0.0])


def bump(width=0.06):
    """A smooth excursion and its first four derivatives (5, n_time)."""
    x = (TIME - 0.5) / width
    hermite = [np.ones_like(x), -2 * x, 4 * x**2 - 2, -8 * x**3 + 12 * x, 16 * x**4 - 48 * x**2 + 12]
    return 0.02 * np.exp(-(x**2)) * np.array(hermite) / width ** np.arange(5)[:, None]


def drive(damping=0.0, cubic=0.0, rubs=0.0):
    robot = with_arm_friction(two_mass_robot(MOTOR, LOAD, STIFFNESS, damping, RATIO, VISCOUS), rubs)
    return replace(robot, springs=(replace(robot.springs[0], cubic=cubic),))


def invert(robot, motion, configuration, stride=1):
    model = build_model(with_tool_point(robot, POINT))
    return inverse_motion(model, solve_statics(model, configuration[None]), motion, STEP, stride)


def test_a_rigid_drive_is_the_closed_form():
    rigid = without_spring(drive(), "coupling")
    arm, speed, acceleration = bump()[:3]
    found = invert(rigid, bump()[:3, :, None], np.zeros(1))
    np.testing.assert_allclose(found.angle[:, 0], RATIO * arm, atol=1e-9)
    torque = (LOAD / RATIO + MOTOR * RATIO) * acceleration + VISCOUS * RATIO * speed
    np.testing.assert_allclose(found.torque[:, 0], torque, atol=1e-4 * np.abs(torque).max())


def test_a_rigid_joint_is_the_limit_of_a_stiff_one():
    elastic, at = two_joint_robot(), np.array([0.4, -0.9])
    motion = bump()[:3, :, None] * np.array([1.0, -0.5])
    wanted, errors = invert(without_spring(elastic, "gear_2"), motion, at, 10), []
    for factor in (1e3, 1e4):
        springs = tuple(
            replace(s, stiffness=factor * s.stiffness) if s.name == "gear_2" else s for s in elastic.springs
        )
        found = invert(replace(elastic, springs=springs), motion, at, 10)
        errors.append(np.abs(found.torque - wanted.torque).max() / np.abs(wanted.torque).max())
    assert errors[0] < 1e-2
    np.testing.assert_allclose(np.log10(errors[1] / errors[0]), -1.0, atol=0.1)


@pytest.mark.parametrize("stride", [1, 10])
@pytest.mark.parametrize("rubs", [0.0, 500.0])
def test_undamped_two_masses_are_the_closed_form(stride, rubs):
    arm, speed, acceleration, jerk, snap = bump()
    found = invert(drive(rubs=rubs), bump()[:3, :, None], np.zeros(1), stride)
    load, rate, second = (
        LOAD * once + rubs * before for before, once in ((speed, acceleration), (acceleration, jerk), (jerk, snap))
    )
    angle = RATIO * (arm + load / STIFFNESS)
    torque = load / RATIO
    torque += MOTOR * RATIO * (acceleration + second / STIFFNESS)
    torque += VISCOUS * RATIO * (speed + rate / STIFFNESS)
    np.testing.assert_allclose(found.angle[:, 0], angle, atol=1e-5 * np.abs(angle).max())
    np.testing.assert_allclose(found.torque[:, 0], torque, atol=1e-4 * np.abs(torque).max())


def test_a_damper_lags_as_its_spectrum_says():
    arm, _, acceleration = bump()[:3]
    damping = 300.0
    omega = 2 * np.pi * np.fft.rfftfreq(TIME.size, STEP)
    spectrum = LOAD * np.fft.rfft(acceleration) / (STIFFNESS + 1j * omega * damping)
    deflection = np.fft.irfft(spectrum, TIME.size)
    found = invert(drive(damping), bump()[:3, :, None], np.zeros(1)).angle[:, 0] / RATIO - arm
    np.testing.assert_allclose(found, deflection, atol=1e-4 * np.abs(deflection).max())


def test_a_stiffening_gear_carries_the_torque():
    arm, _, acceleration = bump()[:3]
    cubic = 3e8
    found = invert(drive(0.0, cubic), bump()[:3, :, None], np.zeros(1)).angle[:, 0] / RATIO - arm
    assert np.abs(cubic * found**3).max() > 0.2 * np.abs(STIFFNESS * found).max()
    np.testing.assert_allclose(STIFFNESS * found + cubic * found**3, LOAD * acceleration, atol=1e-6 * LOAD)


def open_loop(robot, configuration, motion):
    """Turns of the arm (n_time, n_joint) when the inverse's torques drive MuJoCo, and the tool's displacement."""
    found = invert(robot, motion, configuration)
    model = build_model(with_tool_point(robot, POINT), timestep_s=STEP)
    data = mujoco.MjData(model.mujoco)
    data.qpos[:] = solve_statics(model, configuration[None]).position[0]
    arms, tools = [], []
    for index in range(TIME.size // 2):
        mujoco.mj_kinematics(model.mujoco, data)
        arms.append(data.qpos[model.arm])
        tools.append(data.site_xpos[0].copy())
        data.ctrl[:] = 0.5 * (found.torque[index] + found.torque[index + 1])
        mujoco.mj_step(model.mujoco, data)
    return np.array(arms) - arms[0], np.array(tools) - tools[0]


def one_axis(axis, ramp_s):
    motion = np.zeros((3, TIME.size, 2))
    motion[..., axis] = smooth_step(TIME - 0.02, 0.02, 0.2, ramp_s)
    return motion


@pytest.mark.parametrize("rotor", ["spong", "on_link"])
def test_flexible_joints_alone_follow_exactly_in_the_engine(rotor):
    robot = two_joint_robot(rotor)
    robot = replace(robot, springs=robot.springs[:2])
    motion = one_axis(1, 0.1)
    arms = open_loop(robot, np.array([0.3, -0.8]), motion)[0]
    np.testing.assert_allclose(arms, motion[0, : len(arms)], atol=1e-6 * 0.02)


def test_springs_that_give_way_are_refused():
    robot = two_joint_robot()
    model = build_model(with_tool_point(robot, POINT))
    rest = solve_statics(model, np.zeros((1, 2)))
    motion = one_axis(0, 0.1)
    motion[2] *= 1e6
    with pytest.raises(DataError, match="give way"):
        inverse_motion(model, rest, motion, STEP, 10)
