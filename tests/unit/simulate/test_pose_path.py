"""Commands to joint motion: delay, average, inverse kinematics and back."""

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from robid.settings.load import load_robot
from robid.settings.robot_parts import tool_arm
from robid.simulate.options import PoseInterface
from robid.simulate.pose_path import channel_matrix, channel_motion, command_matrix, followed, joint_path
from tolerances import FINITE_DIFFERENCE, IDENTITY

ROOT = Path(__file__).parents[3]
HOME = np.array([1.0, *np.deg2rad([0.0, -90, 90, 10, 45, 20])])
CHANNELS = ("R", "B", "X")


@pytest.fixture(scope="module")
def arm():
    file = load_robot(ROOT / "configs/robots/kr300_pose.yaml")
    return tool_arm(file, file.to_robot())


@pytest.mark.parametrize(("delay", "average"), [(0, 1), (3, 1), (0, 4), (2, 3)])
def test_commands_come_late_and_averaged(delay, average):
    commands = np.random.default_rng(1).standard_normal((2, 30, 3))
    response = np.concatenate([np.zeros(delay), np.full(average, 1 / average)])
    expected = lfilter(response, [1.0], commands, axis=1)
    interface = PoseInterface(delay_samples=delay, moving_average=average)
    np.testing.assert_allclose(followed(commands, interface), expected, atol=IDENTITY)


def test_joints_go_where_the_channels_are_told(arm):
    commands = np.random.default_rng(2).standard_normal((2, 20, 3)) * [0.3, 0.2, 0.1]
    path = joint_path(arm, CHANNELS, HOME, commands)
    assert path.share.min() == 1
    np.testing.assert_allclose(channel_motion(arm, CHANNELS, HOME, path.positions), commands, atol=IDENTITY)
    others = channel_motion(arm, ("Y", "Z", "A", "C"), HOME, path.positions)
    np.testing.assert_allclose(others, 0, atol=IDENTITY)


def test_the_rail_moves_the_arm_along_and_no_channel_of_the_pose(arm):
    commands = np.array([[[0.0, 0, 0], [0.4, 0, 0]]])
    positions = joint_path(arm, CHANNELS, HOME, commands).positions[0]
    np.testing.assert_allclose(positions[1] - positions[0], [0.4, 0, 0, 0, 0, 0, 0], atol=IDENTITY)


def test_small_motions_follow_the_matrices(arm):
    told = command_matrix(arm, CHANNELS, HOME)
    np.testing.assert_allclose(channel_matrix(arm, CHANNELS, HOME) @ told, np.eye(3), atol=IDENTITY)
    step = 1e-6
    commands = step * np.concatenate([np.eye(3), -np.eye(3)])[None]
    up, down = np.split(joint_path(arm, CHANNELS, HOME, commands).positions[0], 2)
    np.testing.assert_allclose(((up - down) / (2 * step)).T, told, atol=FINITE_DIFFERENCE * np.abs(told).max())
    both = HOME + step * np.concatenate([np.eye(7), -np.eye(7)])
    forth, back = np.split(channel_motion(arm, CHANNELS, HOME, both), 2)
    moves = channel_matrix(arm, CHANNELS, HOME)
    np.testing.assert_allclose(((forth - back) / (2 * step)).T, moves, atol=FINITE_DIFFERENCE * np.abs(moves).max())
