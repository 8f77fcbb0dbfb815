"""Signs, gear ratios and backlash are found as explanations, and their remedies work when followed."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot, with_spring_factors
from robid.arrays import part_of
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.nuisance.columns import column
from robid.models.elastic.fit.nuisance.listing import list_nuisances
from robid.models.elastic.fit.nuisance.scene import Scene
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.causes import _finding, _wrong_ratio, explain
from robid.models.elastic.judge.fitted import fitted_model
from robid.models.elastic.judge.ratios import Backlash, candidates, score, try_ratios, with_gear_ratio
from robid.models.elastic.judge.reversals import try_signs, turned

FREQUENCY_HZ = np.geomspace(1, 60, 20)
PLACES = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2], [-1.1, 0.3]])
DELAY_S = 1e-3
OPTIONS = ElasticOptions(strategy="plain", starts=1, max_iterations=30)  # a fit to wrong data never ends


@pytest.fixture(scope="module")
def frf():
    true = with_spring_factors(two_joint_robot(), [1.1, 0.9, 1.1, 0.95], [0.9, 1.1, 1.1, 0.9])
    return exact_frf(true, PLACES, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=0.003, seed=5)


@pytest.fixture(scope="module")
def sound(frf):
    return fit_elastic(two_joint_robot(), frf, OPTIONS, DELAY_S)


def fitted(stated, frf):
    solution = fit_elastic(stated, frf, OPTIONS, DELAY_S)
    return solution, fitted_model(stated, solution, frf, OPTIONS, DELAY_S)


@pytest.mark.parametrize(
    ("rows", "columns", "cause", "setting"),
    [
        ([1, 1], [1, -1], "torque_sign", "`sign: -1` for the torque of elbow where its log is described"),
        ([-1, 1], [1, 1], "angle_sign", "`sign: -1` for the angle of shoulder where its log is described"),
    ],
)
def test_signs_that_are_wrong_are_named_and_right_again_once_turned(sound, frf, rows, columns, cause, setting):
    rows, columns = np.array(rows, float), np.array(columns, float)
    told = turned(frf, rows, columns)
    solution, model = fitted(two_joint_robot(), told)
    found = explain(model)
    assert [each.cause for each in found] == [cause]  # nothing else is said of a fit to reversed data
    assert found[0].correct[0] == setting
    assert _finding(solution.estimate, found[0], found, OPTIONS).decisive
    again = fit_elastic(two_joint_robot(), turned(told, rows, columns), OPTIONS, DELAY_S)
    assert again.costs.total == pytest.approx(sound.costs.total)
    assert found[0].share == pytest.approx(1 - again.costs.total / solution.costs.total, abs=0.02)


def test_a_joint_that_turns_against_its_motor_asks_for_a_negative_ratio_which_works(sound, frf):
    turn = np.array([-1.0, 1.0])
    told = turned(frf, turn, turn)
    solution, model = fitted(two_joint_robot(), told)
    found = try_signs(model)
    assert (found.cause, found.correct) == ("gear_ratio", ("`gear_ratio: -120` for shoulder in the robot file",))
    assert found.what == "a motor of shoulder that turns against its joint"
    followed = with_gear_ratio(0, two_joint_robot(), -240)
    assert fit_elastic(followed, told, OPTIONS, DELAY_S).costs.total == pytest.approx(sound.costs.total, rel=1e-6)
    assert solution.costs.total > 100 * sound.costs.total


def test_a_sound_response_has_no_wrong_sign_and_magnitudes_tell_none(sound, frf):
    model = fitted_model(two_joint_robot(), sound, frf, OPTIONS, DELAY_S)
    assert try_signs(model) is None
    options = replace(OPTIONS, estimator="llsm")
    told = turned(frf, np.ones(2), np.array([1.0, -1.0]))
    solution = fit_elastic(two_joint_robot(), told, options, DELAY_S)
    assert try_signs(fitted_model(two_joint_robot(), solution, told, options, DELAY_S)) is None


@pytest.mark.parametrize(("joint", "factor"), [(0, 0.9), (1, 1.3)])
def test_a_gear_ratio_that_is_off_is_found_and_following_it_works(sound, frf, joint, factor):
    right = two_joint_robot().joints[joint].motor.gear_ratio
    stated = with_gear_ratio(joint, two_joint_robot(), (factor - 1) * right)
    solution, model = fitted(stated, frf)
    trial = try_ratios(model, (joint, 1 - joint))[0]
    assert trial.joint == joint
    assert trial.ratio == pytest.approx(right, rel=2e-3)
    assert trial.share > 0.9
    followed = with_gear_ratio(joint, stated, trial.ratio - stated.joints[joint].motor.gear_ratio)
    again = fit_elastic(followed, frf, OPTIONS, DELAY_S)
    assert again.costs.total < 1.2 * sound.costs.total
    assert solution.costs.total > 10 * sound.costs.total


def test_a_ratio_that_is_off_comes_first_and_its_setting_is_told(frf):
    stated = with_gear_ratio(1, two_joint_robot(), 10)
    solution, model = fitted(stated, frf)
    found = explain(model)
    assert found[0].cause == "gear_ratio"
    assert found[0].what.startswith("a gear ratio of elbow of 100 instead of 110")
    finding = _finding(solution.estimate, found[0], found, OPTIONS)
    assert "(try `gear_ratio: " in finding.message
    assert "` for elbow in the robot file;" in finding.message


def test_ratios_that_mean_angles_confirm_explain_nothing(frf):
    stated = two_joint_robot()
    turns = stated.motor_per_arm
    angles = PLACES @ turns.T

    def ratios(robot, mean):
        return [each.name for each in candidates(robot, replace(frf, mean_output=mean)) if each.cause == "gear_ratio"]

    assert ratios(stated, None) == ["shoulder.gear_ratio", "elbow.gear_ratio"]
    assert ratios(stated, angles + 3.0) == []
    assert ratios(with_gear_ratio(1, stated, 5.0), angles) == ["elbow.gear_ratio"]


def test_a_backlash_is_the_share_of_time_that_a_swinging_gear_is_in_its_gap(sound, frf):
    moving = replace(frf, input_amplitude=np.full((*frf.response.shape[:2], 2, 1), 0.05 + 0j))
    model = fitted_model(two_joint_robot(), sound, moving, OPTIONS, DELAY_S)
    scene = Scene(model.problem, model.internal, two_joint_robot(), OPTIONS)
    found = column(Backlash(1), scene)
    ratio = found / scene.gear_slopes[..., 1]
    np.testing.assert_allclose(ratio.imag, 0, atol=1e-12)
    gap = 1e-3
    draws = np.random.default_rng(1).standard_normal(400_000)
    for place in range(len(PLACES)):
        swing = np.sqrt(scene.swing[place, :, 1].sum())
        load = model.problem.model.rest.deflection[place, 1]
        inside = np.mean(np.abs(load + swing * draws) < 0.05 * swing) / (0.1 * swing)
        np.testing.assert_allclose(-ratio[place].real, gap * inside, rtol=0.05, atol=1e-4 * gap / swing)
    still = fitted_model(two_joint_robot(), sound, frf, OPTIONS, DELAY_S)
    assert not column(Backlash(1), Scene(still.problem, still.internal, two_joint_robot(), OPTIONS)).any()


def test_no_candidate_is_ever_a_nuisance_that_widens_intervals(frf):
    nuisances = {each.name for each in list_nuisances(two_joint_robot(), OPTIONS)}
    assert not nuisances & {each.name for each in candidates(two_joint_robot(), frf)}
    assert not [name for name in nuisances if "backlash" in name or "gear_ratio" in name]


@pytest.mark.parametrize("name", ["elbow.load_friction", "elbow.drift", "gear_2.one_sided"])
def test_what_a_fit_estimates_is_no_candidate(frf, name):
    robot = two_joint_robot()
    before, after = (
        [each.name for each in candidates(robot, frf, replace(OPTIONS, free=free)) if each.name.startswith(name)]
        for free in ((), (name,))
    )
    assert before
    assert not after


def test_in_three_places_no_friction_goes_with_the_load(frf):
    some, every = (candidates(two_joint_robot(), part_of(frf, "configuration", np.arange(count))) for count in (3, 4))
    assert not [each.name for each in some if "load_friction" in each.name]
    assert [each.name for each in every if "load_friction" in each.name]


def test_ratios_off_by_less_than_any_is_rounded_to_are_not_told(frf):
    stated = with_gear_ratio(1, two_joint_robot(), 0.3)
    _, model = fitted(stated, frf)
    scores = score(model, candidates(stated, frf))
    assert _wrong_ratio(model, scores, [0, 1]) == []
