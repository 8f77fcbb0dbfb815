"""Points along an elastic arm: those of the rigid one where no spring is bent, and how springs move them."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import arm_on_rail, ball_screw, linear_axis, springs_everywhere, two_joint_robot, two_mass_robot
from robid.robot.kinematics import skeleton
from robid.robot.linearize import solve_statics
from robid.robot.model import build_model
from robid.robot.points import arm_points
from tolerances import IDENTITY

STEP = 1e-6
ROBOTS = {
    "two joints": two_joint_robot,
    "rotors on links": lambda: two_joint_robot("on_link"),
    "springs everywhere": springs_everywhere,
    "rail": arm_on_rail,
    "linear axis": linear_axis,
    "screw": ball_screw,
}


def unbent(model, configuration):
    """Coordinates of the elastic model at joint positions, no spring bent."""
    z = np.concatenate([model.robot.motor_per_arm @ configuration, np.zeros(len(model.robot.springs))])
    return model.to_spring @ z


@pytest.mark.parametrize("name", ROBOTS)
def test_points_are_those_of_the_rigid_arm_where_no_spring_is_bent(name):
    robot = ROBOTS[name]()
    model = build_model(robot)
    configuration = np.random.default_rng(2).uniform(0.1, 0.9, len(robot.joints))
    found = arm_points(model, unbent(model, configuration)[None]).position_m[0]
    rigid = skeleton(robot, configuration[None])[0]
    for point in rigid if robot.base is None else rigid[1:]:
        assert np.abs(found - point).max(axis=1).min() < IDENTITY
    np.testing.assert_allclose(found[-3], rigid[-1], atol=IDENTITY)


@pytest.mark.parametrize("name", ROBOTS)
def test_jacobians_are_differences_of_the_kinematics(name):
    robot = ROBOTS[name]()
    model = build_model(robot)
    configurations = np.random.default_rng(3).uniform(0.1, 0.9, (2, len(robot.joints)))
    at = solve_statics(model, configurations).position
    found = arm_points(model, at)
    assert found.moves.shape[-1] == len(robot.joints) + len(robot.springs)
    for column in range(found.moves.shape[-1]):
        step = STEP * model.to_spring[:, column]
        ahead, behind = (arm_points(model, at + sign * step).position_m for sign in (1, -1))
        np.testing.assert_allclose(found.moves[..., column], (ahead - behind) / (2 * STEP), atol=1e-8)


def test_each_kind_of_spring_turns_what_lies_behind_it_about_its_axis():
    robot = two_joint_robot()
    model = build_model(robot)
    found = arm_points(model, unbent(model, np.zeros(2))[None])
    points, moves = found.position_m[0], found.moves[0]
    base, shoulder, elbow, split, tool = points[:5]
    np.testing.assert_allclose(base, 0)
    axis, lean = np.array([0.0, -1.0, 0.0]), np.array([1.0, 0.0, 0.0])
    # Motors, then gear_1, gear_2, bearing_1 about the parent's x, and the forearm's split.
    turned = {
        0: axis / 120, 1: axis / 100, 2: -axis, 3: -axis, 4: lean, 5: axis,
    }  # fmt: skip
    about = {0: shoulder, 1: elbow, 2: shoulder, 3: elbow, 4: shoulder, 5: split}
    for column, turn in turned.items():
        np.testing.assert_allclose(moves[4, :, column], np.cross(turn, tool - about[column]), atol=IDENTITY)
    np.testing.assert_allclose(moves[:2], 0, atol=IDENTITY)  # what lies before all springs rests
    assert not moves[3, :, 5].any()  # a split moves only what lies beyond it


def test_an_arm_without_length_shows_its_turn_by_the_tools_axes():
    model = build_model(two_mass_robot(ratio=4.0))
    found = arm_points(model, np.zeros((1, 2)))
    assert found.length_m[0] == 0
    moved = found.moves[0, -2:]
    np.testing.assert_allclose(np.linalg.norm(moved, axis=1), [[0.025, 0.1]] * 2, rtol=IDENTITY)


def test_the_length_is_that_of_the_line_along_the_arm():
    robot = replace(two_joint_robot(), payload=two_mass_robot().payload)
    model = build_model(robot)
    found = arm_points(model, unbent(model, np.array([0.3, -0.4]))[None])
    elbow = np.hypot(0.7, 0.25)
    np.testing.assert_allclose(found.length_m, 0.4 + elbow + 0.3 + 0.3, rtol=IDENTITY)
