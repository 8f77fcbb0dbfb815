"""A robot put together with its doubts against the study's exact responses, which share no code with it."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot
from robid.errors import DataError
from robid.models.elastic.fit.fitting import set_up
from robid.models.elastic.fit.nuisance.kinds import (
    FIXED,
    Compliance,
    Hysteresis,
    LoadStiffness,
    MotorFriction,
    RobotMove,
    ValueOff,
    list_nuisances,
)
from robid.models.elastic.fit.nuisance.off_robot import are_put_in, may_differ, put_in
from robid.models.elastic.fit.nuisance.response import Scene, column, nuisance_columns
from robid.models.elastic.fit.options import ElasticOptions
from robid.robot.linearize import axial_inertia
from robid.robot.model import build_model
from robid.studies.trust.linear import Doubted, doubted_responses

FREQUENCY_HZ = np.geomspace(2.0, 60.0, 12)
PLACES = np.array([[0.3, -0.7], [-0.5, 0.9], [1.1, 0.4]])
OPTIONS, DELAY_S, SAMPLING_S = ElasticOptions(), 1e-4, 1e-4


def exact(robot, doubts=(), amounts=()):
    off = Doubted(tuple(doubts), np.reshape(amounts, (len(doubts), len(PLACES))))
    return doubted_responses(robot, off, PLACES, FREQUENCY_HZ, (SAMPLING_S, DELAY_S))


def made(delay_s=DELAY_S, sampling_s=SAMPLING_S, options=OPTIONS):
    robot, known = two_joint_robot(), {"sampling_period_s": sampling_s, "declared_noise": 0.01}
    return set_up(robot, exact_frf(robot, PLACES, FREQUENCY_HZ, delay_s=delay_s, **known), options, delay_s)[0]


@pytest.fixture(scope="module")
def problem():
    return made()


def drawn(doubts, seed, kinds=object, of=None):
    """Amounts (n_doubt,) of some kinds, and what places add."""
    generator = np.random.default_rng(seed)
    std, place_std = (np.array([getattr(doubt, name) for doubt in doubts]) for name in ("common_std", "place_std"))
    chosen = np.array([isinstance(doubt.effect, kinds) for doubt in doubts]) & are_put_in(doubts)
    chosen &= np.array([of is None or getattr(doubt.effect, "kind", "") in of for doubt in doubts])
    amounts = chosen * std * np.abs(generator.standard_normal(len(doubts)))
    added = chosen * may_differ(doubts) * place_std * generator.uniform(0, 1, (len(PLACES), len(doubts)))
    return amounts, added


def model_of(problem, robot, doubts, amounts, added=None):
    off = put_in(problem, np.zeros(len(problem.parameters.names)), robot, OPTIONS, doubts, amounts, added)
    return off.problem.model_response(np.zeros(len(off.problem.parameters.names)))


@pytest.mark.parametrize("kind", [RobotMove, Compliance, Hysteresis])
@pytest.mark.parametrize("seed", range(3))
def test_a_robot_put_together_responds_as_the_exact_one(problem, kind, seed):
    robot, doubts = two_joint_robot(), list_nuisances(two_joint_robot(), OPTIONS)
    amounts, added = drawn(doubts, seed, kind)
    wanted = exact(robot, doubts, (amounts + added).T)
    assert np.abs(np.log(wanted / exact(robot))).max() > 0.05
    np.testing.assert_allclose(model_of(problem, robot, doubts, amounts, added), wanted, rtol=1e-6)


def test_gears_that_stiffen_with_their_load_are_the_exact_ones_but_for_how_they_rest(problem):
    robot, doubts = two_joint_robot(), list_nuisances(two_joint_robot(), OPTIONS)
    amounts, added = drawn(doubts, 3, LoadStiffness)
    wanted = exact(robot, doubts, (amounts + added).T)
    found = np.log(model_of(problem, robot, doubts, amounts, added) / wanted)
    assert np.abs(found).max() < 0.02 * np.abs(np.log(wanted / exact(robot))).max()


def test_friction_that_clings_to_motors_is_that_of_the_exact_robot(problem):
    robot, doubts = two_joint_robot(), list_nuisances(two_joint_robot(), OPTIONS)
    amounts, added = drawn(doubts, 4, MotorFriction)
    wanted = exact(robot, doubts, (amounts + added).T)
    found = np.log(model_of(problem, robot, doubts, amounts, added) / wanted)
    assert np.abs(found).max() < 1e-4 * np.abs(np.log(wanted / exact(robot))).max()


def test_springs_and_dampers_that_no_fit_estimates_are_those_of_the_exact_robot():
    options, robot = ElasticOptions(free=("viscous", "stiffness"), fixed=("forearm.stiffness",)), two_joint_robot()
    own, doubts = made(options=options), list_nuisances(two_joint_robot(), options)
    amounts, _ = drawn(doubts, 9, ValueOff, ("stiffness", "damping"))
    held = {doubt.name for doubt, amount in zip(doubts, amounts, strict=True) if amount}
    assert held == {"forearm.stiffness", *(f"{spring.name}.damping" for spring in robot.springs)}
    wanted = exact(robot, doubts, np.tile(amounts[:, None], len(PLACES)))
    assert np.abs(np.log(wanted / exact(robot))).max() > 0.05
    still = replace(options, statics="every_iterate")
    off = put_in(own, np.zeros(len(own.parameters.names)), robot, still, doubts, amounts)
    np.testing.assert_allclose(off.problem.model_response(np.zeros(len(own.parameters.names))), wanted, rtol=1e-6)
    assert not [doubt for doubt in list_nuisances(robot, OPTIONS) if doubt.cause == FIXED]


def test_motors_and_arms_that_rub_more_are_those_of_the_exact_robot():
    options, robot = ElasticOptions(free=("stiffness", "damping")), two_joint_robot()
    own, doubts = made(options=options), list_nuisances(two_joint_robot(), options)
    amounts, _ = drawn(doubts, 8, ValueOff, ("viscous", "arm_viscous"))
    assert np.count_nonzero(amounts) == 4
    wanted = exact(robot, doubts, np.tile(amounts[:, None], len(PLACES)))
    assert np.abs(np.log(wanted / exact(robot))).max() > 0.02
    off = put_in(own, np.zeros(len(own.parameters.names)), robot, options, doubts, amounts)
    np.testing.assert_allclose(off.problem.model_response(np.zeros(len(own.parameters.names))), wanted, rtol=1e-6)


def test_a_delay_that_no_fit_estimates_is_that_of_exact_responses():
    options, robot = ElasticOptions(free=("stiffness", "damping", "viscous")), two_joint_robot()
    own, doubts = made(options=options), list_nuisances(two_joint_robot(), options)
    amounts = np.array([400.0 * (doubt.name == "delay") for doubt in doubts])
    off = put_in(own, np.zeros(len(own.parameters.names)), robot, options, doubts, amounts)
    wanted = exact_frf(robot, PLACES, FREQUENCY_HZ, delay_s=DELAY_S + 4e-4, sampling_period_s=SAMPLING_S).response
    found = off.problem.model_response(np.zeros(len(own.parameters.names)))
    np.testing.assert_allclose(found, wanted, rtol=1e-6)
    assert np.abs(np.log(wanted / exact(robot))).max() > 0.1
    np.testing.assert_allclose(exact(robot, doubts, np.tile(amounts[:, None], len(PLACES))), wanted, rtol=1e-9)
    assert not [doubt for doubt in list_nuisances(robot, OPTIONS) if doubt.name == "delay"]


def test_friction_waits_for_neither_hold_nor_delay():
    slow, robot, doubts = made(8e-3, 4e-3), two_joint_robot(), list_nuisances(two_joint_robot(), OPTIONS)
    point = np.zeros(len(slow.parameters.names))
    columns = nuisance_columns(slow, point, robot, OPTIONS, doubts)
    for index in (index for index, doubt in enumerate(doubts) if isinstance(doubt.effect, MotorFriction)):
        step = 1e-3 * np.eye(len(doubts))[index]
        ahead, behind = (model_of(slow, robot, doubts, side * step) for side in (1, -1))
        wanted = np.log(ahead / behind) / 2e-3
        # What folds down at such a rate is left out of the column.
        np.testing.assert_allclose(columns[..., index], wanted, rtol=0, atol=0.01 * np.abs(wanted).max())


LINK = ElasticOptions(free=("stiffness", "damping", "link_inertia"), bounds={"elbow.link_inertia": (0.1, 10.0)})


def test_a_link_s_inertia_that_is_estimated_is_not_doubted_besides():
    robot, doubts = two_joint_robot(), list_nuisances(two_joint_robot(), LINK)
    own = made(options=LINK)
    amounts = np.array([8.0 * (doubt.name in ("elbow.mass", "elbow.inertia")) for doubt in doubts])
    assert amounts.sum() == 16
    point = np.full(len(own.parameters.names), 0.05)
    off = put_in(own, point, robot, LINK, doubts, amounts)
    np.testing.assert_array_equal(off.problem.parameters.values(point), own.parameters.values(point))
    assert off.problem.model.axial[1] == own.model.axial[1]


def test_a_doubted_link_moves_an_inertia_that_is_estimated_no_more():
    plain, own, robot = made(), made(options=LINK), two_joint_robot()

    def column(problem, options, doubt):
        found = nuisance_columns(problem, np.zeros(len(problem.parameters.names)), robot, options, [doubt])
        return found[..., 0]

    slopes = own.linear(np.zeros(len(own.parameters.names)))[1]
    slope = slopes[..., own.parameters.names.index("elbow.link_inertia")]
    doubts = {doubt.name: doubt for doubt in list_nuisances(robot, LINK)}
    for doubt in (doubts["elbow.inertia"], doubts["elbow.mass"]):
        behind, ahead = (axial_inertia(build_model(doubt.effect.moved(robot, step)))[1] for step in (-0.1, 0.1))
        wanted = slope * np.log(ahead / behind) / 0.2
        left = column(plain, OPTIONS, doubt) - column(own, LINK, doubt)
        np.testing.assert_allclose(left, wanted, rtol=0, atol=1e-3 * np.abs(wanted).max())


def test_bounds_of_what_is_estimated_stay_where_they_are():
    robot, doubts = two_joint_robot(), list_nuisances(two_joint_robot(), LINK)
    own = made(options=LINK)
    nominal = own.parameters.nominal.link_inertia[1]
    tight = replace(LINK, bounds={"elbow.link_inertia": (0.95 * nominal, 1.05 * nominal)})
    held, point = made(options=tight), np.zeros(len(own.parameters.names))
    amounts = np.array([20.0 * (doubt.name == "elbow.mass") for doubt in doubts])
    off = put_in(held, point, robot, tight, doubts, amounts)
    np.testing.assert_array_equal(off.problem.parameters.lower, held.parameters.lower)
    np.testing.assert_array_equal(off.problem.parameters.upper, held.parameters.upper)


def test_what_places_add_is_theirs_alone(problem):
    robot, doubts = two_joint_robot(), list_nuisances(two_joint_robot(), OPTIONS)
    amounts, added = drawn(doubts, 5)
    added[1:] = 0.0
    with_it, without = (model_of(problem, robot, doubts, amounts, each) for each in (added, None))
    assert (np.abs(with_it / without - 1)[0] > 1e-3).any()
    np.testing.assert_array_equal(with_it[1:], without[1:])


def test_columns_of_a_robot_that_is_off_are_differences_of_robots_put_together(problem):
    robot, doubts = two_joint_robot(), list_nuisances(two_joint_robot(), OPTIONS)
    # By how much loads differ moves with the masses: gears that stiffen with it are taken alone.
    amounts = sum(drawn(doubts, 6, kind)[0] for kind in (RobotMove, Compliance, Hysteresis, MotorFriction))
    point = np.full(len(problem.parameters.names), 0.1) * problem.parameters.logarithmic
    off = put_in(problem, point, robot, OPTIONS, doubts, amounts)
    columns = nuisance_columns(off.problem, point, off.robot, off.options, doubts, amounts=amounts)

    def log_response(amounts):
        there = put_in(problem, point, robot, OPTIONS, doubts, amounts).problem
        return np.log(there.model_response(point))

    for index in np.flatnonzero(are_put_in(doubts)):
        step = 1e-3 * doubts[index].common_std * np.eye(len(doubts))[index]
        wanted = (log_response(amounts + step) - log_response(amounts - step)) / (2 * step[index])
        found = off.problem.residual_kind.part(columns[..., index])
        np.testing.assert_allclose(found, wanted, rtol=0, atol=2e-3 * np.abs(wanted).max(), err_msg=doubts[index].name)


@pytest.mark.parametrize(
    "free", [("stiffness", "motor_inertia"), ("damping", "viscous", "delay"), ("stiffness", "damping", "motor_inertia")]
)
def test_columns_of_what_no_fit_estimates_are_differences_wherever_it_is_off(free):
    options, robot = ElasticOptions(free=free), two_joint_robot()
    own, doubts = made(options=options), list_nuisances(two_joint_robot(), options)
    held = [isinstance(doubt.effect, ValueOff) for doubt in doubts]
    doubts = [doubt for doubt, kept in zip(doubts, held, strict=True) if kept]
    assert len(doubts) >= 4
    point = np.full(len(own.parameters.names), 0.3) * own.parameters.logarithmic
    amounts = np.where(np.arange(len(doubts)) % 2, -0.6, 1.2) * [min(doubt.common_std, 50.0) for doubt in doubts]
    amounts = np.maximum(amounts, [doubt.least / 2 for doubt in doubts])
    off = put_in(own, point, robot, options, doubts, amounts)
    columns = nuisance_columns(off.problem, point, off.robot, off.options, doubts)
    for index, doubt in enumerate(doubts):
        step = 1e-3 * doubt.common_std * np.eye(len(doubts))[index]
        ahead, behind = (
            put_in(own, point, robot, options, doubts, amounts + side * step).problem.model_response(point)
            for side in (1, -1)
        )
        wanted = np.log(ahead / behind) / (2 * step[index])
        found = off.problem.residual_kind.part(columns[..., index])
        # Springs that are held move the rest, which columns leave where it is.
        np.testing.assert_allclose(found, wanted, rtol=0, atol=0.02 * np.abs(wanted).max(), err_msg=doubt.name)


def test_matrices_move_once_and_for_all(problem):
    robot, doubts = two_joint_robot(), list_nuisances(two_joint_robot(), OPTIONS)
    amounts, added = drawn(doubts, 7)
    point = np.zeros(len(problem.parameters.names))
    off = put_in(problem, point, robot, OPTIONS, doubts, amounts, added)
    arguments = off.problem, point, off.robot, off.options
    moves = [doubt for doubt in doubts if doubt.cause in ("masses", "payload")]
    found = nuisance_columns(*arguments, moves)
    scene = Scene(*arguments)
    wanted = off.problem.residual_kind.part(np.stack([column(doubt.effect, scene) for doubt in moves], axis=-1))
    np.testing.assert_allclose(found, wanted, rtol=0, atol=2e-3 * np.abs(wanted).max())


def test_a_robot_that_gives_way_is_refused(problem):
    robot = two_joint_robot()
    doubts = [doubt for doubt in list_nuisances(robot, OPTIONS) if doubt.name == "payload.mass"]
    heavy = np.array([1e6])
    with pytest.raises(DataError):
        put_in(problem, np.zeros(len(problem.parameters.names)), robot, OPTIONS, doubts, heavy)


def test_nothing_off_is_the_problem_s_own_robot(problem):
    robot, doubts = two_joint_robot(), list_nuisances(two_joint_robot(), OPTIONS)
    off = put_in(problem, np.zeros(len(problem.parameters.names)), robot, OPTIONS, doubts, np.zeros(len(doubts)))
    assert off.robot == replace(robot)
    assert off.problem.model.added is None
    assert off.problem.model.clinging is None
