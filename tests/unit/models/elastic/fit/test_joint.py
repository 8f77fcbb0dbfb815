"""Parameters and nuisances estimated together, on robots that are off by their file's nuisances."""

from dataclasses import fields, replace

import numpy as np
import pytest

from exact_systems import exact_frf, stocky, two_joint_robot, with_spring_factors, without_spring
from robid.errors import DataError
from robid.models.elastic.fit.fitting import fit_elastic, set_up
from robid.models.elastic.fit.nuisance import joint
from robid.models.elastic.fit.nuisance.joint import Descent, Space, State, descend
from robid.models.elastic.fit.nuisance.linear import Basis, linearise, list_linearised
from robid.models.elastic.fit.optimizers import optimise
from robid.models.elastic.fit.options import ElasticOptions, Weights
from robid.models.elastic.fit.physical import find_physical
from robid.models.elastic.fit.problem import make_problem
from robid.robot.nuisance import NuisanceStd
from robid.studies.trust.linear import draw_perturbed, perturbed_responses

FREQUENCY_HZ = np.geomspace(1.5, 70.0, 40)
PLACES = np.array([[0.3, -0.7], [-0.5, 0.9], [1.1, 0.4], [-1.2, -1.4], [0.7, 1.8], [-0.1, -0.2]])
OPTIONS, DELAY_S, SAMPLING_S, NOISE = ElasticOptions(starts=1), 1e-4, 1e-4, 0.002


STATED = stocky(two_joint_robot())


def drawn(seed, options=OPTIONS, clusters=PLACES):
    """A robot whose springs and nuisances are drawn, as it is measured, and its true springs over the file's."""
    generator = np.random.default_rng(seed)
    factors = np.exp(generator.uniform(-0.6, 0.6, 4))
    robot = with_spring_factors(STATED, factors, np.exp(generator.uniform(-0.6, 0.6, 4)))
    off = draw_perturbed(STATED, options, len(clusters), seed)
    exact = perturbed_responses(robot, off, clusters, FREQUENCY_HZ, (SAMPLING_S, DELAY_S))
    known = {"delay_s": DELAY_S, "sampling_period_s": SAMPLING_S}
    frf = exact_frf(robot, clusters, FREQUENCY_HZ, relative_noise=NOISE, seed=seed, **known)
    noise = frf.response / exact_frf(robot, clusters, FREQUENCY_HZ, declared_noise=NOISE, **known).response
    return replace(frf, response=exact * noise), np.log(factors)


def problem_of(frf):
    return set_up(STATED, frf, OPTIONS, DELAY_S)[0]


def springs_of(problem):
    return np.array([name.endswith(".stiffness") for name in problem.parameters.names])


def test_half_the_gradient_is_that_of_the_cost():
    frf, _ = drawn(1)
    problem, given = problem_of(frf), Basis(STATED, OPTIONS)
    linear = list_linearised(problem, (np.zeros(len(problem.parameters.names)),), given)
    space = Space.of(linear)
    descent, generator = Descent(linear, given, space), np.random.default_rng(2)
    added = 0.3 * linear.cluster_std[space.differing] * generator.standard_normal((len(PLACES), space.differing.size))
    amounts = np.maximum(
        0.5 * linear.common_std * np.abs(generator.standard_normal(linear.common_std.size)), space.floor
    )
    here = space.internal(State(0.05 * problem.parameters.logarithmic, amounts, added))
    found = descent.normal(here)
    assert found.cost == pytest.approx(descent.cost(here), rel=1e-12)
    for index in generator.choice(here.size, 40, replace=False):
        step = 1e-5 * np.eye(here.size)[index]
        wanted = (descent.cost(here + step) - descent.cost(here - step)) / 4e-5
        size = np.sqrt(found.hessian[index, index] * found.cost)
        assert found.gradient[index] == pytest.approx(wanted, abs=0.02 * size)


def test_robots_off_by_their_nuisances_are_found_from_where_the_fit_alone_ran_away():
    found, given = [], Basis(STATED, OPTIONS)
    for seed in (4, 5, 9):
        frf, true = drawn(seed)
        problem = problem_of(frf)
        away = np.zeros(len(problem.parameters.names))
        away[problem.parameters.names.index("forearm.stiffness")] = -2.0
        alone = optimise(problem, np.zeros(away.size))
        joint = descend(list_linearised(problem, (away, np.zeros(away.size)), given), given)
        assert joint.cost < 0.05 * alone.cost
        found.append((alone.parameters[springs_of(problem)] - true, joint.linear.point[springs_of(problem)] - true))
    before, after = np.median(np.abs(found), axis=(0, 2))
    assert after < 0.2 * before


def test_a_robot_whose_nuisances_explain_everything_lacks_no_spring():
    given = Basis(STATED, OPTIONS)
    problem = problem_of(drawn(4)[0])
    joint = descend(list_linearised(problem, (np.zeros(len(problem.parameters.names)),), given), given)
    assert joint.explains
    assert not joint.lacks_springs
    missing = without_spring(STATED, "bearing_1")
    frf = exact_frf(
        STATED, PLACES, FREQUENCY_HZ, delay_s=DELAY_S, sampling_period_s=SAMPLING_S, relative_noise=NOISE, seed=4
    )
    given = Basis(missing, OPTIONS)
    problem = set_up(missing, frf, OPTIONS, DELAY_S)[0]
    joint = descend(list_linearised(problem, (np.zeros(len(problem.parameters.names)),), given), given)
    assert not joint.explains or joint.lacks_springs


def test_what_is_left_is_taken_back_to_what_all_clusters_share():
    frf, _ = drawn(6)
    problem, given = problem_of(frf), Basis(STATED, OPTIONS)
    start = list_linearised(problem, (np.zeros(len(problem.parameters.names)),), given)
    amounts, added = 0.1 * start.common_std, np.tile(0.05 * start.cluster_std, (len(PLACES), 1))
    moved = linearise(problem, start.nuisances, start.point, given, amounts, added)
    still = linearise(problem, start.nuisances, start.point, given, amounts)
    change = np.abs(moved.error - still.error).max()
    apart = np.abs(moved.problem.model_response(start.point) / still.problem.model_response(start.point) - 1).max()
    assert change < 0.1 * apart


def held(frf, true, options):
    """Which physical intervals hold the true springs."""
    estimate = fit_elastic(STATED, frf, options, DELAY_S).estimate
    row = [estimate.names.index(f"{spring.name}.stiffness") for spring in STATED.springs]
    value = np.array([spring.stiffness for spring in STATED.springs]) * np.exp(true)
    return (estimate.lower[row] < value) & (value < estimate.upper[row])


@pytest.mark.slow
def test_physical_intervals_hold_springs_of_robots_off_by_their_nuisances():
    inside = [held(*drawn(seed), OPTIONS) for seed in range(10, 13)]
    assert np.mean(inside) >= 0.85


def test_viscous_friction_that_no_fit_estimates_does_not_move_all_springs():
    options = replace(OPTIONS, free=("stiffness", "damping"))
    many = np.random.default_rng(0).uniform(-1.5, 1.5, (12, 2))
    # Without its nuisance three springs of this robot lay outside.
    assert held(*drawn(23, options, many), options).all()


def test_data_never_outweigh_what_is_known_for_lack_of_a_model_error():
    problem, found = problem_of(drawn(4)[0]), []
    here = np.zeros(len(problem.parameters.names))
    for kind in ("inflated", "optimal", "user"):
        options = replace(OPTIONS, weights=Weights(kind))
        own, _ = make_problem(problem.frf, problem.model, problem.parameters, options, here)
        found.append(find_physical(own, (here,), Basis(STATED, options), 0.95)[0])
        assert "model error" in found[-1].rule
    for other in found[1:]:
        np.testing.assert_array_equal(other.values, found[0].values)
        np.testing.assert_array_equal(other.covariance, found[0].covariance)


def surer(robot, share):
    """The robot with a file that says to be off by a share of what it says."""

    def less(nuisances):
        return NuisanceStd(**{each.name: share * getattr(nuisances, each.name) for each in fields(NuisanceStd)})

    joints = tuple(replace(joint, nuisance_std=less(joint.nuisance_std)) for joint in robot.joints)
    return replace(robot, joints=joints, nuisance_std=less(robot.nuisance_std))


def test_nuisances_beyond_belief_widen_what_is_known_and_say_so():
    frf, _ = drawn(4)
    as_stated, too_sure = (fit_elastic(robot, frf, OPTIONS, DELAY_S).estimate for robot in (STATED, surer(STATED, 0.2)))
    assert "times as far off" not in as_stated.interval_rule
    assert "times as far off as stated" in too_sure.interval_rule
    # What is known five times too well is found out: intervals of gears are hardly narrower.
    widths = [np.log(each.upper[:2] / each.lower[:2]) for each in (as_stated, too_sure)]
    assert (widths[1] > 0.5 * widths[0]).all()


def test_springs_put_in_place_begin_where_they_were_found(monkeypatch):
    frf, _ = drawn(1)
    problem = problem_of(frf)
    linear = list_linearised(problem, (np.zeros(len(problem.parameters.names)),), Basis(STATED, OPTIONS))
    names, begun = problem.parameters.names, []
    far = replace(linear, point=np.where(problem.parameters.logarithmic, 1.7, 0.0))
    placed = names[0].rpartition(".")[0]

    def lowest(_descent, _space, point, _shares):
        begun.append(point)
        raise DataError("it ends here")

    monkeypatch.setattr(joint, "_lowest", lowest)
    with pytest.raises(DataError):
        descend(far, Basis(STATED, OPTIONS), (placed,))
    of_it = np.array([name.rpartition(".")[0] == placed for name in names]) & problem.parameters.logarithmic
    assert (begun[0][of_it] == 1.7).all()
    assert (begun[0][~of_it & problem.parameters.logarithmic] == 1.0).all()
