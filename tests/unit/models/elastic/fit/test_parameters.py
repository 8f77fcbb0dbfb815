"""Names, ties, bounds and scales of the parameters."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import springs_everywhere, two_joint_robot
from robid.errors import SettingsError
from robid.models.elastic.fit.fitting import draw_starts
from robid.models.elastic.fit.options import ElasticOptions, restricted
from robid.models.elastic.fit.parameters import map_parameters
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.parameters import element_names, kind_of_name
from robid.robot.response import nominal_parameters

CONFIGURATIONS = np.array([[-0.3, 0.5]])


def mapped(robot=None, **options):
    robot = robot or two_joint_robot()
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, CONFIGURATIONS))
    return map_parameters(robot, nominal_parameters(robot, linear, 1e-3), ElasticOptions(**options), (), np.zeros(0))


def test_only_gears_are_cubic_and_only_hinges_off_their_axis_can_move():
    robot = springs_everywhere()
    assert [name for name in element_names(robot, "cubic") if name] == ["gear_1.cubic", "gear_2.cubic"]
    movable = [name for name in element_names(robot, "location") if name]
    assert "rock.location_z" in movable
    assert "forearm.location_x" in movable
    assert not {"yaw.location_z", "forearm.location_z", "gear_1.location_x", "bearing_1.location_y"} & set(movable)


def test_tied_parameters_share_their_factor():
    found = mapped(free=("stiffness",), tied={"gear_2.stiffness": "bearing_1.stiffness"})
    assert found.names == ("gear_1.stiffness", "bearing_1.stiffness", "forearm.stiffness")
    assert found.tied == {"gear_2.stiffness": "bearing_1.stiffness"}
    values = found.parameters(np.array([0.0, np.log(2), 0.0])).stiffness
    np.testing.assert_allclose(values / two_joint_stiffness(), [1.0, 2.0, 2.0, 1.0])
    np.testing.assert_allclose(found.values(np.array([0.0, np.log(2), 0.0])), [2e4, 6e4, 8e3])


def two_joint_stiffness():
    return [spring.stiffness for spring in two_joint_robot().springs]


@pytest.mark.parametrize("tied", [{}, {"gear_2.cubic": "gear_1.cubic", "forearm.damping": "gear_1.damping"}])
def test_chain_is_the_derivative_of_the_elements(tied):
    found = mapped(free=("stiffness", "damping", "cubic", "delay"), tied=tied)
    point = np.random.default_rng(1).uniform(-0.3, 0.3, len(found.names))
    chain = found.chain(point)
    for index in range(point.size):
        step = np.zeros(point.size)
        step[index] = 1e-6
        difference = (found.element_values(point + step) - found.element_values(point - step)) / 2e-6
        np.testing.assert_allclose(chain[:, index], difference, rtol=1e-6, atol=1e-9 * np.abs(difference).max())


def test_a_cubic_gear_of_scale_one_carries_twice_the_torque_at_its_limit():
    robot = two_joint_robot()
    values = mapped(free=("cubic",)).parameters(np.ones(2))
    for spring, cubic, joint in zip(robot.springs[:2], values.cubic[:2], robot.joints, strict=True):
        limit = joint.motor.max_torque_nm * joint.motor.gear_ratio
        deflection = limit / spring.stiffness
        assert spring.stiffness * deflection + cubic * deflection**3 == pytest.approx(2 * limit)


def test_bounds_are_those_of_the_internal_values():
    bounds = {"gear_1.stiffness": (1e4, 3e4), "shoulder.viscous": (-1e-3, 2e-3)}
    found = mapped(free=("stiffness", "viscous"), bounds=bounds)
    bounded = np.isfinite(found.lower)
    assert np.flatnonzero(bounded).tolist() == np.flatnonzero(np.isfinite(found.upper)).tolist() == [0, 4]
    np.testing.assert_allclose(found.values(np.where(bounded, found.lower, 0.0))[[0, 4]], [1e4, -1e-3])
    np.testing.assert_allclose(found.values(np.where(bounded, found.upper, 0.0))[[0, 4]], [3e4, 2e-3])
    assert found.at_bound(found.upper)[0] == "gear_1.stiffness"
    assert found.at_bound(np.zeros(6)) == ()


def test_everything_wrong_with_names_is_told_at_once():
    with pytest.raises(SettingsError) as caught:
        mapped(
            free=("stiffness", "damping"),
            fixed=("elbow.stiffness",),
            tied={
                "gear_2.stiffness": "gear_1.stiffness",
                "gear_1.stiffness": "gear_2.stiffness",
                "forearm.damping": "forearm.stiffness",
                "forearm.stiffness": "gear_1.cubic",
            },
            bounds={"gear_2.stiffness": (1.0, 2.0), "nothing": (2.0, 1.0)},
        )
    for said in (
        "`elbow.stiffness`, which is not free",
        "`gear_2.stiffness` cannot follow `gear_1.stiffness`, which is tied itself",
        "`forearm.damping` cannot follow `forearm.stiffness`, which is",
        "`gear_1.cubic` is not estimated",
        "`gear_2.stiffness` is tied: bound `gear_1.stiffness`",
        "`nothing` is not estimated",
        "`nothing` has nothing between 2 and 1",
    ):
        assert said in caught.value.what


@pytest.mark.parametrize(("bounds", "said"), [((2e4, 3e4), "starts at a bound"), ((3e4, 4e4), "starts outside")])
def test_a_start_at_a_bound_is_named(bounds, said):
    with pytest.raises(SettingsError, match=said) as caught:
        mapped(free=("stiffness",), bounds={"gear_1.stiffness": bounds})
    assert "widen" in caught.value.remedy


def test_restricted_options_keep_what_concerns_the_kinds_left():
    options = ElasticOptions(
        free=("stiffness", "link_inertia", "location"),
        fixed=("gear_1.stiffness", "elbow.link_inertia", "forearm.location_x"),
        tied={"gear_2.stiffness": "bearing_1.stiffness"},
        bounds={"bearing_1.stiffness": (1.0, 1e9), "shoulder.link_inertia": (0.0, 9.0)},
    )
    fewer = restricted(options, ("stiffness",), lambda name: kind_of_name(name) == "stiffness")
    assert fewer == replace(
        options,
        free=("stiffness",),
        fixed=("gear_1.stiffness",),
        bounds={"bearing_1.stiffness": (1.0, 1e9)},
    )
    kinds = "link_inertia", "location"
    others = restricted(options, kinds, lambda name: kind_of_name(name) in kinds)
    assert others.fixed == ("elbow.link_inertia", "forearm.location_x")


def test_motor_inertias_are_known_as_the_robot_file_says_and_link_inertias_by_decades():
    robot = two_joint_robot()
    first, second = robot.joints
    robot = replace(robot, joints=(replace(first, motor=replace(first.motor, inertia_relative_std=0.02)), second))
    found = mapped(robot, free=(*ElasticOptions().free, "link_inertia"), prior_decades=2.0)
    known = dict(zip(found.names, found.prior_std.tolist(), strict=True))
    assert known["shoulder.motor_inertia"] == 0.02
    assert known["elbow.motor_inertia"] == 0.05
    assert known["shoulder.link_inertia"] == known["gear_1.stiffness"] == pytest.approx(2 * np.log(10))


def test_starts_do_not_leave_what_is_known_of_a_motor():
    found = mapped()
    starts = np.array(draw_starts(found, ElasticOptions(starts=200, start_decades=2.0))[1:])
    rotors = np.array(found.kind_of) == "motor_inertia"
    np.testing.assert_allclose(starts[:, rotors].std(), 0.05, rtol=0.1)
    assert np.abs(starts[:, np.array(found.kind_of) == "stiffness"]).max() > np.log(50)
