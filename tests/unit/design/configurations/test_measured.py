"""Information by measured covariance against the fit's own sandwich and against assumed noise."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from scipy.stats import spearmanr

from exact_systems import exact_frf, two_joint_robot
from robid.design.configurations.candidates import candidate_information
from robid.design.configurations.information import design_configurations
from robid.design.configurations.measured import fitted_information, measured_information
from robid.design.configurations.options import DesignOptions
from robid.design.configurations.visits import merged
from robid.errors import DataError, SettingsError
from robid.models.elastic.fit.fitting import set_up
from robid.models.elastic.fit.options import ElasticOptions, Weights
from robid.models.elastic.fit.problem import make_problem
from robid.models.elastic.fit.uncertainty import sandwich
from robid.models.elastic.fit.weights import make_weights

ROBOT = two_joint_robot()
CONFIGURATIONS = np.array([[0.3, 0.4], [0.1, -1.2], [0.7, 1.0]])
DELAY_S = 1e-3


@pytest.fixture(scope="module")
def frf():
    """A response without error that claims a small one, correlated over outputs and inputs and unequal by element."""
    found = exact_frf(ROBOT, CONFIGURATIONS, np.geomspace(2, 60, 25), declared_noise=1e-6, delay_s=DELAY_S)
    mixing = np.array([[1, 0.3 + 0.4j], [0.3 - 0.4j, 1]])
    root = np.sqrt(np.real(np.diagonal(found.total_covariance, axis1=-2, axis2=-1)))
    return replace(
        found,
        total_covariance=root[..., :, None] * mixing * root[..., None, :],
        input_factor=found.input_factor * np.array([[1, 0.5j], [-0.5j, 2]]),
        element_scale=np.broadcast_to([[1.0, 2.0], [3.0, 1.5]], found.element_scale.shape),
    )


def fit_covariance(frf, options, n_param):
    problem, _ = set_up(ROBOT, frf, options, DELAY_S)
    return sandwich(problem, np.zeros(len(problem.parameters.names)))[:n_param, :n_param], problem


def told(found, configurations, count):
    """Information about the first parameters that a fit to some of the configurations gives."""
    parts = found.parts()[0, list(configurations)].sum(axis=0)
    return merged(found.base(np.zeros((count, count))) + parts, count)


def louder(frf):
    """The same with errors that matter beside a model error and what is known of friction, some above 10 dB."""
    scale = np.array([[1e8, 3e9], [1e10, 2e8]]) * np.arange(1, 1 + len(frf.response))[:, None, None]
    return replace(frf, element_scale=scale * np.ones(frf.element_scale.shape))


def assert_same(first, second):
    """Relative difference in every direction."""
    np.testing.assert_allclose(np.linalg.eigvals(np.linalg.solve(first, second)).real, 1, rtol=1e-5)


@pytest.mark.parametrize("index", range(3))
def test_information_is_the_inverse_covariance_of_the_optimally_weighted_fit(frf, index):
    options = ElasticOptions(weights=Weights("optimal_full"), prior_decades=1e6)
    matrices, names = measured_information(ROBOT, frf, DELAY_S)
    covariance, problem = fit_covariance(frf.select([index]), options, len(names))
    assert names == problem.parameters.names[: len(names)]
    assert_same(np.linalg.inv(covariance), matrices[index])


def soft(robot, factor=2.0):
    """The robot with springs that are off by a factor."""
    return replace(robot, springs=tuple(replace(each, stiffness=each.stiffness / factor) for each in robot.springs))


def with_friction(frf, deviation=1e-4):
    """Compensated friction that scales each column of the response, as a torque's does, by a known relative push."""
    push = np.array([[0.3, 0.0], [0.0, 0.2j], [0.1j, -0.2]])
    return replace(
        frf,
        sensitivity=push[None, :, None, None, :] * frf.response[:, None],
        coefficient_names=("a", "b", "c"),
        coefficient_relative_std=np.full(3, deviation),
    )


def test_springs_that_are_off_leave_errors_and_friction_relative_to_what_was_measured(frf):
    """As in a fit that starts there: how friction moves the measured response does not depend on the springs."""
    off, one = soft(ROBOT), with_friction(frf).select([1])
    options = ElasticOptions(weights=Weights("optimal_full"), prior_decades=1e6)
    problem, _ = set_up(off, one, options, DELAY_S)
    covariance = sandwich(problem, np.zeros(len(problem.parameters.names)))[:8, :8]
    assert_same(np.linalg.inv(covariance), measured_information(off, one, DELAY_S)[0][0])


def test_bread_and_meat_give_the_sandwich_of_the_fit(frf):
    options = ElasticOptions(weights=Weights("user", off_diagonal=0.3, low_cut_hz=5), prior_decades=1e6)
    one = frf.select([1])
    covariance, problem = fit_covariance(one, options, 8)
    found, names = fitted_information(ROBOT, one, DELAY_S, problem.weight)
    assert_same(np.linalg.inv(covariance), told(found, [0], len(names)))


@pytest.mark.parametrize("estimator", ["lls", "llsm", "nls"])
@pytest.mark.parametrize("kind", ["user", "inflated", "optimal", "optimal_full"])
def test_parts_of_configurations_give_the_sandwich_of_the_fit_to_all_of_them(frf, kind, estimator):
    """Springs off by 2, friction known to 10 %: nuisances are shared, and what is known of them counts once."""
    options = ElasticOptions(weights=Weights(kind, off_diagonal=0.3), estimator=estimator, prior_decades=1e6)
    off, noisy = soft(ROBOT), with_friction(louder(frf), deviation=0.1)
    problem, _ = set_up(off, noisy, options, DELAY_S)
    covariance = sandwich(problem, np.zeros(len(problem.parameters.names)))[:8, :8]
    error = 0.02 if kind == "inflated" else 0.0
    found, names = fitted_information(
        off, noisy, DELAY_S, problem.weight, whitening=problem.whitening, residual=options.residual, model_error=error
    )
    assert_same(np.linalg.inv(covariance), told(found, [0, 1, 2], len(names)))


def overlapping(frf):
    """The same from lines whose windows overlap: an error is shared with the next two, by more at some lines."""
    share = np.array([0.6, 0.2]) * np.linspace(0.5, 1, frf.frequency_hz.size)[:, None]
    return replace(frf, line_correlation=np.broadcast_to(share, (len(frf.response), *share.shape)))


@pytest.mark.parametrize("estimator", ["lls", "llsm", "nls"])
@pytest.mark.parametrize("kind", ["user", "inflated", "optimal_full"])
def test_overlapping_lines_cost_what_they_cost_the_fit(frf, kind, estimator):
    options = ElasticOptions(weights=Weights(kind, off_diagonal=0.3), estimator=estimator, prior_decades=1e6)
    noisy = with_friction(louder(frf), deviation=0.1)
    shared = overlapping(noisy)
    covariance, problem = fit_covariance(shared, options, 8)
    settings = {
        "whitening": problem.whitening,
        "residual": options.residual,
        "model_error": 0.02 * (kind == "inflated"),
    }
    found = told(fitted_information(ROBOT, shared, DELAY_S, problem.weight, **settings)[0], [0, 1, 2], 8)
    assert_same(np.linalg.inv(covariance), found)
    apart = told(fitted_information(ROBOT, noisy, DELAY_S, problem.weight, **settings)[0], [0, 1, 2], 8)
    assert abs(np.linalg.slogdet(found)[1] - np.linalg.slogdet(apart)[1]) > 0.1


def test_overlapping_lines_cost_what_they_cost_the_optimally_weighted_fit(frf):
    shared = overlapping(with_friction(frf)).select([1])
    covariance, _ = fit_covariance(shared, ElasticOptions(weights=Weights("optimal_full"), prior_decades=1e6), 8)
    assert_same(np.linalg.inv(covariance), measured_information(ROBOT, shared, DELAY_S)[0][0])


def known_rotors(deviation):
    """The robot with another knowledge of its motors' inertias."""
    joints = (replace(each, motor=replace(each.motor, inertia_relative_std=deviation)) for each in ROBOT.joints)
    return replace(ROBOT, joints=tuple(joints))


@pytest.mark.parametrize("deviation", [1e-5, 0.003, 0.05])
def test_what_the_robot_file_knows_of_motor_inertias_counts_once(frf, deviation):
    """In all configurations together, as in the fit; without any nuisance it is as if they were fixed."""
    robot, noisy = known_rotors(deviation), louder(frf)
    problem, _ = set_up(robot, noisy, ElasticOptions(prior_decades=1e6), DELAY_S)
    covariance = sandwich(problem, np.zeros(len(problem.parameters.names)))[:8, :8]
    found, names = fitted_information(robot, noisy, DELAY_S, problem.weight, model_error=0.02)
    assert names == problem.parameters.names[:8]
    assert_same(np.linalg.inv(covariance), told(found, [0, 1, 2], 8))
    fixed, _ = fitted_information(
        robot, noisy, DELAY_S, problem.weight, model_error=0.02, nuisance=("viscous", "delay")
    )
    lost = np.linalg.slogdet(told(fixed, [0, 1, 2], 8))[1] - np.linalg.slogdet(told(found, [0, 1, 2], 8))[1]
    assert lost == pytest.approx(0, abs=1e-3) if deviation == 1e-5 else lost > 0.1


def test_dampers_that_are_estimated_along_are_known_as_in_the_fit(frf):
    """To a tenth of a decade; one motor inertia is fixed, the other known to 5 %."""
    options = ElasticOptions(prior_decades=0.1, fixed=("elbow.motor_inertia",))
    noisy = louder(frf)
    problem, _ = set_up(ROBOT, noisy, options, DELAY_S)
    springs = replace(problem.parameters, prior_std=np.r_[np.full(4, np.inf), problem.parameters.prior_std[4:]])
    problem = replace(problem, parameters=springs)
    covariance = sandwich(problem, np.zeros(len(springs.names)))[:4, :4]
    found, names = fitted_information(
        ROBOT,
        noisy,
        DELAY_S,
        problem.weight,
        kinds=("stiffness",),
        nuisance=options.free[1:],
        fixed=options.fixed,
        model_error=0.02,
        prior_decades=0.1,
    )
    assert names == springs.names[:4]
    assert_same(np.linalg.inv(covariance), told(found, [0, 1, 2], 4))


SUBSETS = list(combinations(range(8), 4))


@pytest.fixture(scope="module")
def eight():
    """A noisy response in eight configurations, and the problem of a fit to any four of them.

    Errors are 2 % of an element's median, a factor of 1.6 more or less in each, as in a sound campaign.
    """
    configurations = np.random.default_rng(4).uniform([-1.5, -2], [1.5, 2], (8, 2))
    exact = exact_frf(ROBOT, configurations, np.geomspace(2, 60, 25), declared_noise=0.02, delay_s=DELAY_S)
    uneven = np.exp(np.random.default_rng(5).normal(0, 0.5, exact.element_scale.shape))
    found = replace(exact, element_scale=uneven)
    drawn = np.random.default_rng(6).normal(0, np.sqrt(0.5), (2, *exact.response.shape))
    noise = np.sqrt(found.element_variance()) * (drawn[0] + 1j * drawn[1])
    found = with_friction(replace(found, response=found.response + noise), deviation=0.1)
    return found, [set_up(ROBOT, found.select(subset), ElasticOptions(), DELAY_S)[0] for subset in SUBSETS]


def ranked(found, true):
    """Rank correlation of what parts promise with what a fit has, and what their choice loses of its deviations."""
    promised = [np.linalg.slogdet(told(found, subset, 8))[1] for subset in SUBSETS]
    lost = np.exp((np.max(true) - true[int(np.argmax(promised))]) / (2 * 8)) - 1
    return spearmanr(promised, true).statistic, lost


@pytest.mark.parametrize("kind", ["user", "inflated", "optimal"])
def test_subsets_rank_as_by_the_covariance_that_the_fit_ends_with(eight, kind):
    """The design has weights from all eight and the noisy response, the fit its own from four and its model.

    They part where the two disagree on what lies below 10 dB, hence 0.95 and not 1.
    """
    frf, problems = eight
    options = ElasticOptions(weights=Weights(kind, off_diagonal=0.3))
    true = []
    for one in problems:
        end = np.zeros(len(one.parameters.names))
        problem, _ = make_problem(one.frf, one.model, one.parameters, options, end)
        true.append(-np.linalg.slogdet(sandwich(problem, end)[:8, :8])[1])
    weights, dropped = make_weights(frf, options.weights, options.residual)
    assert dropped > 0
    error = 0.02 if kind == "inflated" else 0.0
    found, names = fitted_information(ROBOT, frf, DELAY_S, weights, model_error=error)
    rank, lost = ranked(found, true)
    assert rank > 0.95
    assert lost < 0.02
    raw = np.broadcast_to(np.where(np.eye(2) > 0, 1, 0.3), weights.shape)
    worse, more = ranked(fitted_information(ROBOT, frf, DELAY_S, raw, model_error=error)[0], true)
    assert worse < 0.9
    assert more > lost
    alone, _ = measured_information(ROBOT, frf, DELAY_S)
    design = design_configurations(alone, frf.configurations, names, DesignOptions(count=4), fitted=found)
    best = max(SUBSETS, key=lambda subset: np.linalg.slogdet(told(found, subset, 8))[1])
    assert tuple(design.chosen) == best
    covariance = np.linalg.inv(told(found, best, 8))
    np.testing.assert_allclose(design.predicted_relative_std, np.sqrt(np.diag(covariance)), rtol=1e-6)
    assert 0 < design.efficiency <= 1


def test_no_weights_of_a_fit_beat_the_optimal_ones(frf):
    weights = np.random.default_rng(1).uniform(0.1, 2, frf.response.shape)
    optimal, names = measured_information(ROBOT, frf, DELAY_S, corrected=False)
    fitted, _ = fitted_information(ROBOT, frf, DELAY_S, weights)
    for index, best in enumerate(optimal):
        less = told(fitted, [index], len(names))
        scale = np.sqrt(np.diag(best))
        assert np.linalg.eigvalsh((best - less) / (scale[:, None] * scale)).min() > -1e-9


def test_relative_errors_of_the_model_are_the_assumed_noise_with_both_couplings_counted_once(frf):
    """What is reciprocal tells the same twice: half as much each, as independent elements of half the weight."""
    matrices, names = measured_information(ROBOT, frf, DELAY_S, model_error=2.0)
    weights = np.broadcast_to([[1, 0.5], [0.5, 1]], frf.response.shape[1:])
    assumed, known = candidate_information(ROBOT, CONFIGURATIONS, frf.frequency_hz, 1e-3, DELAY_S, 2.0, weights=weights)
    assert names == known
    np.testing.assert_allclose(matrices, assumed, rtol=1e-3)


def test_few_degrees_of_freedom_are_corrected_and_too_few_refused(frf):
    whole, _ = measured_information(ROBOT, frf, DELAY_S)
    few, _ = measured_information(ROBOT, replace(frf, total_degrees_of_freedom=8.0), DELAY_S)
    np.testing.assert_allclose(few, 0.75 * whole, rtol=1e-5)
    with pytest.raises(DataError, match="more than 2 degrees of freedom") as caught:
        measured_information(ROBOT, replace(frf, total_degrees_of_freedom=2.0), DELAY_S)
    assert "realizations" in caught.value.remedy


def test_elements_without_weight_take_their_errors_with_them(frf):
    """As in a fit that drops what is below 10 dB, though its errors are correlated with others'."""
    loud = np.array(frf.element_scale)
    loud[:, 0, 1] = 1e14
    one = replace(frf, element_scale=loud).select([1])
    covariance, problem = fit_covariance(one, ElasticOptions(weights=Weights("optimal_full"), prior_decades=1e6), 8)
    assert not problem.weight[:, :, 0, 1].any()
    matrices, _ = measured_information(ROBOT, one, DELAY_S, weights=(problem.weight > 0).astype(float))
    assert_same(np.linalg.inv(covariance), matrices[0])


def test_weights_scale_the_information(frf):
    halved = measured_information(ROBOT, frf, DELAY_S, weights=np.full(frf.response.shape, 0.5))[0]
    np.testing.assert_allclose(halved, 0.5 * measured_information(ROBOT, frf, DELAY_S)[0], rtol=1e-6)
    weights = np.random.default_rng(3).uniform(0.1, 1, frf.response.shape)
    plain = replace(frf, input_factor=np.eye(2) + 0 * frf.input_factor, total_covariance=np.eye(2) + 0 * frf.covariance)
    plain = replace(plain, element_scale=np.ones(frf.element_scale.shape))
    less = replace(plain, element_scale=1 / weights.mean(axis=1))
    even = np.broadcast_to(weights.mean(axis=1)[:, None], weights.shape)
    expected = measured_information(ROBOT, less, DELAY_S)[0]
    np.testing.assert_allclose(measured_information(ROBOT, plain, DELAY_S, weights=even)[0], expected, rtol=1e-6)


def test_fixed_parameters_and_nuisances_are_chosen_by_name(frf):
    full, names = measured_information(ROBOT, frf, DELAY_S, nuisance=())
    some, left = measured_information(
        ROBOT, frf, DELAY_S, kinds=("stiffness",), nuisance=("damping",), fixed=("forearm.stiffness", "gear_1.damping")
    )
    assert left == ("gear_1.stiffness", "gear_2.stiffness", "bearing_1.stiffness")
    wanted = [names.index(name) for name in left]
    other = [index for index, name in enumerate(names) if name.endswith("damping") and name != "gear_1.damping"]
    mixed = full[:, wanted][:, :, other]
    expected = full[:, wanted][:, :, wanted] - mixed @ np.linalg.solve(
        full[:, other][:, :, other], mixed.swapaxes(1, 2)
    )
    np.testing.assert_allclose(some, expected, rtol=1e-6)


def test_known_friction_costs_nothing_and_unknown_friction_some(frf):
    generator = np.random.default_rng(2)
    shape = (3, 1, *frf.response.shape[1:])
    pushed = generator.normal(size=shape) * frf.response[:, None]
    plain, _ = measured_information(ROBOT, frf, DELAY_S)

    def lost(deviation):
        changed = replace(
            frf, sensitivity=pushed, coefficient_names=("f",), coefficient_relative_std=np.array([deviation])
        )
        return np.linalg.slogdet(plain)[1] - np.linalg.slogdet(measured_information(ROBOT, changed, DELAY_S)[0])[1]

    np.testing.assert_allclose(lost(1e-12), 0, atol=1e-5)
    assert (lost(1e-4) > lost(1e-7)).all()
    np.testing.assert_allclose(lost(np.inf), lost(1e3), rtol=1e-5)


def test_what_cannot_be_designed_for_is_refused(frf):
    with pytest.raises(SettingsError, match="cannot be designed for cubic"):
        measured_information(ROBOT, frf, DELAY_S, kinds=("stiffness", "cubic"))
    with pytest.raises(SettingsError, match="S021"):
        measured_information(ROBOT, frf, DELAY_S, kinds=("stiffness",), nuisance=("stiffness",))
    with pytest.raises(SettingsError, match="S022 `fixed` names elbow, which"):
        measured_information(ROBOT, frf, DELAY_S, fixed=("elbow",))
    with pytest.raises(DataError, match="the robot's motors"):
        measured_information(ROBOT, replace(frf, input_channels=frf.input_channels[::-1]), DELAY_S)
    with pytest.raises(ValueError, match="weights"):
        measured_information(ROBOT, frf, DELAY_S, weights=np.ones((3, 25, 2, 1)))
