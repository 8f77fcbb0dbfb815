"""Nuisances that are estimated: known truth returns, names are checked, derivatives are those of the response."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot, with_spring_factors
from robid.errors import DataError, SettingsError
from robid.models.elastic.fit.fitting import fit_elastic, set_up
from robid.models.elastic.fit.nuisance.effects import moved_robot
from robid.models.elastic.fit.nuisance.kinds import PRIOR_FACTOR
from robid.models.elastic.fit.nuisance.listing import estimable_nuisances, estimated_nuisances, list_nuisances
from robid.models.elastic.fit.nuisance.moves import further_springs, with_estimated_springs
from robid.models.elastic.fit.nuisance.wording import free_with
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.solution import fitted_robot
from robid.models.elastic.judge.fitted import fitted_model
from robid.robot.balances import balance_torque
from robid.robot.description import HarmonicBalance, Inertial
from robid.robot.nuisance import NuisanceStd
from robid.robot.parameters import FREE, NUISANCE_KIND

FREQUENCY_HZ = np.geomspace(1, 60, 30)
PLACES = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2], [-1.1, 0.3], [0.2, 2.0]])
DELAY_S = 1e-3


def with_payload(robot, factor):
    load = robot.payload
    return replace(robot, payload=Inertial(load.mass_kg * factor, load.com_m, load.inertia_kgm2 * factor))


@pytest.fixture(scope="module")
def true_arm():
    return with_spring_factors(two_joint_robot(), [1.3, 0.8, 1.2, 0.9], [0.7, 1.4, 1.2, 0.8])


def measured(robot, noise=0.003):
    return exact_frf(robot, PLACES, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=noise, seed=5)


def freeing(*names):
    return ElasticOptions(free=names)


def test_nuisances_alone_come_beside_the_default_kinds_and_kinds_replace_them():
    assert (freeing("payload").kinds, freeing("payload").estimated) == (FREE, ("payload",))
    assert freeing("damping", "payload", "stiffness").kinds == ("damping", "stiffness")
    assert ElasticOptions().estimated == ()


def test_what_is_estimated_and_fixed_all_the_same_stays_a_nuisance():
    options = replace(freeing("payload"), fixed=("payload.mass",))
    assert [d.name for d in list_nuisances(two_joint_robot(), options) if d.cause == "payload"] == ["payload.mass"]


@pytest.mark.parametrize("free", [FREE, ("payload",), ("payload", "masses"), ("stiffness",), ("damping", "masses")])
@pytest.mark.parametrize("more", [["masses"], ["arm_viscous"], ["payload.mass", "cubic"]])
def test_freeing_more_leaves_nothing_out_that_was_estimated(free, more):
    before, after = freeing(*free), freeing(*free_with(free, more))
    assert {*before.kinds, *before.estimated, *more} == {*after.kinds, *after.estimated}


def test_a_name_frees_a_nuisance_its_component_or_its_whole_cause():
    def found(name):
        return [nuisance.name for nuisance in estimated_nuisances(two_joint_robot(), freeing(name))]

    assert found("payload.mass") == ["payload.mass"]
    assert found("elbow.com") == ["elbow.com_x", "elbow.com_y", "elbow.com_z"]
    assert set(found("payload")) == {"payload.mass", *(f"payload.com_{axis}" for axis in "xyz"), "payload.inertia"}
    assert {name.partition(".")[0] for name in found("masses")} == {"shoulder", "elbow"}


def test_what_a_file_takes_for_granted_can_be_estimated_and_what_is_estimated_is_no_nuisance_any_more():
    sure = replace(two_joint_robot(), nuisance_std=NuisanceStd(payload_relative_std=0.0))
    assert "payload.mass" not in [nuisance.name for nuisance in list_nuisances(sure, ElasticOptions())]
    estimated = estimated_nuisances(sure, freeing("payload.mass"))
    assert estimated[0].common_std == pytest.approx(0.02 * 4.0)
    listed = {nuisance.name for nuisance in list_nuisances(two_joint_robot(), freeing("payload.mass"))}
    assert "payload.mass" not in listed
    assert "payload.inertia" in listed


@pytest.mark.parametrize("names", [("payload.mass",), ("elbow.mass", "elbow.com_x", "elbow.torque_constant")])
def test_derivatives_by_nuisances_are_those_of_the_response(true_arm, names):
    robot, options = two_joint_robot(), freeing(*names)
    problem = set_up(robot, measured(true_arm), options, DELAY_S)[0]
    parameters = problem.parameters
    nuisances = [index for index, kind in enumerate(parameters.kind_of) if kind == NUISANCE_KIND]
    assert len(nuisances) == len(names)
    point = np.random.default_rng(2).uniform(-0.2, 0.2, len(parameters.names))
    error, derivative = problem.linear(point)
    for index in nuisances:
        step = 1e-4 * (np.arange(point.size) == index)
        ahead, behind = problem.linear(point + step)[0], problem.linear(point - step)[0]
        difference = -(ahead - behind) / 2e-4
        np.testing.assert_allclose(derivative[..., index], difference, rtol=1e-5, atol=1e-7 * np.abs(difference).max())
    assert np.isfinite(error).all()


def test_the_model_follows_a_robot_that_is_off(true_arm):
    robot, options = two_joint_robot(), freeing("payload.mass")
    problem = set_up(robot, measured(true_arm), options, DELAY_S)[0]
    nuisance = estimated_nuisances(robot, options)[0]
    internal = np.zeros(len(problem.parameters.names))
    internal[problem.parameters.names.index("payload.mass")] = 2.0
    heavier = moved_robot(robot, [nuisance], np.array([2 * nuisance.common_std]))
    assert heavier.payload.mass_kg == pytest.approx(4.0 * 1.04)
    stiff = set_up(heavier, measured(true_arm), ElasticOptions(), DELAY_S)[0]
    there = stiff.model_response(np.zeros(len(stiff.parameters.names)))
    before = problem.model_response(np.zeros_like(internal))
    moved = np.abs(there - before).max()
    # What is left is the change of how the springs sag, of second order.
    assert np.abs(problem.model_response(internal) - there).max() < 0.02 * moved


def test_a_payload_that_is_off_returns_and_the_springs_with_it(true_arm):
    frf, robot = measured(with_payload(true_arm, 1.1)), two_joint_robot()
    wrong = fit_elastic(robot, frf, ElasticOptions(), DELAY_S)
    options = freeing("payload.mass")
    solution = fit_elastic(robot, frf, options, DELAY_S)
    estimate = solution.estimate
    index = estimate.names.index("payload.mass")
    assert (estimate.nominal[index], estimate.units[index], estimate.kinds[index]) == (4.0, "kg", NUISANCE_KIND)
    assert estimate.lower[index] < 4.4 < estimate.upper[index]
    assert estimate.upper[index] - estimate.lower[index] < 0.4
    assert estimate.prior_relative_std[index] == pytest.approx(PRIOR_FACTOR * 0.02)
    assert solution.costs.total < 0.2 * wrong.costs.total
    gear = estimate.names.index("gear_2.stiffness")
    assert abs(estimate.value[gear] / 4800 - 1) < 0.01 < abs(wrong.estimate.value[gear] / 4800 - 1)
    assert fitted_robot(robot, estimate).payload.mass_kg == pytest.approx(estimate.value[index])
    fitted = fitted_model(robot, solution, frf, options, DELAY_S)
    np.testing.assert_allclose(
        fitted.problem.model_response(fitted.internal), solution.responses.modelled, rtol=1e-3, atol=0
    )


def test_a_torque_constant_that_is_off_returns(true_arm):
    frf = measured(true_arm)
    read_too_large = np.where(np.arange(2) == 1, 1 / 1.08, 1.0)
    frf = replace(frf, response=frf.response * read_too_large)
    options = freeing("elbow.torque_constant")
    solution = fit_elastic(two_joint_robot(), frf, options, DELAY_S)
    estimate = solution.estimate
    index = estimate.names.index("elbow.torque_constant")
    assert estimate.lower[index] < 100 * np.log(1.08) < estimate.upper[index]
    assert fitted_robot(two_joint_robot(), estimate).payload.mass_kg == 4.0
    fitted = fitted_model(two_joint_robot(), solution, frf, options, DELAY_S)
    np.testing.assert_allclose(fitted.problem.model_response(fitted.internal), solution.responses.modelled, rtol=1e-3)


def test_going_on_from_a_minimum_ends_where_a_fit_of_its_own_does(true_arm):
    frf, robot, options = measured(with_payload(true_arm, 1.1)), two_joint_robot(), freeing("payload.mass")
    first = fit_elastic(robot, frf, ElasticOptions(), DELAY_S)
    near = dict(zip(first.estimate.names, first.internal.values.tolist(), strict=True))
    ends = [fit_elastic(robot, frf, options, DELAY_S, near=each) for each in (None, near)]
    np.testing.assert_allclose(ends[1].estimate.value, ends[0].estimate.value, rtol=1e-4, atol=1e-9)


def test_a_spring_that_the_file_lacks_is_fitted_where_it_is_estimated(true_arm):
    stated = two_joint_robot()
    stated = replace(stated, springs=tuple(spring for spring in stated.springs if spring.name != "bearing_1"))
    options = freeing("bearing_shoulder_x.compliance")
    robot = with_estimated_springs(stated, options)
    assert [spring.name for spring in robot.springs[len(stated.springs) :]] == ["bearing_shoulder_x"]
    solution = fit_elastic(robot, measured(true_arm), options, DELAY_S)
    found = solution.estimate.found["bearing_shoulder_x.stiffness"]
    assert found == pytest.approx(3.6e4, rel=0.01)
    assert with_estimated_springs(stated, ElasticOptions()) is stated
    assert all(" " not in further.spring.name for further in further_springs(stated))


@pytest.mark.parametrize(
    ("wrong", "meant"), [("paylod", "`payload`"), ("mass.elbow", "`elbow.mass`"), ("stifness", "`stiffness`")]
)
def test_an_unknown_name_is_one_message_with_close_names(true_arm, wrong, meant):
    with pytest.raises(SettingsError) as caught:
        fit_elastic(two_joint_robot(), measured(true_arm), freeing(wrong, "payload"), DELAY_S)
    assert f"nothing of this robot is called `{wrong}`; did you mean" in str(caught.value)
    assert meant in str(caught.value)
    assert str(caught.value).count("S056") == 1


def test_every_nuisance_has_a_name_that_frees_it_alone():
    every = estimable_nuisances(two_joint_robot())
    for nuisance in every:
        assert [each.name for each in estimated_nuisances(two_joint_robot(), freeing(nuisance.name))] == [nuisance.name]


WAVES_NM = np.array([60.0, -150.0])


def with_balance(robot, waves):
    balance = HarmonicBalance(*(np.array([wave]) for wave in waves))
    return replace(robot, joints=(replace(robot.joints[0], counterbalance=balance), *robot.joints[1:]))


def test_a_counterbalance_that_the_file_lacks_returns_and_moves_the_robot(true_arm):
    frf, robot = measured(with_balance(true_arm, WAVES_NM)), two_joint_robot()
    wrong = fit_elastic(robot, frf, ElasticOptions(), DELAY_S)
    options = freeing("shoulder.counterbalance")
    solution = fit_elastic(robot, frf, options, DELAY_S)
    estimate = solution.estimate
    rows = [estimate.names.index(f"shoulder.counterbalance_{wave}") for wave in ("sine", "cosine")]
    assert (np.array(estimate.units)[rows] == "N m").all()
    assert (estimate.lower[rows] < WAVES_NM).all()
    assert (estimate.upper[rows] > WAVES_NM).all()
    np.testing.assert_allclose(estimate.value[rows], WAVES_NM, atol=5.0)
    assert solution.costs.total < 0.1 * wrong.costs.total
    found = fitted_robot(robot, estimate)
    assert balance_torque(found.joints[0].counterbalance, 0.4, slides=False) == pytest.approx(
        balance_torque(with_balance(robot, estimate.value[rows]).joints[0].counterbalance, 0.4, slides=False)
    )
    assert found.joints[1].counterbalance is None
    fitted = fitted_model(robot, solution, frf, options, DELAY_S)
    np.testing.assert_allclose(
        fitted.problem.model_response(fitted.internal), solution.responses.modelled, rtol=1e-5, atol=0
    )


def test_a_file_that_states_a_counterbalance_is_refused_as_before(true_arm):
    stated = with_balance(two_joint_robot(), WAVES_NM)
    assert not any(nuisance.cause == "counterbalance" for nuisance in estimable_nuisances(stated))
    for options in (ElasticOptions(), freeing("payload.mass")):
        with pytest.raises(DataError, match="does not know the counterbalance of `shoulder`"):
            set_up(stated, measured(true_arm), options, DELAY_S)
