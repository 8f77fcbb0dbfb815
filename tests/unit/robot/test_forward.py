"""Forward dynamics of rigid models: the inverse undone, and friction that bends where it would jump."""

from dataclasses import replace

import numpy as np
import pytest

from rigid_robots import planar_arm, random_chain, random_motion, with_gears
from robid.robot.description import SpringBalance
from robid.robot.friction import Friction
from robid.robot.regressor.base import find_base_parameters
from robid.robot.regressor.drives import RigidOptions
from robid.robot.regressor.forward import build_dynamics
from robid.robot.regressor.model import build_rigid_model
from tolerances import IDENTITY


def close(found, wanted, tolerance=IDENTITY):
    np.testing.assert_allclose(found, wanted, rtol=0, atol=tolerance * np.abs(wanted).max())


@pytest.mark.parametrize("rotor", ["spong", "on_link"])
@pytest.mark.parametrize("form", ["coulomb", "asymmetric", "load", "quadratic"])
def test_forward_dynamics_undoes_the_inverse(rotor, form):
    robot = replace(with_gears(random_chain(12)), rotor=rotor)
    spring = SpringBalance(np.array([-0.2, 0.5, 0.1]), np.array([0.3, -0.1, 0.4]), 0.35, 4e3, 120.0)
    robot = replace(robot, joints=(replace(robot.joints[0], counterbalance=spring), *robot.joints[1:]))
    model = build_rigid_model(robot, RigidOptions(friction=form, payload="body"))
    generator = np.random.default_rng(4)
    parameters = model.nominal * generator.uniform(0.9, 1.1, len(model.names)) + 1e-3 * (model.nominal == 0)
    motion, load = random_motion(robot, 6), generator.standard_normal((6, 5))
    for loaded in (True, False):
        torque = model.torques(parameters, *motion, torque=load, loaded=loaded)
        dynamics = build_dynamics(model, parameters, loaded=loaded)
        inertia, bias = dynamics.inertia_and_bias(motion[0], motion[1], load)
        close(np.einsum("nij,nj->ni", inertia, motion[2]) + bias, torque)
        if form != "load":
            close(dynamics.acceleration(motion[0], motion[1], torque), motion[2], 1e3 * IDENTITY)


def test_smoothed_friction_bends_where_it_would_jump():
    robot = planar_arm(1, gravity=0.0)
    motor = replace(robot.joints[0].motor, friction=Friction(coulomb_nm=2.0))
    robot = replace(robot, joints=(replace(robot.joints[0], motor=motor),))
    speed = np.array([[-1.0], [-0.05], [0.0], [0.05], [1.0]])
    model, still = build_rigid_model(robot), np.zeros((5, 1))
    for smoothing, wanted in ((0.0, np.sign(speed)), (0.1, np.tanh(speed / 0.1))):
        _, bias = build_dynamics(model, smoothing_rad_s=smoothing).inertia_and_bias(still, speed)
        np.testing.assert_allclose(bias, 2.0 * wanted, atol=1e-12)


def test_base_parameters_move_the_robot_as_the_standard_ones_do():
    robot = with_gears(random_chain(13))
    model, motion = build_rigid_model(robot), random_motion(robot, 6)
    base = find_base_parameters(model)
    dynamics = build_dynamics(model.only(base.columns.tolist()), base.values(model.nominal))
    torque = model.torques(model.nominal, *motion)
    close(dynamics.acceleration(motion[0], motion[1], torque), motion[2], 1e3 * IDENTITY)


def test_every_sample_may_have_parameters_of_its_own():
    robot = with_gears(random_chain(14))
    model, (position, velocity, _) = build_rigid_model(robot), random_motion(robot, 4)
    torque = np.random.default_rng(5).standard_normal(position.shape)
    parameters = model.nominal * np.random.default_rng(6).uniform(0.8, 1.2, (4, len(model.names)))
    together = build_dynamics(model, parameters).acceleration(position, velocity, torque)
    for row in range(4):
        one = slice(row, row + 1)
        alone = build_dynamics(model, parameters[row]).acceleration(position[one], velocity[one], torque[one])
        close(together[one], alone, 1e3 * IDENTITY)
