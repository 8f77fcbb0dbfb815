"""A robot put together with its nuisances against the study's exact responses, which share no code with it."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot
from robid.errors import DataError
from robid.models.elastic.fit.fitting import set_up
from robid.models.elastic.fit.nuisance.columns import column
from robid.models.elastic.fit.nuisance.effects import (
    Compliance,
    Hysteresis,
    LoadStiffness,
    MotorFriction,
    RobotMove,
    ValueOff,
)
from robid.models.elastic.fit.nuisance.kinds import FIXED
from robid.models.elastic.fit.nuisance.listing import list_nuisances
from robid.models.elastic.fit.nuisance.off_robot import are_put_in, may_differ, put_in
from robid.models.elastic.fit.nuisance.response import nuisance_columns
from robid.models.elastic.fit.nuisance.scene import Scene
from robid.models.elastic.fit.nuisance.shares import following_rotors
from robid.models.elastic.fit.options import ElasticOptions
from robid.robot.linearize import axial_inertia
from robid.robot.model import build_model
from robid.studies.trust.linear import Perturbed, perturbed_responses

FREQUENCY_HZ = np.geomspace(2.0, 60.0, 12)
PLACES = np.array([[0.3, -0.7], [-0.5, 0.9], [1.1, 0.4]])
OPTIONS, DELAY_S, SAMPLING_S = ElasticOptions(), 1e-4, 1e-4


def exact(robot, nuisances=(), amounts=()):
    off = Perturbed(tuple(nuisances), np.reshape(amounts, (len(nuisances), len(PLACES))))
    return perturbed_responses(robot, off, PLACES, FREQUENCY_HZ, (SAMPLING_S, DELAY_S))


def made(delay_s=DELAY_S, sampling_s=SAMPLING_S, options=OPTIONS):
    robot, known = two_joint_robot(), {"sampling_period_s": sampling_s, "declared_noise": 0.01}
    return set_up(robot, exact_frf(robot, PLACES, FREQUENCY_HZ, delay_s=delay_s, **known), options, delay_s)[0]


@pytest.fixture(scope="module")
def problem():
    return made()


def drawn(nuisances, seed, kinds=object, of=None):
    """Amounts (n_nuisance,) of some kinds, and what places add."""
    generator = np.random.default_rng(seed)
    std, cluster_std = (
        np.array([getattr(nuisance, name) for nuisance in nuisances]) for name in ("common_std", "cluster_std")
    )
    chosen = np.array([isinstance(nuisance.effect, kinds) for nuisance in nuisances]) & are_put_in(nuisances)
    chosen &= np.array([of is None or getattr(nuisance.effect, "kind", "") in of for nuisance in nuisances])
    amounts = chosen * std * np.abs(generator.standard_normal(len(nuisances)))
    added = chosen * may_differ(nuisances) * cluster_std * generator.uniform(0, 1, (len(PLACES), len(nuisances)))
    return amounts, added


def model_of(problem, robot, nuisances, amounts, added=None):
    off = put_in(problem, np.zeros(len(problem.parameters.names)), robot, OPTIONS, nuisances, amounts, added)
    return off.problem.model_response(np.zeros(len(off.problem.parameters.names)))


@pytest.mark.parametrize("kind", [RobotMove, Compliance, Hysteresis])
@pytest.mark.parametrize("seed", range(3))
def test_a_robot_put_together_responds_as_the_exact_one(problem, kind, seed):
    robot, nuisances = two_joint_robot(), list_nuisances(two_joint_robot(), OPTIONS)
    amounts, added = drawn(nuisances, seed, kind)
    wanted = exact(robot, nuisances, (amounts + added).T)
    assert np.abs(np.log(wanted / exact(robot))).max() > 0.05
    np.testing.assert_allclose(model_of(problem, robot, nuisances, amounts, added), wanted, rtol=1e-6)


def test_gears_that_stiffen_with_their_load_are_the_exact_ones_but_for_how_they_rest(problem):
    robot, nuisances = two_joint_robot(), list_nuisances(two_joint_robot(), OPTIONS)
    amounts, added = drawn(nuisances, 3, LoadStiffness)
    wanted = exact(robot, nuisances, (amounts + added).T)
    found = np.log(model_of(problem, robot, nuisances, amounts, added) / wanted)
    assert np.abs(found).max() < 0.02 * np.abs(np.log(wanted / exact(robot))).max()


def test_friction_that_clings_to_motors_is_that_of_the_exact_robot(problem):
    robot, nuisances = two_joint_robot(), list_nuisances(two_joint_robot(), OPTIONS)
    amounts, added = drawn(nuisances, 4, MotorFriction)
    wanted = exact(robot, nuisances, (amounts + added).T)
    found = np.log(model_of(problem, robot, nuisances, amounts, added) / wanted)
    assert np.abs(found).max() < 1e-4 * np.abs(np.log(wanted / exact(robot))).max()


def test_springs_and_dampers_that_no_fit_estimates_are_those_of_the_exact_robot():
    options, robot = ElasticOptions(free=("viscous", "stiffness"), fixed=("forearm.stiffness",)), two_joint_robot()
    own, nuisances = made(options=options), list_nuisances(two_joint_robot(), options)
    amounts, _ = drawn(nuisances, 9, ValueOff, ("stiffness", "damping"))
    held = {nuisance.name for nuisance, amount in zip(nuisances, amounts, strict=True) if amount}
    assert held == {"forearm.stiffness", *(f"{spring.name}.damping" for spring in robot.springs)}
    wanted = exact(robot, nuisances, np.tile(amounts[:, None], len(PLACES)))
    assert np.abs(np.log(wanted / exact(robot))).max() > 0.05
    still = replace(options, statics="every_iterate")
    off = put_in(own, np.zeros(len(own.parameters.names)), robot, still, nuisances, amounts)
    np.testing.assert_allclose(off.problem.model_response(np.zeros(len(own.parameters.names))), wanted, rtol=1e-6)
    assert not [nuisance for nuisance in list_nuisances(robot, OPTIONS) if nuisance.cause == FIXED]


def test_motors_and_arms_that_rub_more_are_those_of_the_exact_robot():
    options, robot = ElasticOptions(free=("stiffness", "damping")), two_joint_robot()
    own, nuisances = made(options=options), list_nuisances(two_joint_robot(), options)
    amounts, _ = drawn(nuisances, 8, ValueOff, ("viscous", "arm_viscous"))
    assert np.count_nonzero(amounts) == 4
    wanted = exact(robot, nuisances, np.tile(amounts[:, None], len(PLACES)))
    assert np.abs(np.log(wanted / exact(robot))).max() > 0.02
    off = put_in(own, np.zeros(len(own.parameters.names)), robot, options, nuisances, amounts)
    np.testing.assert_allclose(off.problem.model_response(np.zeros(len(own.parameters.names))), wanted, rtol=1e-6)


def test_a_delay_that_no_fit_estimates_is_that_of_exact_responses():
    options, robot = ElasticOptions(free=("stiffness", "damping", "viscous")), two_joint_robot()
    own, nuisances = made(options=options), list_nuisances(two_joint_robot(), options)
    amounts = np.array([400.0 * (nuisance.name == "delay") for nuisance in nuisances])
    off = put_in(own, np.zeros(len(own.parameters.names)), robot, options, nuisances, amounts)
    wanted = exact_frf(robot, PLACES, FREQUENCY_HZ, delay_s=DELAY_S + 4e-4, sampling_period_s=SAMPLING_S).response
    found = off.problem.model_response(np.zeros(len(own.parameters.names)))
    np.testing.assert_allclose(found, wanted, rtol=1e-6)
    assert np.abs(np.log(wanted / exact(robot))).max() > 0.1
    np.testing.assert_allclose(exact(robot, nuisances, np.tile(amounts[:, None], len(PLACES))), wanted, rtol=1e-9)
    assert not [nuisance for nuisance in list_nuisances(robot, OPTIONS) if nuisance.name == "delay"]


def test_friction_waits_for_neither_hold_nor_delay():
    slow, robot, nuisances = made(8e-3, 4e-3), two_joint_robot(), list_nuisances(two_joint_robot(), OPTIONS)
    point = np.zeros(len(slow.parameters.names))
    columns = nuisance_columns(slow, point, robot, OPTIONS, nuisances)
    for index in (index for index, nuisance in enumerate(nuisances) if isinstance(nuisance.effect, MotorFriction)):
        step = 1e-3 * np.eye(len(nuisances))[index]
        ahead, behind = (model_of(slow, robot, nuisances, side * step) for side in (1, -1))
        wanted = np.log(ahead / behind) / 2e-3
        # What folds down at such a rate is left out of the column.
        np.testing.assert_allclose(columns[..., index], wanted, rtol=0, atol=0.01 * np.abs(wanted).max())


LINK = ElasticOptions(free=("stiffness", "damping", "link_inertia"), bounds={"elbow.link_inertia": (0.1, 10.0)})


def test_a_link_s_inertia_that_is_estimated_is_not_doubted_besides():
    robot, nuisances = two_joint_robot(), list_nuisances(two_joint_robot(), LINK)
    own = made(options=LINK)
    amounts = np.array([8.0 * (nuisance.name in ("elbow.mass", "elbow.inertia")) for nuisance in nuisances])
    assert amounts.sum() == 16
    point = np.full(len(own.parameters.names), 0.05)
    off = put_in(own, point, robot, LINK, nuisances, amounts)
    np.testing.assert_array_equal(off.problem.parameters.values(point), own.parameters.values(point))
    assert off.problem.model.axial[1] == own.model.axial[1]


def test_a_doubted_link_moves_an_inertia_that_is_estimated_no_more():
    plain, own, robot = made(), made(options=LINK), two_joint_robot()

    def column(problem, options, nuisance):
        found = nuisance_columns(problem, np.zeros(len(problem.parameters.names)), robot, options, [nuisance])
        return found[..., 0]

    slopes = own.linear(np.zeros(len(own.parameters.names)))[1]
    slope = slopes[..., own.parameters.names.index("elbow.link_inertia")]
    nuisances = {nuisance.name: nuisance for nuisance in list_nuisances(robot, LINK)}
    for nuisance in (nuisances["elbow.inertia"], nuisances["elbow.mass"]):
        behind, ahead = (axial_inertia(build_model(nuisance.effect.moved(robot, step)))[1] for step in (-0.1, 0.1))
        wanted = slope * np.log(ahead / behind) / 0.2
        left = column(plain, OPTIONS, nuisance) - column(own, LINK, nuisance)
        np.testing.assert_allclose(left, wanted, rtol=0, atol=1e-3 * np.abs(wanted).max())


def test_bounds_of_what_is_estimated_stay_where_they_are():
    robot, nuisances = two_joint_robot(), list_nuisances(two_joint_robot(), LINK)
    own = made(options=LINK)
    nominal = own.parameters.nominal.link_inertia[1]
    tight = replace(LINK, bounds={"elbow.link_inertia": (0.95 * nominal, 1.05 * nominal)})
    held, point = made(options=tight), np.zeros(len(own.parameters.names))
    amounts = np.array([20.0 * (nuisance.name == "elbow.mass") for nuisance in nuisances])
    off = put_in(held, point, robot, tight, nuisances, amounts)
    np.testing.assert_array_equal(off.problem.parameters.lower, held.parameters.lower)
    np.testing.assert_array_equal(off.problem.parameters.upper, held.parameters.upper)


def test_what_places_add_is_theirs_alone(problem):
    robot, nuisances = two_joint_robot(), list_nuisances(two_joint_robot(), OPTIONS)
    amounts, added = drawn(nuisances, 5)
    added[1:] = 0.0
    with_it, without = (model_of(problem, robot, nuisances, amounts, each) for each in (added, None))
    assert (np.abs(with_it / without - 1)[0] > 1e-3).any()
    np.testing.assert_array_equal(with_it[1:], without[1:])


def test_columns_of_a_robot_that_is_off_are_differences_of_robots_put_together(problem):
    robot, nuisances = two_joint_robot(), list_nuisances(two_joint_robot(), OPTIONS)
    # By how much loads differ moves with the masses: gears that stiffen with it are taken alone.
    amounts = sum(drawn(nuisances, 6, kind)[0] for kind in (RobotMove, Compliance, Hysteresis, MotorFriction))
    point = np.full(len(problem.parameters.names), 0.1) * problem.parameters.logarithmic
    off = put_in(problem, point, robot, OPTIONS, nuisances, amounts)
    columns = nuisance_columns(off.problem, point, off.robot, off.options, nuisances, amounts=amounts)

    def log_response(amounts):
        there = put_in(problem, point, robot, OPTIONS, nuisances, amounts).problem
        return np.log(there.model_response(point))

    for index in np.flatnonzero(are_put_in(nuisances)):
        step = 1e-3 * nuisances[index].common_std * np.eye(len(nuisances))[index]
        wanted = (log_response(amounts + step) - log_response(amounts - step)) / (2 * step[index])
        found = off.problem.residual_kind.part(columns[..., index])
        np.testing.assert_allclose(
            found, wanted, rtol=0, atol=2e-3 * np.abs(wanted).max(), err_msg=nuisances[index].name
        )


@pytest.mark.parametrize(
    "free", [("stiffness", "motor_inertia"), ("damping", "viscous", "delay"), ("stiffness", "damping", "motor_inertia")]
)
def test_columns_of_what_no_fit_estimates_are_differences_wherever_it_is_off(free):
    options, robot = ElasticOptions(free=free), two_joint_robot()
    own, nuisances = made(options=options), list_nuisances(two_joint_robot(), options)
    held = [isinstance(nuisance.effect, ValueOff) for nuisance in nuisances]
    nuisances = [nuisance for nuisance, kept in zip(nuisances, held, strict=True) if kept]
    assert len(nuisances) >= 4
    point = np.full(len(own.parameters.names), 0.3) * own.parameters.logarithmic
    amounts = np.where(np.arange(len(nuisances)) % 2, -0.6, 1.2) * [
        min(nuisance.common_std, 50.0) for nuisance in nuisances
    ]
    amounts = np.maximum(amounts, [nuisance.least / 2 for nuisance in nuisances])
    off = put_in(own, point, robot, options, nuisances, amounts)
    columns = nuisance_columns(off.problem, point, off.robot, off.options, nuisances)
    for index, nuisance in enumerate(nuisances):
        step = 1e-3 * nuisance.common_std * np.eye(len(nuisances))[index]
        ahead, behind = (
            put_in(own, point, robot, options, nuisances, amounts + side * step).problem.model_response(point)
            for side in (1, -1)
        )
        wanted = np.log(ahead / behind) / (2 * step[index])
        found = off.problem.residual_kind.part(columns[..., index])
        # Springs that are held move the rest, which columns leave where it is.
        np.testing.assert_allclose(found, wanted, rtol=0, atol=0.02 * np.abs(wanted).max(), err_msg=nuisance.name)


def test_matrices_move_once_and_for_all(problem):
    robot, nuisances = two_joint_robot(), list_nuisances(two_joint_robot(), OPTIONS)
    amounts, added = drawn(nuisances, 7)
    point = np.zeros(len(problem.parameters.names))
    off = put_in(problem, point, robot, OPTIONS, nuisances, amounts, added)
    arguments = off.problem, point, off.robot, off.options
    moves = [nuisance for nuisance in nuisances if nuisance.cause in ("masses", "payload")]
    found = nuisance_columns(*arguments, moves)
    scene = Scene(*arguments)
    wanted = off.problem.residual_kind.part(np.stack([column(nuisance.effect, scene) for nuisance in moves], axis=-1))
    np.testing.assert_allclose(found, wanted, rtol=0, atol=2e-3 * np.abs(wanted).max())


def test_a_robot_that_gives_way_is_refused(problem):
    robot = two_joint_robot()
    nuisances = [nuisance for nuisance in list_nuisances(robot, OPTIONS) if nuisance.name == "payload.mass"]
    heavy = np.array([1e6])
    with pytest.raises(DataError):
        put_in(problem, np.zeros(len(problem.parameters.names)), robot, OPTIONS, nuisances, heavy)


def test_nothing_off_is_the_problem_s_own_robot(problem):
    robot, nuisances = two_joint_robot(), list_nuisances(two_joint_robot(), OPTIONS)
    off = put_in(problem, np.zeros(len(problem.parameters.names)), robot, OPTIONS, nuisances, np.zeros(len(nuisances)))
    assert off.robot == replace(robot)
    assert off.problem.model.added is None
    assert off.problem.model.clinging is None


@pytest.mark.parametrize("kind", [MotorFriction, ValueOff])
def test_friction_follows_the_rotor_that_is_estimated(problem, kind):
    robot, nuisances = two_joint_robot(), list_nuisances(two_joint_robot(), OPTIONS)
    amounts, added = drawn(nuisances, 5, kind, None if kind is MotorFriction else ("arm_viscous",))
    amounts = 20 * amounts
    point, names = np.zeros(len(problem.parameters.names)), problem.parameters.names
    given = robot, OPTIONS, nuisances

    def model(at):
        off = put_in(problem, at, *given, amounts, added)
        return np.log(off.problem.model_response(at))

    off = put_in(problem, point, *given, amounts, added)
    columns = nuisance_columns(off.problem, point, off.robot, off.options, nuisances, all_rest=False)
    alone = off.problem.linear(point)[1]
    found = following_rotors(alone, names, nuisances, columns, amounts + added)
    share = off.problem.residual_kind.per_relative(off.problem.model_response(point))
    for joint in robot.joints:
        index = names.index(f"{joint.name}.motor_inertia")
        step = 1e-5 * (np.arange(point.size) == index)
        by_differences = share * (model(point + step) - model(point - step)) / 2e-5
        error = np.abs(found[..., index] - by_differences).max()
        assert error < 0.02 * np.abs(alone[..., index] - by_differences).max()
