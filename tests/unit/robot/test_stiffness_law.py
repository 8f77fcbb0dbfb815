"""Stiffness that depends on a joint's position, and shafts: closed forms, energies, derivatives."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from exact_systems import ball_screw, springs_everywhere, two_joint_robot, varying_arm
from robid.robot.collocated import Collocated
from robid.robot.derivatives import jacobian
from robid.robot.description import StiffnessLaw
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.regressor.model import build_rigid_model
from robid.robot.response import motion_matrices, nominal_parameters, response, with_values
from robid.robot.spring_laws import LawFactor
from robid.robot.standard import with_standard
from tolerances import FINITE_DIFFERENCE, IDENTITY

FREQUENCY_HZ = np.array([2.0, 11.0, 37.0, 61.0, 83.0, 149.0])
POSES = np.array([[-0.3, 0.5], [0.9, -1.1]])
LAWS = {
    "table": StiffnessLaw(0, "table", np.array([1.4, 1.0, 0.8, 0.75]), np.array([-0.5, 0.0, 0.1, 0.6])),
    "stiffness": StiffnessLaw(0, "stiffness", np.array([1.0, -0.4, 0.3])),
    "compliance": StiffnessLaw(0, "compliance", np.array([1.0, 0.9, -0.2])),
}


def linear_model(robot, configurations, outputs=None):
    model = build_model(robot)
    return linearize(model, solve_statics(model, configurations), outputs)


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_derivatives_of_a_law_are_its_own(law):
    factor, step = LawFactor(law), 1e-5
    position = np.array([-0.41, -0.13, 0.04, 0.37])
    found = factor.whole(position)
    behind, ahead = factor.whole(position - step), factor.whole(position + step)
    np.testing.assert_allclose((ahead.value - behind.value) / (2 * step), found.slope, rtol=1e-6)
    np.testing.assert_allclose((ahead.slope - behind.slope) / (2 * step), found.curvature, rtol=1e-6)
    np.testing.assert_array_equal(factor.value(position), found.value)


def test_a_table_is_met_and_held_beyond_its_ends():
    law = LAWS["table"]
    found = LawFactor(law)
    np.testing.assert_allclose(found.value(law.positions), law.values, rtol=IDENTITY)
    np.testing.assert_allclose(found.value(np.array([-9.0, 9.0])), [1.4, 0.75], rtol=IDENTITY)
    assert not found.whole(np.array([-9.0, 9.0])).slope.any()
    dense = found.value(np.linspace(-0.5, 0.6, 500))
    assert (np.diff(dense) <= 0).all()


@pytest.mark.parametrize("position", [-0.35, 0.0, 0.4])
@pytest.mark.parametrize("shafts", [0, 1, 2])
def test_ball_screw_is_its_chain_of_lumps(shafts, position):
    robot = ball_screw(shafts)
    model = linear_model(robot, np.array([[position]]), ("rail", "rail.arm"))
    found = response(model, nominal_parameters(robot, model, 0.0), FREQUENCY_HZ, None).sampled[0, :, :, 0]
    s, softer = 2j * np.pi * FREQUENCY_HZ, 1 / (1 + 0.9 * position)
    spring = softer * 3e7 + s * 2e3
    ratio, mass = 125.7, 51.0
    # From the slide back to the motor: what each lump feels of all that it drives, as torque per angle.
    reflected = spring * s**2 * mass / (spring + s**2 * mass) / ratio**2
    travel = spring / (spring + s**2 * mass) / ratio
    for number in range(shafts, 0, -1):
        load = reflected + s**2 * 2e-4 * number
        twist = 1.5e3 * number * (softer if number == shafts else 1.0) + s * 0.05
        reflected, travel = twist * load / (twist + load), travel * twist / (twist + load)
    motor = s**2 / (s**2 * 1e-3 + s * 2e-3 + reflected)
    np.testing.assert_allclose(found[:, 0], motor, rtol=1e-8)
    np.testing.assert_allclose(found[:, 1], motor * travel, rtol=1e-8)


def potential(model, position):
    """Energy of gravity and springs, from the description alone."""
    data = mujoco.MjData(model.mujoco)
    data.qpos[:] = position
    mujoco.mj_kinematics(model.mujoco, data)
    mujoco.mj_comPos(model.mujoco, data)
    total = -float(model.mujoco.body_mass @ data.xipos @ model.mujoco.opt.gravity)
    for spring, row in zip(model.robot.springs, model.deflection, strict=True):
        law, deflection = spring.stiffness_over, float(row @ position)
        factor = 1.0 if law is None else LawFactor(law).value(position[model.arm[law.joint]])
        total += float(factor) * (0.5 * spring.stiffness * deflection**2 + 0.25 * spring.cubic * deflection**4)
    return total


def central(function, position, step):
    moves = step * np.eye(position.size)
    return np.array([(function(position + move) - function(position - move)) / (2 * step) for move in moves])


def stiffening(robot):
    return replace(robot, springs=tuple(replace(each, cubic=30.0 * each.stiffness) for each in robot.springs))


@pytest.mark.parametrize("robot", [varying_arm(), stiffening(varying_arm())], ids=["linear", "cubic"])
def test_rest_is_where_the_potential_is_flat(robot):
    model = build_model(robot)
    rest = solve_statics(model, POSES)
    plain = solve_statics(build_model(two_joint_robot()), POSES)
    assert np.abs(rest.deflection / plain.deflection - 1).max() > 0.05
    for position, torque in zip(rest.position, rest.motor_torque, strict=True):
        slope = central(lambda at: potential(model, at), position, 1e-5)
        np.testing.assert_allclose(slope[model.passive], 0.0, atol=1e-6 * np.abs(slope[model.motor]).max() * 120)
        np.testing.assert_allclose(slope[model.motor], torque, rtol=1e-5)


def test_stiffness_is_the_potentials_second_derivative():
    robot = varying_arm()
    model = build_model(robot)
    rest = solve_statics(model, POSES)
    linear = linearize(model, rest)
    parameters = nominal_parameters(robot, linear, 0.0)
    for row, position in enumerate(rest.position):
        found = motion_matrices(linear, parameters, row)[2]
        hessian = central(lambda at: central(lambda x: potential(model, x), at, 1e-4), position, 1e-4)
        wanted = model.to_spring.T @ hessian @ model.to_spring
        loaded = np.s_[len(model.motor) :]
        size = np.abs(wanted).max()
        np.testing.assert_allclose(found[loaded, loaded], wanted[loaded, loaded], atol=1e-6 * size)
        # What moves with the position is not small beside that.
        springs = np.diag(linear.rest.factor[row] * parameters.stiffness)
        gravity = linearize(build_model(two_joint_robot()), rest).gravity_stiffness[row][loaded, loaded]
        assert np.abs(found[loaded, loaded] - springs - gravity).max() > 1e-4 * size


@pytest.mark.parametrize("form", ["table", "stiffness", "compliance"])
def test_a_constant_law_changes_nothing(form):
    positions = np.array([-3.0, 0.0, 3.0]) if form == "table" else np.zeros(0)
    law = StiffnessLaw(1, form, np.ones(3) if form == "table" else np.ones(1), positions)
    plain = springs_everywhere()
    same = replace(plain, springs=tuple(replace(spring, stiffness_over=law) for spring in plain.springs))
    models = [linear_model(robot, POSES) for robot in (plain, same)]
    found = [response(model, nominal_parameters(plain, model, 1e-3), FREQUENCY_HZ, 1e-3).sampled for model in models]
    np.testing.assert_allclose(found[1], found[0], rtol=1e-12)


@pytest.mark.parametrize("cubic", [False, True])
@pytest.mark.parametrize("kind", ["stiffness", "damping", "cubic", "motor_inertia"])
@pytest.mark.parametrize("case", ["arm", "screw"])
def test_jacobian_is_the_derivative(case, kind, cubic):
    robot, poses = (varying_arm(), POSES) if case == "arm" else (ball_screw(), np.array([[-0.3], [0.35]]))
    robot = stiffening(robot) if cubic else robot
    model = linear_model(robot, poses)
    parameters = nominal_parameters(robot, model, 1e-3)
    found = response(model, parameters, FREQUENCY_HZ, 1e-3)
    slopes = jacobian(model, parameters, found, (kind,))
    values = getattr(parameters, kind)
    for index, value in enumerate(values):
        step = 1e-4 * (value or 1e3)
        sides = []
        for sign in (-1, 1):
            moved = values.copy()
            moved[index] += sign * step
            sides.append(response(model, with_values(parameters, kind, moved), FREQUENCY_HZ, 1e-3).sampled)
        wanted = (sides[1] - sides[0]) / (2 * step)
        size = np.abs(wanted).max() + 1e-9 * np.abs(found.sampled).max() / step
        np.testing.assert_allclose(slopes[..., index], wanted, atol=100 * FINITE_DIFFERENCE * size)


@pytest.mark.parametrize("robot", [varying_arm(), ball_screw()], ids=["arm", "screw"])
def test_fast_and_general_response_agree(robot):
    poses = POSES if len(robot.joints) == 2 else np.array([[-0.3], [0.35]])
    model = linear_model(robot, poses)
    kinds = ("stiffness", "damping", "motor_inertia")
    parameters = nominal_parameters(robot, model, 1e-3)
    used = np.ones((2, FREQUENCY_HZ.size), bool)
    fast = Collocated(model, FREQUENCY_HZ, 1e-3, used, kinds)
    general = response(model, parameters, FREQUENCY_HZ, 1e-3)
    rows, columns = np.triu_indices(model.n_motor)
    wanted = general.sampled[:, :, rows, columns].reshape(-1, rows.size).T
    np.testing.assert_allclose(fast.response(parameters), wanted, rtol=1e-9)
    masks = tuple(np.ones(getattr(parameters, kind).size, bool) for kind in kinds)
    slopes = fast.derivatives(kinds, masks, np.ones(wanted.shape, complex))
    wanted = jacobian(model, parameters, general, kinds)[:, :, rows, columns]
    wanted = wanted.reshape(-1, rows.size, slopes.shape[0]).transpose(2, 1, 0)
    for own, other in zip(slopes, wanted, strict=True):
        np.testing.assert_allclose(own, other, atol=1e-9 * np.abs(other).max())


def test_shafts_of_a_rigid_drive_are_part_of_its_inertia():
    robot = ball_screw(2)
    model = build_rigid_model(robot)
    nominal = {each.name: each.nominal for each in model.parameters}
    assert nominal["rail.motor_inertia"] == pytest.approx(1e-3 + 2e-4 + 4e-4, rel=IDENTITY)
    changed = with_standard(robot, {"rail.motor_inertia": 2e-3}).robot
    assert changed.motor_inertia_kgm2[0] == pytest.approx(2e-3 - 6e-4, rel=IDENTITY)
