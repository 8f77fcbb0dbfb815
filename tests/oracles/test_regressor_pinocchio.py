"""The arm's regressor against Pinocchio's."""

import numpy as np
import pytest

from arm_regressor import arm_columns
from rigid_robots import random_chain, random_motion
from robid.robot.regressor.links import COMPONENTS
from tolerances import IDENTITY

pin = pytest.importorskip("pinocchio", reason="Pinocchio (`pin`) is not installed")

# Mass, first moments, then the upper triangle of the inertia column by column.
PINOCCHIO = ("M", "MX", "MY", "MZ", "XX", "XY", "YY", "XZ", "YZ", "ZZ")


def pinocchio_chain(robot):
    model = pin.Model()
    model.gravity = pin.Motion(np.concatenate([robot.gravity_m_s2, np.zeros(3)]))
    parent = 0
    for joint in robot.joints:
        kind = pin.JointModelPZ() if joint.type == "prismatic" else pin.JointModelRZ()
        parent = model.addJoint(parent, kind, pin.SE3(joint.rotation, joint.position_m), joint.name)
        body = pin.Inertia(joint.link.mass_kg, joint.link.com_m, joint.link.inertia_kgm2)
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
    return model


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("slides", [0.0, 0.5, 1.0])
def test_random_chains_of_revolute_and_prismatic_joints(seed, slides):
    robot = random_chain(seed, n_joint=3 + seed, slides=slides)
    model = pinocchio_chain(robot)
    data = model.createData()
    motion = random_motion(robot, 5) @ robot.arm_per_motor.T
    order = [10 * body + COMPONENTS.index(name) for body in range(len(robot.joints)) for name in PINOCCHIO]
    found = arm_columns(robot, *motion)[:, :, order]
    for own, position, velocity, acceleration in zip(found, *motion, strict=True):
        wanted = pin.computeJointTorqueRegressor(model, data, position, velocity, acceleration)
        np.testing.assert_allclose(own, wanted, rtol=0, atol=IDENTITY * np.abs(wanted).max())
