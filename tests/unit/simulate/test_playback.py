"""The closed loop under feed-forward: rest, limits, disturbances, and the tool's path."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import springs_everywhere, two_joint_robot
from robid.errors import DataError
from robid.robot.kinematics import skeleton
from robid.robot.linearize import solve_statics
from robid.robot.model import build_model
from robid.simulate.options import Controller, Imperfections, SimulateOptions
from robid.simulate.playback import Playback, play, turned_tool, with_tool_point

CONFIGURATION = np.array([0.3, -0.8])
TOOL = np.array([0.5, 0.1, 0.2])


def standstill(n_time=200, n_sim=2, torque=0.0):
    angle = two_joint_robot().motor_per_arm @ CONFIGURATION
    shape = (n_time, n_sim, 2)
    return Playback(np.broadcast_to(angle, shape), np.full(shape, torque))


def run(motion, robot=None, controller=None, **options):
    robot = with_tool_point(robot or two_joint_robot(), TOOL)
    return play(robot, controller or Controller(), SimulateOptions(**options), CONFIGURATION, 0, motion)


@pytest.mark.parametrize("torque", [0.0, 1.5])
def test_a_robot_at_rest_stays_there_whatever_the_feed_forward_lacks(torque):
    played = run(standstill(torque=torque))
    model = build_model(two_joint_robot())
    held = solve_statics(model, CONFIGURATION[None]).motor_torque
    np.testing.assert_allclose(played.torque, np.broadcast_to(held, played.torque.shape), rtol=1e-9)
    assert np.abs(played.tool - played.tool[0]).max() < 1e-10


def test_a_resolver_that_errs_does_not_kick_the_robot():
    played = run(standstill(), imperfections=Imperfections(resolver_error_rad=0.01, encoder_resolution_rad=1e-3))
    assert np.abs(played.tool - played.tool[0]).max() < 1e-10


def test_torques_stay_within_the_limits():
    motion = standstill()
    torque = motion.torque.copy()
    torque[50:, 0] = 1e3
    played = run(replace(motion, torque=torque))
    limit = np.array([joint.motor.max_torque_nm for joint in two_joint_robot().joints])
    np.testing.assert_array_equal(np.abs(played.torque[:, 0]).max(axis=0), limit)
    assert np.abs(played.torque[:, 1]).max() < limit.min()


@pytest.mark.parametrize("delay", [0, 2])
def test_feed_forward_acts_after_the_delay(delay):
    motion = standstill()
    torque = motion.torque.copy()
    torque[50:] += 1.0
    played = run(replace(motion, torque=torque), controller=Controller(delay_samples=delay))
    moved = np.abs(played.tool - played.tool[0]).max(axis=(1, 2)) > 1e-10
    # What is applied from sample 50 + delay shows one sample later.
    assert np.flatnonzero(moved)[0] == 51 + delay


def test_noise_is_on_what_it_belongs_to():
    played = run(standstill(2000), imperfections=Imperfections(tracker_noise_m=1e-4))
    assert played.tool.std(axis=0) == pytest.approx(1e-4, rel=0.1)
    assert np.ptp(played.torque) == pytest.approx(np.ptp(run(standstill(10)).torque), rel=1e-9)
    assert run(standstill(), imperfections=Imperfections(torque_noise_nm=0.1)).tool.std() > 0


def test_an_explosion_names_its_configuration():
    robot, motion = two_joint_robot(), standstill()
    springs = tuple(replace(spring, damping=1e4 * spring.damping) for spring in robot.springs)
    torque = motion.torque.copy()
    torque[50:] += 1.0
    with pytest.raises(DataError, match="blew up"):
        run(replace(motion, torque=torque), replace(robot, springs=springs))


@pytest.mark.parametrize("axis", [0, 1])
def test_the_turned_tool_is_that_of_the_kinematics(axis):
    robot = with_tool_point(springs_everywhere(), TOOL)
    model = build_model(replace(robot, gravity_m_s2=np.zeros(3)))
    rest = solve_statics(model, CONFIGURATION[None])
    angle = np.linspace(-0.5, 0.5, 7)
    turned = turned_tool(model, rest, axis, angle)
    arm = CONFIGURATION + angle[:, None] * np.eye(2)[axis]
    expected = skeleton(robot, arm, TOOL)[:, -1] - skeleton(robot, CONFIGURATION[None], TOOL)[:, -1]
    np.testing.assert_allclose(turned, expected, atol=1e-12)
