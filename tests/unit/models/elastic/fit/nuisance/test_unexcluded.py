"""A spring that others can stand for is neither called for nor excluded: intervals leave room for it."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import certain, exact_frf, two_joint_robot, with_spring_factors, without_spring
from robid.models.elastic.fit.fitting import fit_elastic, set_up
from robid.models.elastic.fit.nuisance.linear import Basis, list_linearised
from robid.models.elastic.fit.nuisance.missing_springs import (
    UnexcludedSpring,
    add_missing_springs,
    leave_room,
    unexcluded_springs,
)
from robid.models.elastic.fit.optimizers import optimise
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.physical import find_physical
from robid.models.elastic.fit.solution import Spread
from robid.robot.description import Inertial, Spring
from robid.robot.nuisance import NuisanceStd

FREQUENCY_HZ = np.geomspace(1, 60, 40)
PLACES = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2], [-1.1, 0.3], [0.2, 2.0]])
TURN = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
OPTIONS, DELAY_S = ElasticOptions(starts=1), 1e-3
GEAR, SOFTNESS = 2e4, 0.25


def wrist(between_kg):
    """Two crossing axes: a bearing of the second about its y lies in line with the first gear, one link between them.

    Only compliances are uncertain.
    """
    robot = certain(two_joint_robot())
    first = Inertial(between_kg, np.zeros(3), 2e-3 * between_kg * np.eye(3))
    shoulder, elbow = robot.joints
    elbow = replace(elbow, position_m=np.array([0.0, 0.0, 0.25]), rotation=TURN)
    uncertain = replace(elbow.nuisance_std, compliance=NuisanceStd().compliance)
    joints = replace(shoulder, link=first, nuisance_std=uncertain), replace(elbow, nuisance_std=uncertain)
    springs = [replace(s, stiffness=GEAR) if s.place == "transmission" else s for s in robot.springs]
    return replace(robot, joints=joints, springs=tuple(springs))


def with_bearings(robot, across, in_line):
    """The robot with two bearings of some share of its gears' compliance: its file lacks them."""
    own = [replace(s, stiffness=GEAR / across) if s.name == "bearing_1" else s for s in robot.springs]
    further = Spring("in_line", 1, "bearing", np.array([0.0, 1.0, 0.0]), GEAR / in_line, 5e-4 * GEAR / in_line)
    return replace(robot, springs=(*own, further))


def measured_in(robot):
    return exact_frf(robot, PLACES, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=0.003, seed=5)


def measured(between_kg):
    robot = with_spring_factors(wrist(between_kg), [1.3, 0.8, 1.0, 0.9], [0.7, 1.4, 1.2, 0.8])
    return measured_in(with_bearings(robot, SOFTNESS, SOFTNESS))


def looked_for(between_kg):
    stated, frf = without_spring(wrist(between_kg), "bearing_1"), measured(between_kg)
    problem, _ = set_up(stated, frf, OPTIONS, DELAY_S)
    best = optimise(problem, np.zeros(len(problem.parameters.names))).parameters
    linear = list_linearised(problem, (best,), Basis(stated, OPTIONS))
    found = add_missing_springs(linear.problem, best, stated, OPTIONS, linear.nuisances, linear.columns)
    with_them = list_linearised(found.problem, (found.internal,), Basis(found.robot, found.options))
    return found, unexcluded_springs(found, with_them)


def test_a_bearing_in_line_with_a_gear_takes_its_part_unseen():
    found, unseen = looked_for(1e-3)
    assert found.springs == ("bearing_shoulder_x",)
    [spring] = unseen
    assert spring.name == "bearing_elbow_y.compliance"
    assert spring.std == pytest.approx(100 * SOFTNESS, rel=0.02)
    row = found.problem.parameters.names.index("gear_1.stiffness")
    both = GEAR * np.exp(found.internal[row])
    # Compliances in line add up.
    assert spring.shift[row] == pytest.approx(-np.log(1 - SOFTNESS * both / GEAR), rel=0.05)


def test_one_that_an_inertia_tells_from_the_gear_is_called_for_or_excluded():
    found, unseen = looked_for(60.0)
    assert set(found.springs) == {"bearing_shoulder_x", "bearing_elbow_y"}
    assert "bearing_elbow_y.compliance" not in {spring.name for spring in unseen}


def test_the_physical_interval_holds_the_gear_that_the_data_do_not_tell():
    estimate = fit_elastic(without_spring(wrist(1e-3), "bearing_1"), measured(1e-3), OPTIONS, DELAY_S).estimate
    row = estimate.names.index("gear_1.stiffness")
    true, in_line = 1.3 * GEAR, GEAR / (1 / 1.3 + SOFTNESS)
    assert in_line < estimate.physical_value[row] < true
    assert 0.5 * true < estimate.lower[row] < in_line < true < estimate.upper[row] < 2 * true


@pytest.mark.parametrize("seed", [2, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (4, 6, 10))])
def test_what_ran_away_for_lack_of_a_bearing_comes_back(seed):
    generator = np.random.default_rng(seed)
    between_kg = float(np.exp(generator.uniform(-7, 3)))
    robot = with_spring_factors(wrist(between_kg), *(np.exp(generator.uniform(-0.7, 0.7, 4)) for _ in range(2)))
    true = with_bearings(robot, *generator.uniform(0.2, 0.33, 2))
    estimate = fit_elastic(without_spring(wrist(between_kg), "bearing_1"), measured_in(true), OPTIONS, DELAY_S).estimate
    for name, widest in (("gear_1", 0.7), ("gear_2", 0.2), ("forearm", 0.6)):
        row = estimate.names.index(f"{name}.stiffness")
        spring = next(spring for spring in true.springs if spring.name == name)
        assert estimate.lower[row] < spring.stiffness < estimate.upper[row]
        assert np.log(estimate.upper[row] / estimate.lower[row]) < 2 * widest


def without_rest(stated, frf):
    """What is found where the springs that fit best give way: here a forearm that hardly holds."""
    problem, _ = set_up(stated, frf, OPTIONS, DELAY_S)
    end = np.zeros(len(problem.parameters.names))
    end[problem.parameters.names.index("forearm.stiffness")] = -4.0
    given = Basis(stated, OPTIONS, rested=False)
    return problem.parameters.names[:3], find_physical(problem, (end, end), given, 0.95)


def test_a_missing_bearing_is_looked_for_where_the_robot_does_not_rest():
    true = with_bearings(wrist(60.0), SOFTNESS, SOFTNESS)
    names, (found, nuisances) = without_rest(without_spring(wrist(60.0), "bearing_1"), measured_in(true))
    assert names == ("gear_1.stiffness", "gear_2.stiffness", "forearm.stiffness")
    std = np.sqrt(np.diag(found.covariance))[:3]
    assert (np.abs(found.values[:3]) < 2.5 * std).all()
    assert (std < [0.1, 0.02, 0.02]).all()
    assert nuisances.names[0] == "bearing_shoulder_x.compliance"


def test_a_robot_that_its_file_explains_is_found_where_the_fit_does_not_rest():
    _, (found, nuisances) = without_rest(wrist(60.0), measured_in(wrist(60.0)))
    assert nuisances.names[0] != "bearing_shoulder_x.compliance"
    np.testing.assert_allclose(found.values[:4], 0.0, atol=0.03)


def test_nothing_is_said_where_nothing_explains_why_it_does_not_rest():
    frf = measured_in(wrist(60.0))
    wrong = frf.response * (1 + 0.9 * np.sin(FREQUENCY_HZ))[:, None, None]
    _, found = without_rest(wrist(60.0), replace(frf, response=wrong))
    assert found is None


def test_room_is_left_for_half_of_what_was_known_beforehand():
    generator, count = np.random.default_rng(1), 400_000
    covariance = np.array([[0.01, 0.02, 0.0], [0.02, 4.0, 0.0], [0.0, 0.0, 0.03]])  # a gear, the spring, another
    told = Spread(np.array([-0.3, 3.0, 0.5]), covariance, np.array([4.0, np.inf, 5.0]))
    mixed = leave_room(told, UnexcludedSpring("spring", 25.0, np.array([0.2, 0.0])), 1)
    data = generator.multivariate_normal(told.values, covariance, count)
    known = told.values + np.outer(np.abs(25 * generator.normal(size=count)) - 3, [0.2 / 25, 1.0, 0.0])
    both = np.concatenate([data, known])
    np.testing.assert_allclose(mixed.values, both.mean(axis=0), rtol=0.01)
    assert mixed.covariance[1, 1] == pytest.approx(both[:, 1].var(), rel=0.01)
    # What the gear's own data leave open stays, whatever the spring.
    assert mixed.covariance[0, 0] >= np.cov(both.T)[0, 0]
    assert mixed.covariance[2, 2] == 0.03
    assert mixed.degrees_of_freedom[0] == pytest.approx(4 * (mixed.covariance[0, 0] / 0.01) ** 2)
    np.testing.assert_array_equal(mixed.degrees_of_freedom[1:], [np.inf, 5.0])


def test_what_is_known_worse_than_beforehand_stays():
    told = Spread(np.array([0.0, 20.0]), np.diag([1.0, 900.0]), np.full(2, np.inf))
    mixed = leave_room(told, UnexcludedSpring("spring", 25.0, np.array([0.5])), 1)
    np.testing.assert_array_equal(mixed.covariance, told.covariance)
