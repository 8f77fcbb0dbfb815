"""A robot put together with its doubts against the study's exact responses, which share no code with it."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot
from robid.errors import DataError
from robid.fit.elastic.doubts.column import RobotMove
from robid.fit.elastic.doubts.columns import doubt_columns
from robid.fit.elastic.doubts.drives import MotorFriction
from robid.fit.elastic.doubts.gears import Hysteresis, LoadStiffness
from robid.fit.elastic.doubts.listing import list_doubts
from robid.fit.elastic.doubts.off import are_put_in, may_differ, put_in
from robid.fit.elastic.doubts.scene import Scene
from robid.fit.elastic.doubts.springs import Compliance
from robid.fit.elastic.fitting import set_up
from robid.fit.elastic.options import ElasticOptions
from robid.studies.trust.doubted import Doubted, doubted_responses

FREQUENCY_HZ = np.geomspace(2.0, 60.0, 12)
PLACES = np.array([[0.3, -0.7], [-0.5, 0.9], [1.1, 0.4]])
OPTIONS, DELAY_S, SAMPLING_S = ElasticOptions(), 1e-4, 1e-4


def exact(robot, doubts=(), amounts=()):
    off = Doubted(tuple(doubts), np.reshape(amounts, (len(doubts), len(PLACES))))
    return doubted_responses(robot, off, PLACES, FREQUENCY_HZ, (SAMPLING_S, DELAY_S))


@pytest.fixture(scope="module")
def problem():
    frf = exact_frf(
        two_joint_robot(), PLACES, FREQUENCY_HZ, delay_s=DELAY_S, sampling_period_s=SAMPLING_S, declared_noise=0.01
    )
    return set_up(two_joint_robot(), frf, OPTIONS, DELAY_S)[0]


def drawn(doubts, seed, kinds=object):
    """Amounts (n_doubt,) of some kinds, and what places add."""
    generator = np.random.default_rng(seed)
    std, place_std = (np.array([getattr(doubt, name) for doubt in doubts]) for name in ("common_std", "place_std"))
    chosen = np.array([isinstance(doubt.direction, kinds) for doubt in doubts]) & are_put_in(doubts)
    amounts = chosen * std * np.abs(generator.standard_normal(len(doubts)))
    added = chosen * may_differ(doubts) * place_std * generator.uniform(0, 1, (len(PLACES), len(doubts)))
    return amounts, added


def model_of(problem, robot, doubts, amounts, added=None):
    off = put_in(problem, np.zeros(len(problem.parameters.names)), robot, OPTIONS, doubts, amounts, added)
    return off.problem.model_response(np.zeros(len(off.problem.parameters.names)))


@pytest.mark.parametrize("kind", [RobotMove, Compliance, Hysteresis])
@pytest.mark.parametrize("seed", range(3))
def test_a_robot_put_together_responds_as_the_exact_one(problem, kind, seed):
    robot, doubts = two_joint_robot(), list_doubts(two_joint_robot(), OPTIONS)
    amounts, added = drawn(doubts, seed, kind)
    wanted = exact(robot, doubts, (amounts + added).T)
    assert np.abs(np.log(wanted / exact(robot))).max() > 0.05
    np.testing.assert_allclose(model_of(problem, robot, doubts, amounts, added), wanted, rtol=1e-6)


def test_gears_that_stiffen_with_their_load_are_the_exact_ones_but_for_how_they_rest(problem):
    robot, doubts = two_joint_robot(), list_doubts(two_joint_robot(), OPTIONS)
    amounts, added = drawn(doubts, 3, LoadStiffness)
    wanted = exact(robot, doubts, (amounts + added).T)
    found = np.log(model_of(problem, robot, doubts, amounts, added) / wanted)
    assert np.abs(found).max() < 0.02 * np.abs(np.log(wanted / exact(robot))).max()


def test_friction_that_clings_to_motors_is_that_of_the_exact_robot_but_for_hold_and_delay(problem):
    robot, doubts = two_joint_robot(), list_doubts(two_joint_robot(), OPTIONS)
    amounts, added = drawn(doubts, 4, MotorFriction)
    wanted = exact(robot, doubts, (amounts + added).T)
    found = np.log(model_of(problem, robot, doubts, amounts, added) / wanted)
    assert np.abs(found).max() < 0.02 * np.abs(np.log(wanted / exact(robot))).max()


def test_what_places_add_is_theirs_alone(problem):
    robot, doubts = two_joint_robot(), list_doubts(two_joint_robot(), OPTIONS)
    amounts, added = drawn(doubts, 5)
    added[1:] = 0.0
    with_it, without = (model_of(problem, robot, doubts, amounts, each) for each in (added, None))
    assert (np.abs(with_it / without - 1)[0] > 1e-3).any()
    np.testing.assert_array_equal(with_it[1:], without[1:])


def test_columns_of_a_robot_that_is_off_are_differences_of_robots_put_together(problem):
    robot, doubts = two_joint_robot(), list_doubts(two_joint_robot(), OPTIONS)
    # By how much loads differ moves with the masses: gears that stiffen with it are taken alone.
    amounts = sum(drawn(doubts, 6, kind)[0] for kind in (RobotMove, Compliance, Hysteresis, MotorFriction))
    point = np.full(len(problem.parameters.names), 0.1) * problem.parameters.logarithmic
    off = put_in(problem, point, robot, OPTIONS, doubts, amounts)
    columns = doubt_columns(off.problem, point, off.robot, off.options, doubts)

    def log_response(amounts):
        there = put_in(problem, point, robot, OPTIONS, doubts, amounts).problem
        return np.log(there.model_response(point))

    for index in np.flatnonzero(are_put_in(doubts)):
        step = 1e-3 * doubts[index].common_std * np.eye(len(doubts))[index]
        wanted = (log_response(amounts + step) - log_response(amounts - step)) / (2 * step[index])
        found = off.problem.residual_kind.part(columns[..., index])
        if isinstance(doubts[index].direction, RobotMove) and doubts[index].unit == "%":
            found = found / (1 + amounts[index] / 100)  # a percent more of what is off already
        # Hold and delay stand between friction and what was measured.
        share = 0.03 if isinstance(doubts[index].direction, MotorFriction) else 2e-3
        np.testing.assert_allclose(found, wanted, rtol=0, atol=share * np.abs(wanted).max(), err_msg=doubts[index].name)


def test_matrices_move_once_and_for_all(problem):
    robot, doubts = two_joint_robot(), list_doubts(two_joint_robot(), OPTIONS)
    amounts, added = drawn(doubts, 7)
    point = np.zeros(len(problem.parameters.names))
    off = put_in(problem, point, robot, OPTIONS, doubts, amounts, added)
    arguments = off.problem, point, off.robot, off.options
    moves = [doubt for doubt in doubts if doubt.cause in ("masses", "payload")]
    found = doubt_columns(*arguments, moves)
    scene = Scene(*arguments)
    wanted = off.problem.residual_kind.part(np.stack([doubt.direction.column(scene) for doubt in moves], axis=-1))
    np.testing.assert_allclose(found, wanted, rtol=0, atol=2e-3 * np.abs(wanted).max())


def test_a_robot_that_gives_way_is_refused(problem):
    robot = two_joint_robot()
    doubts = [doubt for doubt in list_doubts(robot, OPTIONS) if doubt.name == "payload.mass"]
    heavy = np.array([1e6])
    with pytest.raises(DataError):
        put_in(problem, np.zeros(len(problem.parameters.names)), robot, OPTIONS, doubts, heavy)


def test_nothing_off_is_the_problem_s_own_robot(problem):
    robot, doubts = two_joint_robot(), list_doubts(two_joint_robot(), OPTIONS)
    off = put_in(problem, np.zeros(len(problem.parameters.names)), robot, OPTIONS, doubts, np.zeros(len(doubts)))
    assert off.robot == replace(robot)
    assert off.problem.model.added is None
    assert off.problem.model.clinging is None
