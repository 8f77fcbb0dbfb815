"""A right model passes in configurations its fit never saw, a wrong one fails; the truth is counted exactly."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot, with_spring_factors
from robid.errors import DataError
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.fitted import fitted_model
from robid.models.elastic.judge.grading import Measures
from robid.models.elastic.judge.validating import median_spring_half_width, validate_elastic
from robid.results.grade import PREDICTS
from robid.results.outcome import Recovery, recover, recovery_sentence
from solutions import with_estimate

FREQUENCY_HZ = np.unique(np.round(np.geomspace(1, 60, 40), 1))
SEEN = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2], [-1.1, 0.3]])
NEW = np.array([[0.1, 0.9], [-0.8, -0.4]])
DELAY_S = 1e-3
OPTIONS = ElasticOptions()


def truth_of(robot):
    springs = {f"{spring.name}.stiffness": spring.stiffness for spring in robot.springs}
    dampers = {f"{spring.name}.damping": spring.damping for spring in robot.springs}
    return springs | dampers | {"delay": DELAY_S}


@pytest.fixture(scope="module")
def nominal():
    return two_joint_robot()


@pytest.fixture(scope="module")
def true_arm(nominal):
    return with_spring_factors(nominal, [1.3, 0.8, 1.2, 0.9], [0.7, 1.4, 1.2, 0.8])


@pytest.fixture(scope="module")
def solution(nominal, true_arm):
    frf = exact_frf(true_arm, SEEN, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=0.003, seed=1)
    return fit_elastic(nominal, frf, OPTIONS, DELAY_S)


@pytest.fixture(scope="module")
def fresh(true_arm):
    return exact_frf(true_arm, NEW, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=0.003, seed=2)


@pytest.fixture(scope="module")
def validation(nominal, true_arm, solution, fresh):
    return validate_elastic(nominal, solution, fresh, OPTIONS, DELAY_S, truth_of(true_arm))


def test_right_model_passes_at_the_cost_of_noise(validation):
    assert validation.outcome.ok
    assert "predicts 2 new configurations" in validation.outcome.verdict
    np.testing.assert_allclose(validation.cost, validation.expected_cost, rtol=0.25)
    np.testing.assert_allclose(validation.excess, validation.cost - validation.expected_cost)
    assert validation.median_error_db < 0.15


def test_average_and_worst_are_those_of_the_costs(validation):
    per_element = validation.cost / validation.elements
    assert validation.worst_configuration == np.argmax(per_element)
    assert validation.worst_cost == per_element.max()
    assert validation.average_cost == per_element.mean()


def test_cost_is_the_weighted_log_error_written_out(nominal, solution, fresh, validation):
    weight = fitted_model(nominal, solution, fresh, OPTIONS, DELAY_S).problem.weight
    ratio = fresh.response / validation.modelled
    wanted = (weight * (np.log(np.abs(ratio)) ** 2 + np.angle(ratio) ** 2)).sum(axis=(1, 2, 3))
    np.testing.assert_allclose(validation.cost, wanted, rtol=1e-10)


def test_decibels_are_those_of_a_scaled_response(nominal, solution, fresh, validation):
    scaled = replace(fresh, response=validation.modelled * 10 ** (3.0 / 20), total_covariance=None)
    found = validate_elastic(nominal, solution, scaled, OPTIONS, DELAY_S, None)
    np.testing.assert_allclose([found.median_error_db, found.worst_error_db, *found.error_db.ravel()], 3.0, rtol=1e-9)
    assert not found.outcome.ok
    assert found.outcome.verdict.startswith("does not predict 2 new configurations")


def test_wrong_payload_fails(nominal, true_arm, solution):
    heavier = replace(true_arm, payload=replace(true_arm.payload, mass_kg=12.0))
    frf = exact_frf(heavier, NEW, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=0.003, seed=2)
    found = validate_elastic(nominal, solution, frf, OPTIONS, DELAY_S, None)
    assert not found.outcome.ok
    assert found.cost_ratio > 1.5


def test_a_bad_fit_makes_no_allowance_for_itself(nominal, solution, true_arm, fresh):
    """However badly a model fits its own data, the same new data must fail it."""
    heavier = replace(true_arm, payload=replace(true_arm.payload, mass_kg=12.0))
    frf = exact_frf(heavier, NEW, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=0.003, seed=2)
    poor = replace(
        solution,
        costs=replace(solution.costs, configuration=1e4 * solution.costs.configuration),
        misfit=1e4 * solution.misfit,
    )
    ratios = [validate_elastic(nominal, one, frf, OPTIONS, DELAY_S, None).cost_ratio for one in (solution, poor)]
    assert ratios[0] == ratios[1] > 1.5
    found = validate_elastic(nominal, poor, fresh, OPTIONS, DELAY_S, None)
    assert found.outcome.ok
    assert found.outcome.grade.value == 1
    assert "the residual costs" in found.outcome.grade.sentence


def test_the_weights_of_a_fit_decide_nothing_about_the_limits(nominal, solution, fresh, validation):
    noise_only = replace(OPTIONS, weights=replace(OPTIONS.weights, kind="optimal"))
    found = validate_elastic(nominal, solution, fresh, noise_only, DELAY_S, None)
    np.testing.assert_allclose(found.error_ratio, validation.error_ratio, rtol=1e-9)


def test_phase_and_resonances_have_limits_of_their_own(nominal, solution, fresh, validation):
    late = np.exp(-1j * np.deg2rad(9.0))
    turned = replace(fresh, response=validation.modelled * late, total_covariance=None)
    found = validate_elastic(nominal, solution, turned, OPTIONS, DELAY_S, None)
    assert found.motor_error_deg == pytest.approx(9.0)
    assert not found.outcome.ok
    assert "9 degrees in the median, limit 7" in found.outcome.verdict
    assert validation.resonances > 4
    assert validation.resonance_shift < 0.01
    measures = Measures(np.array([0.1]), 0.01, 0.1, 0.05, 6)
    assert measures.failures() == ("resonances are off by 5 % in the median, limit 3",)


def test_a_right_model_can_be_trusted(validation):
    assert (validation.outcome.grade.value, validation.outcome.grade.reasons) == (2, ())
    assert validation.outcome.grade.sentence.startswith("Trust")


def test_three_places_are_not_trusted_until_the_remedy_is_followed(nominal, true_arm, fresh, validation):
    frf = exact_frf(true_arm, SEEN[:3], FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=0.003, seed=1)
    few = fit_elastic(nominal, frf, OPTIONS, DELAY_S)
    grade = validate_elastic(nominal, few, fresh, OPTIONS, DELAY_S, None).outcome.grade
    assert grade.value == PREDICTS
    assert "all was measured in 3 clusters of configurations" in grade.sentence
    assert grade.sentence.endswith("measure 1 more configuration.")
    assert validation.outcome.grade.sentence.startswith("Trust")  # it is of the same configurations and one more
    assert {"payload.mass", "gear_1.load_stiffness"} <= {*few.doubts.names}  # what was carried along is told
    assert (few.doubts.half_width > 0).all()


def test_truth_is_counted(nominal, true_arm, solution, fresh, validation):
    recovery = validation.outcome.recovery
    index = [solution.estimate.names.index(name) for name in recovery.names]
    np.testing.assert_allclose(
        recovery.truth * (1 + recovery.relative_error), solution.estimate.value[index], rtol=1e-9
    )
    springs = [name.endswith(".stiffness") for name in recovery.names]
    within, known = recovery.within("stiffness", 0.02)
    assert known == 4
    assert within == (np.abs(recovery.relative_error[springs]) <= 0.02).sum() > 2
    assert recovery.coverage == recovery.covered[recovery.identifiable].mean()
    shifted = truth_of(with_spring_factors(true_arm, [1.2, 1.0, 1.0, 1.0]))
    found = validate_elastic(nominal, solution, fresh, OPTIONS, DELAY_S, shifted).outcome.recovery
    assert found.within("stiffness", 0.02) == (within - 1, 4)
    assert not found.covered[found.names.index("gear_1.stiffness")]


def test_without_truth_nothing_is_claimed(nominal, solution, fresh):
    found = validate_elastic(nominal, solution, fresh, OPTIONS, DELAY_S, None).outcome.recovery
    assert (found.names, found.coverage, found.within("stiffness", 0.02)) == ((), None, (0, 0))
    assert recovery_sentence(found) == ""


def test_truth_is_told_in_a_sentence():
    # The last is a correction of friction, which no count of parameters contains.
    error, covered = np.array([0.03] + 13 * [0.01]), np.arange(14) > 1
    kinds = (*("stiffness",) * 13, "friction")
    found = Recovery(("s",) * 14, kinds, np.ones(14), error, covered, np.ones(14, bool))
    assert recovery_sentence(found) == "Against the truth: 12 of 13 springs within 2 %, 11 of 13 intervals contain it."


def test_where_all_configurations_were_seen_nothing_is_said_of_others(nominal, solution, fresh):
    def validated(*places):
        moved = replace(fresh, configurations=np.array(places))
        return validate_elastic(nominal, solution, moved, OPTIONS, DELAY_S, None).outcome

    seen, mixed = validated(SEEN[1], SEEN[2] + 1e-5), validated(NEW[0], SEEN[2])
    told = "the validation repeats configurations of the fit: nothing was tested in others"
    assert told in seen.grade.messages
    assert "same_configuration" in seen.grade.causes
    assert seen.grade.value <= PREDICTS
    assert "of the fit" in seen.verdict
    assert told not in mixed.grade.messages
    assert "new configurations" in mixed.verdict


@pytest.mark.parametrize("change", ["robot", "options", "delay"])
def test_what_the_fit_did_not_use_is_refused(nominal, solution, fresh, change):
    robot = with_spring_factors(nominal, 1.1) if change == "robot" else nominal
    options = replace(OPTIONS, free=("stiffness", "damping", "delay")) if change == "options" else OPTIONS
    delay_s = 2e-3 if change == "delay" else DELAY_S
    with pytest.raises(DataError, match="D135"):
        validate_elastic(robot, solution, fresh, options, delay_s, None)


def test_fitted_friction_moves_the_new_data_by_shared_names(nominal, solution, fresh):
    generator = np.random.default_rng(3)
    sensitivity = generator.standard_normal((2, 2, *fresh.response.shape[1:])) * (1 + 0j)
    names = ("elbow.level", "shoulder.level")
    frf = replace(fresh, sensitivity=sensitivity, coefficient_names=names, coefficient_relative_std=np.full(2, 0.1))
    known = with_estimate(
        replace(solution, internal=replace(solution.internal, values=np.append(solution.internal.values, 0.05))),
        names=(*solution.estimate.names, "shoulder.level"),
        kinds=(*solution.estimate.kinds, "friction"),
        nominal=np.append(solution.estimate.nominal, 0.0),
        value=np.append(solution.estimate.value, 0.05),
    )
    measured = fitted_model(nominal, known, frf, OPTIONS, DELAY_S).measured
    np.testing.assert_allclose(measured - fresh.response, 0.05 * sensitivity[:, 1], rtol=0.01)


def test_statics_are_those_of_the_fitted_springs(nominal):
    soft = with_spring_factors(nominal, 0.1)
    frf = exact_frf(soft, NEW, FREQUENCY_HZ, delay_s=DELAY_S)
    values = truth_of(soft) | {"shoulder.viscous": 0.0, "elbow.viscous": 0.0}
    start = fit_elastic(nominal, exact_frf(nominal, SEEN, FREQUENCY_HZ, delay_s=DELAY_S), OPTIONS, DELAY_S)
    values |= {f"{joint.name}.motor_inertia": joint.motor.inertia_kgm2 for joint in soft.joints}
    estimate = np.array([values[name] for name in start.estimate.names])
    logarithmic = np.array([kind in ("stiffness", "damping", "motor_inertia") for kind in start.estimate.kinds])
    ratio = np.divide(estimate, start.estimate.nominal, out=np.ones_like(estimate), where=logarithmic)
    internal = replace(start.internal, values=np.where(logarithmic, np.log(ratio), 0.0))
    known = with_estimate(replace(start, internal=internal), value=estimate)
    found = validate_elastic(nominal, known, frf, OPTIONS, DELAY_S, None)
    np.testing.assert_allclose(found.modelled, frf.response, rtol=1e-9)


def test_coverage_counts_identifiable_parameters_only(true_arm, solution):
    truth = truth_of(true_arm)
    estimate = solution.estimate
    narrow = replace(estimate, lower=estimate.value, upper=estimate.value)
    hit = {name: value for name, value in zip(estimate.names, estimate.value, strict=True) if name in truth}
    truth |= {name: hit[name] for name in list(hit)[:2]}
    identifiable = np.array([name in list(hit)[1:4] for name in estimate.names])
    assert recover(replace(narrow, identifiable=identifiable), truth).coverage == pytest.approx(1 / 3)
    assert recover(replace(narrow, identifiable=np.zeros(len(estimate.names), bool)), truth).coverage is None


def test_median_half_width_is_that_of_the_springs(solution):
    springs = [index for index, kind in enumerate(solution.estimate.kinds) if kind == "stiffness"]
    lower, upper = solution.estimate.lower.copy(), solution.estimate.upper.copy()
    for width, index in zip([0.01, 0.02, 0.04, 0.5], springs, strict=True):
        lower[index], upper[index] = solution.estimate.value[index] * np.array([1 - width, 1 + width])
    found = median_spring_half_width(replace(solution.estimate, lower=lower, upper=upper))
    assert found == pytest.approx(0.03)
    dampers = tuple("damping" for _ in solution.estimate.kinds)
    assert median_spring_half_width(replace(solution.estimate, kinds=dampers)) is None
