"""Equilibrium under gravity: nothing accelerates, the arm sags, the energy is smallest."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from exact_systems import arm_on_rail, springs_everywhere, two_joint_robot, two_mass_robot, with_spring_factors
from robid.errors import DataError
from robid.robot.description import HarmonicBalance
from robid.robot.linearize import gravity_gradient, gravity_torque, linearize, solve_statics
from robid.robot.model import build_model

CONFIGURATIONS = np.array([[0.0, 0.0], [-0.7, 1.1], [1.2, -0.4]])


def stiffening(robot):
    return replace(robot, springs=tuple(replace(spring, cubic=3e7) for spring in robot.springs))


@pytest.mark.parametrize("rotor", ["spong", "on_link"])
@pytest.mark.parametrize("change", [lambda robot: robot, stiffening], ids=["linear", "stiffening"])
def test_held_robot_does_not_accelerate(rotor, change):
    model = build_model(change(two_joint_robot(rotor)))
    rest = solve_statics(model, CONFIGURATIONS)
    data = mujoco.MjData(model.mujoco)
    for position, torque in zip(rest.position, rest.motor_torque, strict=True):
        data.qpos[:], data.ctrl[:] = position, torque
        mujoco.mj_forward(model.mujoco, data)
        weight = np.abs(data.qfrc_bias[model.arm]).max()
        # With the rotors on the links their own acceleration is the arm's; torque balance is the common measure.
        np.testing.assert_allclose(data.qfrc_smooth, 0.0, atol=1e-9 * weight)
    np.testing.assert_allclose(rest.position[:, model.motor], CONFIGURATIONS * model.robot.gear_ratio)
    np.testing.assert_allclose(rest.deflection, rest.position @ model.deflection.T)


def test_arm_sags_below_what_the_encoders_show():
    robot = two_joint_robot()
    model = build_model(robot)
    rest = solve_statics(model, np.zeros((1, 2)))
    # Turning about the joint axis, -y of the base, lifts the stretched arm.
    assert (rest.position[0, model.arm] < 0).all()
    assert (rest.deflection[0, :2] > 0).all()
    assert (rest.motor_torque[0] > 0).all()
    # Of the stretched arm, whose sag hardly changes the lever.
    whole = robot.joints[1].link
    moment = 9.81 * (whole.mass_kg * whole.com_m[0] + robot.payload.mass_kg * robot.payload.com_m[0])
    np.testing.assert_allclose(rest.motor_torque[0, 1] * 100.0, moment, rtol=5e-3)
    np.testing.assert_allclose(rest.deflection[0, 1] * robot.springs[1].stiffness, moment, rtol=5e-3)


def balanced():
    robot = two_joint_robot()
    balance = HarmonicBalance(np.array([3.0, 1.0]), np.array([2.0, -5.0]))
    return replace(robot, joints=(robot.joints[0], replace(robot.joints[1], counterbalance=balance)))


@pytest.mark.parametrize("robot", [two_joint_robot(), springs_everywhere(), arm_on_rail(), balanced()])
def test_gravity_s_gradient_is_the_difference_of_its_torque(robot):
    model = build_model(replace(robot, gravity_m_s2=np.array([1.0, -2.0, -9.0])), balanced=True)
    position = np.random.default_rng(1).uniform(-0.7, 0.7, model.mujoco.nv)
    moved = [gravity_torque(model, position + side * 1e-5 * np.eye(position.size)) for side in (-1, 1)]
    wanted = ((moved[1] - moved[0]) / 2e-5).T
    found = gravity_gradient(model, mujoco.MjData(model.mujoco), position)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-8 * np.abs(wanted).max())


def test_coupled_encoders_show_the_arm_angles_of_stiff_gears():
    robot = with_spring_factors(springs_everywhere(), 1e7)
    model = build_model(robot)
    rest = solve_statics(model, CONFIGURATIONS)
    np.testing.assert_allclose(rest.position[:, model.arm], CONFIGURATIONS, atol=1e-6)
    first, second = rest.position[:, model.motor].T
    np.testing.assert_allclose(first / 120.0, CONFIGURATIONS[:, 0])
    np.testing.assert_allclose(second / 100.0 + 0.002 * first, CONFIGURATIONS[:, 1])


def test_held_robot_with_springs_everywhere_does_not_accelerate():
    model = build_model(springs_everywhere())
    rest = solve_statics(model, CONFIGURATIONS)
    data = mujoco.MjData(model.mujoco)
    for position, torque in zip(rest.position, rest.motor_torque, strict=True):
        data.qpos[:], data.ctrl[:] = position, torque
        mujoco.mj_forward(model.mujoco, data)
        np.testing.assert_allclose(data.qfrc_smooth, 0.0, atol=1e-9 * np.abs(data.qfrc_bias).max())
    # What the first motor carries of the second arm's weight comes through the coupling.
    assert np.abs(rest.motor_torque[:, 0]).min() > 0


def test_softer_springs_sag_in_proportion():
    model = build_model(with_spring_factors(two_joint_robot(), 1e3))
    nominal = np.array([1e3 * spring.stiffness for spring in two_joint_robot().springs])
    stiff = solve_statics(model, CONFIGURATIONS).deflection
    soft = solve_statics(model, CONFIGURATIONS, nominal / 2).deflection
    np.testing.assert_allclose(soft, 2 * stiff, rtol=1e-3, atol=1e-9)


def test_energy_is_smallest_at_rest():
    model = build_model(two_joint_robot())
    model.mujoco.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    data = mujoco.MjData(model.mujoco)

    def energy(position):
        data.qpos[:] = position
        mujoco.mj_fwdPosition(model.mujoco, data)
        mujoco.mj_energyPos(model.mujoco, data)
        return data.energy[0]

    generator = np.random.default_rng(1)
    for position in solve_statics(model, CONFIGURATIONS).position:
        for _ in range(5):
            step = np.zeros(position.size)
            step[model.passive] = 1e-3 * generator.standard_normal(model.passive.size)
            plus, here, minus = energy(position + step), energy(position), energy(position - step)
            assert abs(plus - minus) < 1e-3 * (plus + minus - 2 * here)


def test_springs_that_give_way_are_refused_by_configuration():
    model = build_model(with_spring_factors(two_joint_robot(), 1e-4))
    with pytest.raises(DataError, match=r"no equilibrium .*configuration \[0. 0.\] deg"):
        solve_statics(model, np.zeros((1, 2)))


def test_stiffness_leaves_all_else_of_a_configuration():
    robot = replace(two_joint_robot(), gravity_m_s2=np.zeros(3))
    first, second = build_model(robot), build_model(with_spring_factors(robot, [1.5, 2.0, 0.5, 3.0]))
    one = linearize(first, solve_statics(first, CONFIGURATIONS))
    other = linearize(second, solve_statics(second, CONFIGURATIONS))
    np.testing.assert_array_equal(one.mass, other.mass)
    np.testing.assert_array_equal(one.gravity_stiffness, other.gravity_stiffness)
    np.testing.assert_array_equal(one.output, other.output)


def test_matrices_are_symmetric_and_positive():
    model = build_model(two_joint_robot())
    linear = linearize(model, solve_statics(model, CONFIGURATIONS))
    np.testing.assert_allclose(linear.gravity_stiffness, np.swapaxes(linear.gravity_stiffness, 1, 2), atol=1e-9)
    rotors = np.zeros(linear.mass.shape[-1])
    rotors[:2] = linear.rotor
    whole = linear.mass + np.einsum("l,clij->cij", linear.axial, linear.link_inertia) + np.diag(rotors)
    np.testing.assert_allclose(whole, np.swapaxes(whole, 1, 2), atol=1e-12)
    assert (np.linalg.eigvalsh(whole) > 0).all()


def test_unknown_output_is_refused():
    model = build_model(two_mass_robot())
    rest = solve_statics(model, np.zeros((1, 1)))
    with pytest.raises(DataError, match="D206 output `load` is nothing that the robot measures"):
        linearize(model, rest, ("drive", "load"))
