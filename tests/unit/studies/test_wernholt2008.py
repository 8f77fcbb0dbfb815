"""Scores and conclusions of the study of parameter estimators, on models made to measure."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot, with_spring_factors
from robid.models.elastic.fit.fitting import set_up
from robid.models.elastic.fit.options import ElasticOptions, Weights
from robid.models.elastic.judge.extrema import own_resonance_errors
from robid.studies.settings.study import EstimatorChoice, WernholtStudy
from robid.studies.simulated import stated_std
from robid.studies.wernholt2008.figures import Found, Judge, Models, claims, model_figures, summarise
from robid.studies.wernholt2008.study import ALL, Individuals, best_configuration, estimators_of, score_options, sets

FREQUENCY_HZ = np.unique(np.round(np.geomspace(4, 80, 60), 1))
CONFIGURATIONS = np.array([[0.3, 0.5], [-0.4, 1.2]])
OPTIONS = ElasticOptions(free=("stiffness", "damping"), correct_torques=False, weights=Weights(kind="user"))
CHOICES = {
    "lls15u": EstimatorChoice(estimator="lls", weights="user"),
    "lls15o": EstimatorChoice(estimator="lls", weights="optimal"),
    "llsm15u": EstimatorChoice(estimator="llsm", weights="user"),
    "nls15u": EstimatorChoice(estimator="nls", weights="user"),
    "nls15o": EstimatorChoice(estimator="nls", weights="optimal"),
    "lls1u": EstimatorChoice(estimator="lls", weights="user", configurations="best"),
}
N = 100


@pytest.fixture(scope="module")
def problem():
    frf = exact_frf(two_joint_robot(), CONFIGURATIONS, FREQUENCY_HZ, relative_noise=1e-3)
    return set_up(two_joint_robot(), frf, OPTIONS, 0.0)[0]


def models(name, good, count, n_param):
    """`good` models at the truth, the others with every parameter three times as large and ten times the cost."""
    right = np.arange(count) < good
    cost = np.where(right, 1.0, 10.0)
    internal = np.where(right, 0.0, np.log(3))[:, None] * np.ones(n_param)
    return Models(name, internal, cost, cost, cost, np.full(count, 7), ~right, right, ALL, 6.0, 4.0)


@pytest.fixture
def found(problem):
    def make(**good):
        n_param = len(problem.parameters.names)
        near = {name: models(name, good.get(name, 50), N, n_param) for name in CHOICES}
        std = np.where(np.array(problem.parameters.kind_of) == "stiffness", 0.01, 0.1)
        truth = std * np.linspace(0.5, 1.5, n_param)
        return Found(problem, {"": near}, "lls15u", truth, std, 1.0, 1.0, 1.25, 2.0, 12, 3)

    return make


def test_shares_count_models_and_springs(found):
    shown = found(lls15u=80)
    figures = model_figures(shown.near["lls15u"], shown)
    for key in ("reasonable", "springs_within_2", "springs_within_2_all", "dampers_within_2", "own_best"):
        assert figures[key] == pytest.approx(0.8)
    assert figures["cap_share"] == pytest.approx(0.2)
    assert (figures["best_cost"], figures["median_cost"], figures["evaluations.median"]) == (1, 1, 7)


def test_a_model_needs_its_cost_and_its_resonances(found):
    one = found().near["lls15u"]
    cost = np.array([1.0, 1.49, 1.51, 1.0])
    meets = np.array([True, True, True, False])
    one = replace(one, user_cost=cost, resonances=meets)
    assert one.reasonable.tolist() == [True, True, False, False]


def test_the_least_determined_spring_may_run_away(found):
    shown = found()
    least = shown.least_determined
    assert shown.of_kind("stiffness")[least]
    one = shown.near["lls15u"]
    internal = np.zeros_like(one.internal)
    internal[:30, least] = 5.0
    figures = model_figures(replace(one, internal=internal), shown)
    assert figures["springs_within_2"] == 1
    assert figures["springs_within_2_all"] == pytest.approx(0.7)


def test_time_is_that_of_two_cores_and_costs_are_relative_to_the_truth(found):
    summary = summarise(found())
    assert summary["fits"] == 600
    assert summary["fits600_s"] == pytest.approx(6 * 6.0 / 2)
    assert summary["fits600_processor_s"] == pytest.approx(6 * 4.0 / 2)
    assert summary["best_over_truth"] == pytest.approx(0.8)
    assert (summary["evaluations.median"], summary["evaluations.max"]) == (7, 7)
    assert summary["cap_share"] == pytest.approx(0.5)


def test_conclusions_follow_the_shares(found):
    paper = {"lls15u": 80, "llsm15u": 64, "lls15o": 35, "nls15u": 3, "nls15o": 0, "lls1u": 2}
    gears = np.char.startswith(found().problem.parameters.names, "gear")
    borne_out = [claim.reproduced for claim in claims(found(**paper), CHOICES, gears)]
    assert borne_out[:4] == [True] * 4
    assert borne_out[5:] == [True, True]
    alike = [claim.reproduced for claim in claims(found(), CHOICES, gears)]
    assert alike[:4] == [False] * 4
    fewer = {name: choice for name, choice in CHOICES.items() if name in ("lls15u", "llsm15u")}
    assert [claim.reproduced for claim in claims(found(**paper), fewer, gears)][:4] == [None, None, True, None]


def test_plain_descents_decide_where_there_are_any(found):
    shown = found(lls15u=50, llsm15u=50)
    plain = found(lls15u=80, llsm15u=20)
    both = replace(shown, groups={"": shown.near, "plain": plain.near})
    assert claims(both, CHOICES, np.zeros(len(shown.truth), bool))[2].reproduced is True


def test_predictions_that_are_ten_times_too_small_are_no_indication(found):
    shown = found()
    gears = np.zeros(len(shown.truth), bool)
    assert claims(shown, CHOICES, gears)[6].reproduced is True
    assert claims(replace(shown, truth=10 * shown.truth), CHOICES, gears)[6].reproduced is False


def test_a_missed_resonance_is_seen_and_one_that_does_not_count_is_not(problem):
    n_param = len(problem.parameters.names)
    wrong = np.where(np.array(problem.parameters.kind_of) == "stiffness", np.log(1.3), 0.0)
    count = own_resonance_errors(problem, np.zeros(n_param)).size
    assert count >= 4
    judge = Judge(problem, np.ones(count, bool))
    assert judge.meets(np.zeros(n_param))
    assert not judge.meets(wrong)
    assert Judge(problem, own_resonance_errors(problem, wrong) <= 0.02).meets(wrong)


def test_scores_hold_the_data_alone(problem):
    study = WernholtStudy(kind="wernholt2008", campaign="bench", estimators=CHOICES, fit=OPTIONS)
    user, optimal = score_options(study)
    assert (user.weights.kind, optimal.weights.kind) == ("user", "optimal")
    robot = with_spring_factors(two_joint_robot(), 10.0)
    frf = problem.frf
    scored = set_up(robot, frf, user, 0.0)[0]
    internal = np.full(len(scored.parameters.names), -0.5)
    own = scored.configuration_cost(scored.model_response(internal), internal).sum()
    assert scored.cost(internal) == pytest.approx(own, rel=1e-9)


def test_all_estimators_start_at_the_same_points():
    study = WernholtStudy(kind="wernholt2008", campaign="bench", estimators=CHOICES, fit=OPTIONS, wide=("lls15u",))
    found = sets(study)
    assert [one.group for one in found] == [""] * 6 + ["2dec"] + ["plain"] * 6
    assert [one.name for one in found if one.alone] == ["lls1u", "lls1u"]
    assert {(one.options.seed, one.options.starts) for one in found} == {(1, 2)}
    assert [one.options.start_decades for one in found[5:8]] == [1, 2, 1]
    assert {one.options.strategy for one in found if one.group == "plain"} == {"plain"}


def test_individuals_are_fitted_by_all_estimators_of_all_configurations_or_by_those_named():
    study = WernholtStudy(kind="wernholt2008", campaign="bench", estimators=CHOICES)
    assert estimators_of(study) == ["lls15u", "lls15o", "llsm15u", "nls15u", "nls15o"]
    assert estimators_of(study.model_copy(update={"individual_estimators": ("llsm15u",)})) == ["llsm15u"]


def test_the_best_configuration_has_the_most_information():
    robot = two_joint_robot()
    frf = exact_frf(robot, CONFIGURATIONS, FREQUENCY_HZ, relative_noise=1e-3)
    covariance = frf.total_covariance * np.array([100.0, 1.0])[:, None, None, None]
    assert best_configuration(robot, replace(frf, total_covariance=covariance), OPTIONS, 0.0) == 1
    covariance = frf.total_covariance * np.array([1.0, 100.0])[:, None, None, None]
    assert best_configuration(robot, replace(frf, total_covariance=covariance), OPTIONS, 0.0) == 0


@pytest.fixture
def individuals(found):
    """Six robots: each estimator's errors in units of its own, springs of bearings as easy as those of gears."""

    def make(**size):
        names = found().problem.parameters.names
        generator = np.random.default_rng(1)
        error = generator.standard_normal((6, 1)) * 0.001 + generator.choice([-1.0, 1.0], (6, len(names)))
        return Individuals(
            names=names,
            error={name: value * error for name, value in size.items()},
            physical={name: 0.1 * value * error for name, value in size.items()},
            std={name: np.full(error.shape, value) for name, value in size.items()},
            inside={name: np.ones(error.shape, bool) for name in size},
            misfit={name: np.full(6, 40.0) for name in size},
        )

    return make


def held(found, shown):
    gears = np.array(["gear" in name for name in found.problem.parameters.names])
    return claims(found, CHOICES, gears, shown)


def test_phase_and_rough_weights_are_judged_by_errors_of_several_robots(found, individuals):
    phase, rough = held(found(llsm15u=90, lls15o=90), individuals(lls15u=0.01, llsm15u=0.02, lls15o=0.015))[2:4]
    assert (phase.word, rough.word) == ("yes", "yes")
    for text in (
        "an error of 1.0 % (lls15u) and 2.0 % (llsm15u), 0.50 to 0.50 times as large",
        "rank correlation of both errors 1.0, as what the model lacks makes most of them",
        "along 0.10 % (lls15u) and 0.20 % (llsm15u), 0.50 to 0.50 times as large",
    ):
        assert text in phase.figures
    phase, rough = held(found(llsm15u=10, lls15o=10), individuals(lls15u=0.01, llsm15u=0.005, lls15o=0.01))[2:4]
    assert (phase.word, rough.word) == ("refuted", "refuted")


def scattering(shown, name, spread):
    vary = 1 + spread * np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0])[:, None]
    return replace(shown, error={**shown.error, name: shown.error[name] * vary})


def test_a_gain_that_the_interval_neither_shows_nor_excludes_is_undecided(found, individuals):
    shown = individuals(lls15u=0.01, llsm15u=0.01, lls15o=0.0103)
    assert held(found(), scattering(shown, "llsm15u", 0.3))[2].word == "undecided"
    assert held(found(), scattering(shown, "llsm15u", 0.05))[2].word == "refuted"
    assert held(found(), scattering(shown, "lls15o", 0.005))[3].word == "yes"


def test_kinds_of_springs_are_judged_by_errors_of_several_robots(found, individuals):
    shown = individuals(lls15u=0.01, llsm15u=0.01, lls15o=0.01)
    gears = np.array(["gear" in name for name in shown.names])
    vary = 1 + 0.01 * np.arange(6)[:, None]

    def easier(wrong):
        error = shown.error["lls15u"] * vary
        error = np.where(gears, error / wrong, error)
        claim = held(found(), replace(shown, error={**shown.error, "lls15u": error}))[4]
        assert "lls15u states deviations of 1.0 % and 1.0 %" in claim.figures
        return claim.word

    assert easier(2) == "yes"
    assert easier(0.5) == "refuted"


def test_stated_deviations_are_half_widths_of_intervals_wherever_these_lie():
    found = stated_std(np.array([50.0, 2.0, -1.0]), np.array([200.0, 2.0, 1.0]), 0.95)
    assert found[:2] == pytest.approx([np.log(2) / 1.959964, 0.0], rel=1e-6)
    assert np.isnan(found[2])
