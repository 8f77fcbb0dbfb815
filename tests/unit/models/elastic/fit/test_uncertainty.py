"""Model error, influence and undetermined combinations where the truth is known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t

from exact_systems import certain, exact_frf, two_joint_robot, two_mass_robot, with_spring_factors
from realizations import averaged
from robid.errors import DataError
from robid.frf.joined import join
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.model_error import estimate_model_error
from robid.models.elastic.fit.options import ElasticOptions, Weights
from robid.models.elastic.fit.parameters import map_parameters
from robid.models.elastic.fit.problem import make_problem
from robid.models.elastic.fit.uncertainty import (
    influence,
    realization_covariance,
    realization_freedom,
    realization_shifts,
    sandwich,
    structured_covariance,
)
from robid.results.estimate import undetermined_combinations
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters
from tolerances import IDENTITY

FREQUENCY_HZ = np.geomspace(2.0, 60.0, 50)
CONFIGURATIONS = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2], [0.1, -0.4]])
OPTIONS = ElasticOptions(weights=Weights("optimal"), free=("stiffness", "damping"))


@pytest.fixture(scope="module")
def exact():
    return exact_frf(two_joint_robot(), CONFIGURATIONS, FREQUENCY_HZ)


def problem_at_truth(frf, options=OPTIONS):
    model = build_model(two_joint_robot())
    linear = linearize(model, solve_statics(model, frf.configurations), frf.output_names)
    nominal = nominal_parameters(two_joint_robot(), linear, 0.0)
    parameters = map_parameters(two_joint_robot(), nominal, options, (), np.zeros(0))
    return make_problem(frf, linear, parameters, options)[0], np.zeros(len(parameters.names))


def found_error(frf, options=OPTIONS):
    problem, internal = problem_at_truth(frf, options)
    return estimate_model_error(problem, internal, influence(problem, internal))


@pytest.mark.parametrize("estimator", ["lls", "llsm", "nls"])
def test_noise_alone_leaves_its_band_in_five_percent(exact, estimator):
    errors = [
        found_error(averaged(exact, 0.005, seed=seed), replace(OPTIONS, estimator=estimator)) for seed in range(40)
    ]
    # 40 x 16 elements, at the truth instead of the minimum: 5 % within four deviations.
    assert np.mean([error.share_above for error in errors]) == pytest.approx(0.05, abs=4 * np.sqrt(0.05 * 0.95 / 640))
    assert np.mean([error.share_correlated for error in errors]) == pytest.approx(0.05, abs=0.035)
    assert np.mean([error.ratio.mean() for error in errors]) == pytest.approx(1.0, abs=0.05)


def test_model_error_of_one_element_is_measured_there(exact):
    wrong = exact.response.copy()
    wrong[2, :, 0, 1] *= 1 + 0.04 * np.exp(1j * np.linspace(0, 9, FREQUENCY_HZ.size))
    error = found_error(averaged(replace(exact, response=wrong), 0.002, seed=3))
    assert error.level[2, 0, 1] == pytest.approx(0.04, rel=0.15)
    assert error.correlation[2, 0, 1] > 0.8 > error.correlation_limit[2, 0, 1]
    others = np.ones(error.level.shape, bool)
    others[2, 0, 1] = False
    assert error.level[others].max() < 0.01
    assert error.correlation[others].max() < 0.8


def test_inflated_by_its_level_the_cost_meets_its_expectation(exact):
    generator = np.random.default_rng(8)
    shape = exact.response.shape
    spread = 0.03 * (generator.standard_normal(shape) + 1j * generator.standard_normal(shape)) / np.sqrt(2)
    frf = averaged(replace(exact, response=exact.response * (1 + spread)), 0.003, seed=1)
    assert np.sqrt(np.mean(found_error(frf).level ** 2)) == pytest.approx(0.03, rel=0.05)


def test_without_a_covariance_there_is_no_model_error(exact):
    assert found_error(exact, replace(OPTIONS, weights=Weights("user"))) is None


@pytest.mark.parametrize("weights", ["optimal", "optimal_full"])
@pytest.mark.parametrize("estimator", ["lls", "llsm", "nls"])
def test_influence_is_what_an_error_does_to_the_fit(exact, estimator, weights):
    options = replace(OPTIONS, estimator=estimator, weights=Weights(weights), prior_decades=1e6, statics_updates=0)
    noisy = averaged(exact, 0.002, seed=2)
    problem, internal = problem_at_truth(noisy, options)
    disturbance = 1e-6 * exact.response * np.random.default_rng(1).standard_normal(exact.response.shape)
    still = replace(problem, frf=replace(noisy, response=exact.response))
    moved = replace(still, frf=replace(noisy, response=exact.response + disturbance))
    here = moved.normal(internal)
    wanted = -np.linalg.solve(here.hessian, here.gradient)
    np.testing.assert_allclose(influence(still, internal).shifts(disturbance).sum(axis=0), wanted, rtol=1e-4)


def test_realizations_give_the_covariance_that_the_structure_gives(exact):
    ratios, freedoms = [], []
    for seed in range(30):
        problem, internal = problem_at_truth(averaged(exact, 0.005, seed=seed))
        found = influence(problem, internal)
        shifts = realization_shifts(problem, found)
        ratios.append(np.diag(realization_covariance(found, shifts)) / np.diag(sandwich(problem, internal)))
        freedoms.append(realization_freedom(shifts))
    # Four configurations of three degrees of freedom each, in thirty data sets of eight parameters.
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.15)
    assert 3 <= np.min(freedoms) <= np.max(freedoms) <= 12
    assert np.var(ratios) == pytest.approx(2 / np.median(freedoms), rel=0.6)


def test_leverage_adds_up_to_the_parameters(exact):
    problem, internal = problem_at_truth(averaged(exact, 0.005), replace(OPTIONS, prior_decades=1e6))
    assert influence(problem, internal).leverage.sum() == pytest.approx(internal.size, rel=1e-6)


def test_springs_in_series_are_told_as_a_combination():
    # Only k1 k2 / (k1 + k2) counts; of k1 = 3 k2 the logarithm moves by a quarter, of k2 by three.
    rows = np.array([[0.25, 0.75, 0.0], [0.0, 0.0, 1.0]])
    covariance = np.linalg.inv(1e6 * rows.T @ rows + np.eye(3) / np.log(10) ** 2)
    names = ("first.stiffness", "second.stiffness", "third.stiffness")
    (sentence,) = undetermined_combinations(names, covariance, np.ones(3), 0.2)
    assert sentence.startswith("first.stiffness is known only to a factor of 8.8")
    assert "where it rises, second.stiffness falls (exponent -0.33), and only the combination" in sentence
    assert undetermined_combinations(names, covariance, np.array([0.01, 0.01, 1.0]), 0.2) == ()


def test_parameters_that_are_each_unknown_are_told_apart():
    generator = np.random.default_rng(2)
    deviations = np.array([1e-3, 0.5, 2e-3, 0.5])
    turned = np.linalg.qr(generator.standard_normal((4, 4)))[0]
    covariance = np.diag(deviations**2) + 1e-12 * turned @ turned.T
    told = undetermined_combinations(("a", "b", "c", "d"), covariance, np.ones(4), 0.2)
    assert sorted(told) == ["b is known only to 50 %", "d is known only to 50 %"]


def test_a_fit_says_what_it_cannot_determine():
    # A bearing so stiff that the noise hides what its damper does.
    robot = with_spring_factors(two_joint_robot(), [1.0, 1.0, 100.0, 1.0], [1.0, 1.0, 100.0, 1.0])
    frf = averaged(exact_frf(robot, CONFIGURATIONS, FREQUENCY_HZ), 0.03)
    (sentence,) = fit_elastic(robot, frf, OPTIONS, 0.0).estimate.undetermined
    assert sentence.startswith("bearing_1.damping is known only to a factor of")


@pytest.mark.parametrize(
    ("change", "options", "told"),
    [
        ({"realization_error": None}, ElasticOptions(bootstrap=5), "D245"),
        ({"total_covariance": None}, OPTIONS, "D242"),
        ({"total_covariance": "noise"}, OPTIONS, "D244"),
        ({"total_covariance": "hole"}, OPTIONS, r"the covariance is singular at 2\.14 Hz"),
        ({"total_covariance": "nan"}, ElasticOptions(), r"the covariance is not finite at 2\.14 Hz"),
    ],
)
def test_what_the_options_need_is_asked_for_before_the_fit(exact, change, options, told):
    frf = averaged(exact, 0.01)
    damaged = frf.total_covariance.copy()
    damaged[1, 1] *= {"hole": 0.0, "nan": np.nan}.get(change.get("total_covariance"), 1.0)
    if change.get("total_covariance") == "noise":
        frf = replace(frf, noise_covariance=frf.total_covariance, total_covariance=None)
    elif "total_covariance" in change:
        frf = replace(frf, total_covariance=None if change["total_covariance"] is None else damaged)
    else:
        frf = replace(frf, **change)
    with pytest.raises(DataError, match=told) as caught:
        fit_elastic(two_joint_robot(), frf, options, 0.0)
    assert caught.value.remedy


def test_a_bootstrap_does_not_depend_on_how_it_is_spread():
    robot = two_mass_robot(damping=0.5)
    frf = averaged(exact_frf(robot, [[0.0]], FREQUENCY_HZ), 0.01)
    options = ElasticOptions(bootstrap=25, free=("stiffness", "damping"))

    def backwards(function, tasks):
        return [function(task) for task in reversed(tasks)][::-1]

    one, other = (fit_elastic(robot, frf, options, 0.0, *how) for how in ((), (backwards,)))
    np.testing.assert_array_equal(one.bootstrap.lower, other.bootstrap.lower)
    assert (one.bootstrap.lower < one.estimate.value).all()
    assert (one.estimate.value < one.bootstrap.upper).all()


def test_estimated_model_error_weighs_the_wrong_element_down(exact):
    # One element is off by a smooth 10 %, as an unmodelled mode would make it.
    wrong = exact.response.copy()
    wrong[:, :, 1, 0] *= 1 + 0.1 * np.exp(1j * np.linspace(0, 3, FREQUENCY_HZ.size))
    frf = averaged(replace(exact, response=wrong), 0.002, seed=3)
    nominal = with_spring_factors(two_joint_robot(), 1.1)
    errors = {}
    for kind in ("optimal", "estimated"):
        solution = fit_elastic(nominal, frf, replace(OPTIONS, weights=Weights(kind)), 0.0)
        truth = np.concatenate([[s.stiffness for s in two_joint_robot().springs],
                                [s.damping for s in two_joint_robot().springs]])  # fmt: skip
        errors[kind] = np.abs(solution.estimate.value / truth - 1)
    assert np.median(errors["estimated"]) < 0.2 * np.median(errors["optimal"])
    assert solution.model_error.level[:, 1, 0] == pytest.approx(0.1, rel=0.2)
    assert np.median(solution.model_error.level[:, [0, 1], [0, 1]]) < 0.01


def scattered_fit(scatter, seed):
    """A fit of ten configurations whose springs all differ, which the model does not know."""
    generator = np.random.default_rng(seed)
    configurations = generator.uniform(-1.4, 1.4, (10, 2))
    factors = np.exp(scatter * generator.standard_normal((10, 4)))
    frfs = [
        averaged(exact_frf(with_spring_factors(two_joint_robot(), each), place, FREQUENCY_HZ), 0.003, seed=seed + index)
        for index, (each, place) in enumerate(zip(factors, configurations, strict=True))
    ]
    options = replace(OPTIONS, strategy="plain", statics_updates=1)
    return fit_elastic(certain(two_joint_robot()), join(frfs, [str(index) for index in range(10)]), options, 0.0)


def test_springs_that_follow_a_damper_that_ran_off_are_held_all_the_same():
    estimate = scattered_fit(0.02, 270).estimate
    springs, dampers = (np.array(estimate.kinds) == kind for kind in ("stiffness", "damping"))
    assert (estimate.value[dampers] < 1e-3 * estimate.nominal[dampers]).any()
    assert (np.abs(np.log(estimate.value[springs] / estimate.nominal[springs])) > 0.3).any()
    assert (estimate.effective_lower[springs] <= estimate.nominal[springs]).all()
    assert (estimate.nominal[springs] <= estimate.effective_upper[springs]).all()
    assert (estimate.effective_upper[springs] < 2.5 * estimate.effective_lower[springs]).all()


def test_where_nothing_ran_off_the_second_fit_widens_nothing():
    solution = scattered_fit(0.02, 0)
    estimate, internal = solution.estimate, solution.internal
    half = 0.5 * np.log(estimate.effective_upper / estimate.effective_lower)[np.array(estimate.kinds) == "stiffness"]
    reach = t.ppf(0.975, internal.degrees_of_freedom) * np.sqrt(np.diag(internal.covariance))
    np.testing.assert_allclose(half, reach[: half.size], rtol=0.02)


def test_what_differs_between_configurations_widens_the_intervals():
    held, alone = [], []
    for seed in range(0, 300, 30):
        solution = scattered_fit(0.02, seed)
        springs = np.array(solution.estimate.kinds) == "stiffness"
        held.append(
            (
                (solution.estimate.lower <= solution.estimate.nominal)
                & (solution.estimate.nominal <= solution.estimate.upper)
            )[springs]
        )
        alone.append(solution.realization_relative_std[springs] / solution.estimate.relative_std[springs])
    assert np.mean(held) > 0.85
    estimate, freedom = solution.estimate, solution.internal.degrees_of_freedom
    differ = "what 10 clusters of configurations differ by, and 2 nuisance parameters of the robot file"
    assert estimate.interval_rule == f"noise and assumed model error, {differ}"  # that of the physical one
    reach = t.ppf(0.975, freedom) * np.sqrt(np.diag(solution.internal.covariance))
    half = 0.5 * np.log(estimate.effective_upper / estimate.effective_lower)
    assert (half[springs] > (1 - IDENTITY) * reach[springs]).all()
    assert (freedom[springs] < 9.1).all()
    assert np.median(alone) < 0.5, "noise alone must say far less, or there is nothing to widen"


@pytest.mark.parametrize("estimator", ["lls", "nls"])
@pytest.mark.parametrize("extra", [(), ("elbow.arm",)])
def test_reciprocal_elements_share_the_assumed_model_error(estimator, extra):
    outputs = (*extra, "shoulder", "elbow")
    frf = exact_frf(two_joint_robot(), CONFIGURATIONS, FREQUENCY_HZ, declared_noise=1e-9, output_names=outputs)
    options = replace(OPTIONS, weights=Weights("inflated"), estimator=estimator, prior_decades=1e6)
    problem, internal = problem_at_truth(frf, options)
    found = influence(problem, internal)
    generator = np.random.default_rng(1)
    shape = (2000, *frf.response.shape)
    error = 0.02 * (generator.standard_normal(shape) + 1j * generator.standard_normal(shape)) / np.sqrt(2)
    row = len(extra)
    error[:, :, :, row, 1] = error[:, :, :, row + 1, 0]
    errors = np.moveaxis(error * frf.response, 0, 1)
    moves = found.shifts(errors).sum(axis=0)
    np.testing.assert_allclose(moves.var(axis=0), np.diag(structured_covariance(problem, found)), rtol=0.15)
    alone = replace(problem, model=replace(problem.model, tilt=np.ones_like(problem.model.tilt)))
    ratio = np.diag(structured_covariance(problem, found)) / np.diag(structured_covariance(alone, found))
    assert ratio.max() > 1.2
