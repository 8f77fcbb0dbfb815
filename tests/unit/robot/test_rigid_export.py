"""A rigid robot in the formats of other programs: MuJoCo and Pinocchio compute the same torques from them."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from exact_systems import with_arm_friction
from rigid_robots import planar_arm, random_chain, random_motion
from robid.errors import DataError
from robid.robot.chain import extract_chain
from robid.robot.description import HarmonicBalance
from robid.robot.export import to_rigid_mjcf, to_urdf
from robid.robot.foreign import read_model
from robid.robot.inertia import roll_pitch_yaw
from robid.robot.regressor.drives import RigidOptions
from robid.robot.regressor.links import standard_parameters
from robid.robot.regressor.model import build_rigid_model
from tolerances import IDENTITY

VISCOUS = RigidOptions(friction="viscous", offsets=False)


def coupled(robot):
    """Motors of which each moves the next joint but one too."""
    joints = list(robot.joints)
    for index in range(2, len(joints)):
        joints[index] = replace(joints[index], couplings={joints[index - 2].name: 0.004})
    return replace(robot, joints=tuple(joints))


def rubbing(robot):
    """Coupled motors, and viscous friction of the arms."""
    robot = coupled(robot)
    return with_arm_friction(robot, *np.arange(2.0, 2.0 + len(robot.joints)))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("own", [lambda robot: robot, coupled, rubbing], ids=["apart", "coupled", "arms that rub"])
def test_mujoco_computes_the_models_torques_from_the_mjcf(seed, own):
    robot = own(random_chain(seed))
    compiled = mujoco.MjModel.from_xml_string(to_rigid_mjcf(robot, "header"))
    compiled.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_LIMIT) | int(mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS)
    motion = random_motion(robot, 6)
    model, data = build_rigid_model(robot, VISCOUS), mujoco.MjData(compiled)
    wanted = model.torques(model.nominal, *motion)
    for torque, *state in zip(wanted, *motion, strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = (robot.arm_per_motor @ each for each in state)
        mujoco.mj_inverse(compiled, data)
        found = robot.arm_per_motor.T @ data.qfrc_inverse
        np.testing.assert_allclose(found, torque, rtol=0, atol=IDENTITY * np.abs(torque).max())


@pytest.mark.parametrize("own", [lambda robot: robot, coupled], ids=["apart", "coupled"])
def test_controls_are_motor_torques_and_friction_is_a_choice(own):
    robot = own(random_chain(5))
    model = mujoco.MjModel.from_xml_string(to_rigid_mjcf(robot, "header"))
    data = mujoco.MjData(model)
    torque = np.arange(1.0, 6.0)
    data.ctrl[:] = torque
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.qfrc_actuator, robot.motor_per_arm.T @ torque, rtol=1e-9)
    np.testing.assert_allclose(model.actuator_ctrlrange[:, 1], 20.0)
    levels = [joint.motor.friction.coulomb_nm for joint in robot.joints]
    single = [np.flatnonzero(turns).size == 1 for turns in robot.motor_per_arm]
    wanted = [level * abs(ratio) for level, ratio, one in zip(levels, robot.gear_ratio, single, strict=True) if one]
    np.testing.assert_allclose(model.dof_frictionloss[np.flatnonzero(model.dof_frictionloss)], wanted, rtol=1e-9)
    wanted = [level for level, one in zip(levels, single, strict=True) if not one]
    np.testing.assert_allclose(model.tendon_frictionloss, wanted, rtol=1e-9)
    smooth = mujoco.MjModel.from_xml_string(to_rigid_mjcf(robot, "header", friction=False))
    assert not smooth.dof_damping.any()
    assert not smooth.dof_frictionloss.any()
    assert not smooth.tendon_frictionloss.any()


@pytest.mark.parametrize("seed", range(4))
def test_pinocchio_computes_the_links_torques_from_the_urdf(seed, tmp_path):
    pin = pytest.importorskip("pinocchio", reason="Pinocchio (`pin`) is not installed")
    robot = random_chain(seed)
    path = tmp_path / "robot.urdf"
    path.write_text(to_urdf(robot, "a -- header"))
    foreign = pin.buildModelFromUrdf(str(path))
    foreign.gravity = pin.Motion(np.concatenate([robot.gravity_m_s2, np.zeros(3)]))
    assert list(foreign.names)[1:] == [joint.name for joint in robot.joints]
    model = build_rigid_model(robot, RigidOptions(friction="none", offsets=False, motor_inertias=False))
    motion, data = random_motion(robot, 5), foreign.createData()
    for torque, *state in zip(model.torques(model.nominal, *motion), *motion, strict=True):
        found = robot.arm_per_motor.T @ pin.rnea(foreign, data, *(robot.arm_per_motor @ each for each in state))
        np.testing.assert_allclose(found, torque, rtol=0, atol=IDENTITY * np.abs(torque).max())


@pytest.mark.parametrize("writer", [to_urdf, to_rigid_mjcf])
def test_frames_links_and_limits_are_read_back(writer, tmp_path):
    robot = random_chain(7)
    path = tmp_path / "robot.xml"
    path.write_text(writer(robot, "header"))
    names = [joint.name for joint in robot.joints]
    foreign = read_model(path)
    for joint, found in zip(robot.joints[:-1], extract_chain(foreign, names, {})[:-1], strict=True):
        np.testing.assert_allclose(found.position_m, joint.position_m, atol=1e-11)
        np.testing.assert_allclose(found.rotation, joint.rotation, atol=1e-11)
        np.testing.assert_allclose(found.range, (joint.lower, joint.upper), rtol=1e-11)
        np.testing.assert_allclose(standard_parameters(found.link), standard_parameters(joint.link), rtol=1e-9)
        assert foreign.torque[joint.name] == pytest.approx(20.0 * abs(joint.motor.gear_ratio))


EXACTLY_UP = np.array([[0.0, 0.6, 0.8], [0.0, 0.8, -0.6], [-1.0, 0.0, 0.0]])


@pytest.mark.parametrize(
    "turn", [EXACTLY_UP, *(roll_pitch_yaw((20.0, pitch, -70.0)) for pitch in (90.0, -90.0, 89.99))]
)
def test_a_frame_that_looks_straight_up_keeps_its_turn(turn, tmp_path):
    robot = random_chain(3)
    robot = replace(robot, joints=(replace(robot.joints[0], rotation=turn), *robot.joints[1:]))
    path = tmp_path / "robot.urdf"
    path.write_text(to_urdf(robot, ""))
    names = [joint.name for joint in robot.joints]
    np.testing.assert_allclose(extract_chain(read_model(path), names, {})[0].rotation, turn, atol=1e-9)


def test_what_a_format_cannot_hold_is_refused_by_name():
    arm = planar_arm(2)
    balance = HarmonicBalance(np.ones(1), np.zeros(1))
    balanced = replace(arm, joints=(replace(arm.joints[0], counterbalance=balance), arm.joints[1]))
    with pytest.raises(DataError, match="counterbalance of `joint1`"):
        to_rigid_mjcf(balanced, "")
    with pytest.raises(DataError, match="rotors that ride on the links"):
        to_rigid_mjcf(replace(arm, rotor="on_link"), "")
    assert "joint1" in to_urdf(balanced, "")
