"""Poses, Jacobians and inverse kinematics of rigid arms against independent formulas."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robid.robot.kinematics import ToolArm, reach_poses, skeleton
from robid.settings.load import load_robot
from robid.settings.robot_parts import tool_arm
from robid.signals.pose import displacement, rotation_from_zyx
from tolerances import FINITE_DIFFERENCE, IDENTITY

ROOT = Path(__file__).parents[3]
HOME = np.deg2rad([0.0, -90, 90, 10, 45, 20])
FLAT_HOME = np.deg2rad([40.0, -70, 30])


@pytest.fixture(scope="module")
def arm():
    file = load_robot(ROOT / "configs/robots/kr300_pose.yaml")
    return tool_arm(file, file.to_robot())


@pytest.fixture(scope="module")
def flat():
    file = load_robot(ROOT / "tests/stages/pose_arm.yaml")
    return tool_arm(file, file.to_robot())


def test_poses_are_those_of_the_skeleton_seen_from_the_carriage(arm):
    angles = np.random.default_rng(1).uniform(-2, 2, (2, 5, 6))
    position, rotation = arm.poses(angles)
    rail = np.full((10, 1), 1.3)
    tool = skeleton(arm.robot, np.hstack([rail, angles.reshape(-1, 6)]), arm.tool_m)[:, -1].reshape(2, 5, 3)
    carriage = arm.robot.joints[0].rotation
    np.testing.assert_allclose(position @ carriage.T + 1.3 * carriage[:, 2], tool, atol=IDENTITY)
    beyond = replace(arm, tool_m=arm.tool_m + arm.tool_rotation[:, 0])
    np.testing.assert_allclose(beyond.poses(angles)[0] - position, rotation[..., 0], atol=IDENTITY)


@pytest.mark.parametrize("which", ["arm", "gantry"])
def test_jacobians_are_the_slopes_of_the_poses(which, arm):
    if which == "gantry":
        robot = load_robot(ROOT / "configs/robots/gantry.yaml").to_robot()
        arm = ToolArm(robot, 0, np.array([0.1, 0.2, 0.3]), np.eye(3))
    angles = np.random.default_rng(2).uniform(-1, 1, len(arm.joints))
    step = 1e-6 * np.eye(len(angles))
    up, down = arm.poses(angles + step), arm.poses(angles - step)
    turned = (up[1] - down[1]) / 2e-6 @ arm.poses(angles)[1].T
    turning = np.stack([turned[:, 2, 1], turned[:, 0, 2], turned[:, 1, 0]])
    expected = np.concatenate([((up[0] - down[0]) / 2e-6).T, turning])
    np.testing.assert_allclose(arm.jacobian(angles), expected, atol=FINITE_DIFFERENCE)
    about = displacement(*arm.poses(angles), up[0], up[1])
    np.testing.assert_allclose(arm.in_home(angles), about.T / 1e-6, atol=3e-5)


def test_displaced_poses_are_reached_on_the_branch_of_home(arm):
    size = np.array([0.25, 0.2, 0.15, 0.5, 0.4, 0.5])
    wanted = np.sin(np.linspace(0, 6, 300))[:, None] * size
    reached = reach_poses(arm, HOME, wanted)
    assert reached.is_whole
    found = displacement(*arm.poses(HOME), *arm.poses(reached.positions))
    np.testing.assert_allclose(found, wanted, atol=IDENTITY)
    assert np.abs(np.diff(reached.positions, axis=0)).max() < 0.1, "no sample jumps to another branch"


def test_large_moves_of_the_papers_size_are_reached(arm):
    for channel, size in ((0, -0.6), (1, 0.6), (2, 0.6), (3, np.deg2rad(35)), (4, np.deg2rad(35)), (5, np.deg2rad(35))):
        assert reach_poses(arm, HOME, size * np.eye(6)[[channel]]).is_whole


def test_a_straight_wrist_is_named(arm):
    home = np.deg2rad([0.0, -90, 90, 0, 0, 0])
    reached = reach_poses(arm, home, 0.01 * np.eye(6)[[5]])
    assert not reached.is_whole
    assert reached.loose.tolist() == [False, False, False, True, False, True]


def test_a_wrist_that_is_straight_at_the_end_is_refused(arm):
    bent, straight = np.deg2rad([[0.0, -90, 90, 0, 20, 0], [0.0, -90, 90, 0, 0, 0]])
    way = displacement(*arm.poses(bent), *(each[None] for each in arm.poses(straight)))
    assert reach_poses(arm, bent, 0.9 * way).is_whole
    reached = reach_poses(arm, bent, way)
    assert 0.98 < reached.share[0] < 1
    assert reached.loose.tolist() == [False, False, False, True, False, True]


def test_poses_beyond_the_arm_end_where_it_is_stretched_out(arm):
    reached = reach_poses(arm, HOME, np.array([[0.1, 0, 0, 0, 0, 0], [-3.0, 0, 0, 0, 0, 0]]))
    assert reached.share[0] == 1
    assert np.isfinite(reached.positions).all()
    # The wrist's centre is farthest from axis 2 where the elbow is straight, its offset of 41 mm included.
    points = skeleton(arm.robot, np.append(0.0, reached.positions[1])[None], arm.tool_m)[0]
    assert np.linalg.norm(points[7] - points[3]) == pytest.approx(1.15 + np.hypot(1.0, 0.041), rel=2e-4)
    assert reached.loose[[1, 2]].all()


def test_a_flat_arm_reaches_what_lies_in_its_plane_and_nothing_else(flat):
    within = np.array([[0.1, 0.05, 0, 0.3, 0, 0]])
    reached = reach_poses(flat, FLAT_HOME, within)
    assert reached.is_whole
    np.testing.assert_allclose(
        displacement(*flat.poses(FLAT_HOME), *flat.poses(reached.positions)), within, atol=IDENTITY
    )
    assert not reach_poses(flat, FLAT_HOME, np.array([[0, 0, 0.01, 0, 0, 0]])).is_whole
    assert not reach_poses(flat, FLAT_HOME, np.array([[0, 0, 0, 0, 0.01, 0]])).is_whole


def test_an_arm_of_seven_joints_moves_as_little_as_it_can(arm):
    """The same arm with its last axis twice: the turns are shared."""
    first, last = arm.robot.joints[-2:]
    doubled = replace(last, name="axis_7", position_m=np.zeros(3), rotation=np.eye(3))
    robot = replace(arm.robot, joints=(*arm.robot.joints, doubled), springs=())
    seven = ToolArm(robot, 1, arm.tool_m, arm.tool_rotation)
    home = np.append(HOME, 0.0)
    reached = reach_poses(seven, home, np.array([[0, 0, 0, 0.4, 0, 0]]))
    assert reached.is_whole
    turns = reached.positions[0] - home
    assert first.name == "axis_5"
    assert turns[-1] == pytest.approx(turns[-2], rel=1e-6)
    assert abs(turns[-1]) == pytest.approx(0.2, rel=0.02)


def test_poses_and_jacobians_are_pinocchios(arm):
    pin = pytest.importorskip("pinocchio", reason="Pinocchio (`pin`) is not installed")
    model, parent = pin.Model(), 0
    for joint in arm.joints:
        placement = pin.SE3(joint.rotation, joint.position_m)
        parent = model.addJoint(parent, pin.JointModelRZ(), placement, joint.name)
    tool = model.addFrame(pin.Frame("tool", parent, 0, pin.SE3(arm.tool_rotation, arm.tool_m), pin.FrameType.OP_FRAME))
    data = model.createData()
    for angles in np.random.default_rng(3).uniform(-2, 2, (5, 6)):
        jacobian = pin.computeFrameJacobian(model, data, angles, tool, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        pin.framesForwardKinematics(model, data, angles)
        position, rotation = arm.poses(angles)
        np.testing.assert_allclose(position, data.oMf[tool].translation, atol=IDENTITY)
        np.testing.assert_allclose(rotation, data.oMf[tool].rotation, atol=IDENTITY)
        np.testing.assert_allclose(arm.jacobian(angles), jacobian, atol=IDENTITY)


def test_the_tool_of_the_robot_file_lies_in_the_last_link(flat):
    file = load_robot(ROOT / "tests/stages/pose_arm.yaml")
    turned = replace(file.pose_interface, tool_abc_deg=(90.0, 0.0, 0.0))
    own = tool_arm(file.model_copy(update={"pose_interface": turned}), flat.robot)
    np.testing.assert_allclose(own.tool_m, [0.15, 0, 0], atol=IDENTITY)
    np.testing.assert_allclose(own.tool_rotation, rotation_from_zyx(np.array([np.pi / 2, 0, 0])), atol=IDENTITY)
    assert flat.channels == ("X", "Y", "Z", "R", "A", "B", "C")
