"""Viscous friction of arms, where it is not the motors': against MuJoCo, and as a rigid drive feels it."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from exact_systems import (
    arm_on_rail,
    springs_everywhere,
    two_joint_robot,
    two_mass_robot,
    with_arm_friction,
    without_spring,
)
from rigid_robots import planar_arm
from robid.models.elastic.fit.solution import with_estimates
from robid.robot.export import to_mjcf
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.parameters import element_names, element_units
from robid.robot.regressor.drives import RigidOptions
from robid.robot.regressor.model import build_rigid_model
from robid.robot.response import motion_matrices, nominal_parameters
from robid.robot.standard import with_standard
from robid.robot.statespace import state_space
from tolerances import IDENTITY

STEP = 1e-6
CASES = {
    "two joints": (with_arm_friction(two_joint_robot(), 60.0, 25.0), np.array([[-0.3, 0.5]])),
    "rotors on the links": (with_arm_friction(two_joint_robot("on_link"), 60.0, 25.0), np.array([[-0.3, 0.5]])),
    "coupled, springs everywhere": (with_arm_friction(springs_everywhere(), 60.0, 25.0), np.array([[-0.3, 0.5]])),
    "arm on a rail": (with_arm_friction(arm_on_rail(), 4e3, 60.0, 25.0), np.array([[0.4, -0.3, 0.5]])),
    "rigid elbow": (
        with_arm_friction(without_spring(two_joint_robot(), "gear_2"), 60.0, 25.0), np.array([[-0.3, 0.5]]),
    ),
}  # fmt: skip


def mujoco_damping(model, position):
    """Damping matrix (n_dof, n_dof) in MuJoCo's coordinates: minus the passive forces' slope in speed."""
    data, columns = mujoco.MjData(model.mujoco), []
    data.qpos[:] = position
    for unit in np.eye(model.mujoco.nv):
        forces = []
        for side in (-1.0, 1.0):
            data.qvel[:] = side * unit
            mujoco.mj_forward(model.mujoco, data)
            forces.append(data.qfrc_passive.copy())
        columns.append(-0.5 * (forces[1] - forces[0]))
    return np.array(columns).T


@pytest.mark.parametrize("case", CASES)
def test_dampers_are_those_of_the_simulator(case):
    robot, at = CASES[case]
    model = build_model(robot)
    rest = solve_statics(model, at)
    linear = linearize(model, rest)
    found = motion_matrices(linear, nominal_parameters(robot, linear, 0.0), 0)[1]
    wanted = model.to_spring.T @ mujoco_damping(model, rest.position[0]) @ model.to_spring
    np.testing.assert_allclose(found, wanted, rtol=0, atol=IDENTITY * np.abs(wanted).max())
    without = replace(robot, joints=tuple(replace(joint, arm_viscous=0.0) for joint in robot.joints))
    still = motion_matrices(linear, nominal_parameters(without, linear, 0.0), 0)[1]
    assert np.abs(found - still).max() > 0.01 * np.abs(wanted).max()


@pytest.mark.parametrize("case", [case for case in CASES if case != "rigid elbow"])
def test_the_state_space_is_mujocos_own_linearisation(case):
    robot, at = CASES[case]
    model = build_model(robot, timestep_s=STEP)
    rest = solve_statics(model, at)
    linear = linearize(model, rest)
    names = tuple(joint.name for joint in robot.joints), tuple(spring.name for spring in robot.springs)
    ours = state_space(linear, nominal_parameters(robot, linear, 0.0), 0, *names, names[0])
    model.mujoco.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    data, n = mujoco.MjData(model.mujoco), model.mujoco.nv
    data.qpos[:], data.ctrl[: len(robot.joints)] = rest.position[0], rest.motor_torque[0]
    moved = np.zeros((2 * n, 2 * n))
    mujoco.mjd_transitionFD(model.mujoco, data, 1e-6, 1, moved, None, None, None)
    slopes = (moved[n:, n:] - np.eye(n)) / STEP
    wanted = np.linalg.solve(model.to_spring, slopes @ model.to_spring)
    np.testing.assert_allclose(ours.A[n:, n:], wanted, rtol=0, atol=2e-3 * np.abs(wanted).max())


def test_an_exported_arm_rubs():
    robot, at = CASES["two joints"]
    model = build_model(robot)
    again = mujoco.MjModel.from_xml_string(to_mjcf(model, solve_statics(model, at), ("rest",), "header"))
    assert [float(again.joint(f"q_a_{name}").damping[0]) for name in ("shoulder", "elbow")] == [60.0, 25.0]


def test_a_rigid_drive_feels_it_as_its_own():
    """Behind a rigid gear both frictions are one, and what a rigid fit finds of them goes back to the motor."""
    robot = with_arm_friction(planar_arm(1), 3.0)
    ratio, own = robot.joints[0].motor.gear_ratio, robot.joints[0].motor.friction.viscous_nms_rad
    model = build_rigid_model(robot, RigidOptions(friction="viscous", offsets=False))
    values = dict(zip(model.names, model.nominal.tolist(), strict=True))
    assert values["joint1.viscous"] == pytest.approx(own + 3.0 / ratio**2)
    joint = with_standard(robot, {"joint1.viscous": 2 * values["joint1.viscous"]}).robot.joints[0]
    assert joint.arm_viscous == 3.0
    assert joint.motor.friction.viscous_nms_rad == pytest.approx(2 * own + 3.0 / ratio**2)


def test_names_and_units_and_the_way_back_into_a_robot():
    robot = CASES["arm on a rail"][0]
    assert element_names(robot, "arm_viscous") == ["rail.arm_viscous", "shoulder.arm_viscous", "elbow.arm_viscous"]
    assert element_units(robot, "arm_viscous") == ["N s/m", "N m s/rad", "N m s/rad"]
    changed = with_estimates(robot, {"shoulder.arm_viscous": 7.0}, {})
    assert [joint.arm_viscous for joint in changed.joints] == [4e3, 7.0, 25.0]


def test_a_rigid_joint_has_one_friction_only():
    assert element_names(CASES["rigid elbow"][0], "arm_viscous") == ["shoulder.arm_viscous", None]
    assert element_names(two_mass_robot(), "arm_viscous") == ["drive.arm_viscous"]
