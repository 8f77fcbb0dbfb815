"""The elastic model's inertia and gravity against Pinocchio, every spring's axis included."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from exact_systems import springs_everywhere, two_joint_robot, with_spring_factors
from robid.robot.description import Inertial
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.settings.load import load_robot

pin = pytest.importorskip("pinocchio", reason="Pinocchio (`pin`) is not installed")

MASSLESS = Inertial(1e-6, np.zeros(3), 1e-6 * np.eye(3))
ROBOT_FILE = Path(__file__).parents[2] / "configs" / "robots" / "kr300.yaml"


def add_inertia(model, body, inertial, origin, sign=1.0):
    """Adds (or takes away, as moments add) mass properties to a Pinocchio joint's body."""
    inertia = pin.Inertia(inertial.mass_kg, inertial.com_m - origin, inertial.inertia_kgm2)
    model.inertias[body] = pin.Inertia.FromDynamicParameters(
        model.inertias[body].toDynamicParameters() + sign * inertia.toDynamicParameters()
    )


def pinocchio_arm(robot):
    """The arm with its bearings, split links and the rotors it carries; and the names of its coordinates."""
    model = pin.Model()
    model.gravity = pin.Motion(np.concatenate([robot.gravity_m_s2, np.zeros(3)]))
    parent, offset, names = 0, np.zeros(3), []

    def add(kind, placement, name):
        names.append(name)
        return model.addJoint(parent, kind, placement, name)

    beneath = [spring for spring in robot.springs if spring.place == "base"]
    for spring in beneath:
        place = pin.SE3(np.eye(3), spring.point_m - offset)
        parent = add(pin.JointModelRevoluteUnaligned(spring.axis), place, f"q_e_{spring.name}")
        offset = spring.point_m
        if spring is not beneath[-1] or robot.base is None:
            add_inertia(model, parent, MASSLESS, np.zeros(3))
        else:
            add_inertia(model, parent, robot.base, offset)
    for index, joint in enumerate(robot.joints):
        placement = pin.SE3(joint.rotation, joint.position_m - offset)
        if robot.rotor == "on_link":
            rotor = add(pin.JointModelRZ(), placement, f"q_m_{joint.name}")
            inertia = joint.motor.inertia_kgm2 * np.diag([0.5, 0.5, 1.0])
            add_inertia(model, rotor, Inertial(1e-6, np.zeros(3), inertia), np.zeros(3))
        springs = [spring for spring in robot.springs if spring.joint == index]
        for spring in springs:
            if spring.place == "bearing":
                parent = add(pin.JointModelRevoluteUnaligned(spring.axis), placement, f"q_e_{spring.name}")
                placement = pin.SE3.Identity()
        parent, offset = add(pin.JointModelRZ(), placement, f"q_a_{joint.name}"), np.zeros(3)
        add_inertia(model, parent, joint.link, offset)
        for spring in springs:
            if spring.place == "split":
                add_inertia(model, parent, spring.outboard, offset, sign=-1.0)
                place = pin.SE3(np.eye(3), spring.point_m)
                parent = add(pin.JointModelRevoluteUnaligned(spring.axis), place, f"q_e_{spring.name}")
                offset = spring.point_m
                add_inertia(model, parent, spring.outboard, offset)
    hung = [spring for spring in robot.springs if spring.place == "payload"]
    for spring in hung:
        place = pin.SE3(np.eye(3), spring.point_m - offset)
        parent = add(pin.JointModelRevoluteUnaligned(spring.axis), place, f"q_e_{spring.name}")
        if spring is not hung[-1]:
            add_inertia(model, parent, MASSLESS, np.zeros(3))
        offset = spring.point_m
    if robot.payload.mass_kg > 0:
        add_inertia(model, parent, robot.payload, offset)
    return model, names


def kr300():
    return load_robot(ROBOT_FILE).to_robot()


@pytest.mark.parametrize("rotor", ["spong", "on_link"])
@pytest.mark.parametrize("build", [kr300, two_joint_robot, springs_everywhere])
def test_inertia_and_gravity_at_any_position(build, rotor):
    robot = replace(build(), rotor=rotor)
    elastic = build_model(robot)
    arm, names = pinocchio_arm(robot)
    at = np.array([elastic.mujoco.joint(name).dofadr[0] for name in names])
    assert set(elastic.passive) <= set(at)
    data, reference = mujoco.MjData(elastic.mujoco), arm.createData()
    generator = np.random.default_rng(1)
    mass = np.zeros((elastic.mujoco.nv, elastic.mujoco.nv))
    for _ in range(5):
        position = generator.uniform(-1, 1, len(names))
        data.qpos[:] = 0.0
        data.qpos[at] = position
        mujoco.mj_forward(elastic.mujoco, data)
        mujoco.mj_fullM(elastic.mujoco, data, mass)
        wanted = pin.crba(arm, reference, position)
        wanted = np.triu(wanted) + np.triu(wanted, 1).T
        size = np.sqrt(np.diag(wanted))
        np.testing.assert_allclose((mass[np.ix_(at, at)] - wanted) / np.outer(size, size), 0.0, atol=1e-9)
        gravity = pin.computeGeneralizedGravity(arm, reference, position)
        np.testing.assert_allclose(data.qfrc_bias[at], gravity, atol=1e-9 * np.abs(gravity).max())


def test_inertia_of_the_arm_with_locked_springs_in_spring_coordinates():
    robot = kr300()
    elastic = build_model(robot)
    arm, names = pinocchio_arm(robot)
    configuration = np.deg2rad([[20.0, -70.0, 60.0, 30.0, 40.0, -50.0]])
    rigid = build_model(with_spring_factors(robot, 1e9))
    linear = linearize(rigid, solve_statics(rigid, configuration))
    position = np.zeros(len(names))
    rows = [names.index(f"q_a_{joint.name}") for joint in robot.joints]
    position[rows] = configuration[0]
    wanted = pin.crba(arm, arm.createData(), position)
    wanted = (np.triu(wanted) + np.triu(wanted, 1).T)[np.ix_(rows, rows)]
    whole = linear.mass[0] + np.einsum("l,lij->ij", linear.axial, linear.link_inertia[0])
    # With locked springs the arm follows the motors through the gears.
    found = whole[:6, :6] * np.outer(robot.gear_ratio, robot.gear_ratio)
    np.testing.assert_allclose(found, wanted, atol=1e-6 * np.abs(wanted).max())
    assert elastic.mujoco.nv == linear.mass.shape[-1]


@pytest.mark.parametrize("build", [kr300, two_joint_robot, springs_everywhere])
def test_gravity_gradient_in_spring_coordinates(build):
    robot = build()
    elastic = build_model(robot)
    arm, names = pinocchio_arm(robot)
    at = np.array([elastic.mujoco.joint(name).dofadr[0] for name in names])
    middle = 0.5 * (robot.lower + robot.upper) + 0.2
    rest = solve_statics(elastic, middle[None])
    linear = linearize(elastic, rest)
    reference, position, step = arm.createData(), rest.position[0, at], 1e-6
    columns = []
    for index in range(len(names)):
        move = np.zeros(len(names))
        move[index] = step
        ahead = pin.computeGeneralizedGravity(arm, reference, position + move).copy()
        behind = pin.computeGeneralizedGravity(arm, reference, position - move).copy()
        columns.append((ahead - behind) / (2 * step))
    gradient = np.zeros((elastic.mujoco.nv, elastic.mujoco.nv))
    gradient[np.ix_(at, at)] = np.array(columns).T
    coordinates = np.vstack([np.eye(elastic.mujoco.nv)[elastic.motor], elastic.deflection])
    found = coordinates.T @ linear.gravity_stiffness[0] @ coordinates
    np.testing.assert_allclose(found, gradient, atol=1e-6 * np.abs(gradient).max())
