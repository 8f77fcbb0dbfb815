"""Information by measured covariance against the fit's own sandwich and against assumed noise."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot
from robid.design.candidates import candidate_information
from robid.design.measured import fitted_information, measured_information
from robid.errors import DataError, SettingsError
from robid.fit.elastic import set_up
from robid.fit.options import ElasticOptions, Weights
from robid.fit.uncertainty import sandwich

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
    return replace(
        robot, springs=tuple(replace(each, stiffness_nm_rad=each.stiffness_nm_rad / factor) for each in robot.springs)
    )


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
    found, _ = fitted_information(ROBOT, one, DELAY_S, problem.weight)
    inverse = np.linalg.inv(found.bread[0])
    assert_same(covariance, inverse @ found.meat[0] @ inverse)


def test_no_weights_of_a_fit_beat_the_optimal_ones(frf):
    weights = np.random.default_rng(1).uniform(0.1, 2, frf.response.shape)
    optimal, _ = measured_information(ROBOT, frf, DELAY_S, corrected=False)
    fitted, _ = fitted_information(ROBOT, frf, DELAY_S, weights)
    own = fitted.bread @ np.linalg.solve(fitted.meat, fitted.bread)
    for best, less in zip(optimal, own, strict=True):
        scale = np.sqrt(np.diag(best))
        assert np.linalg.eigvalsh((best - less) / (scale[:, None] * scale)).min() > -1e-9


def test_independent_relative_errors_are_the_assumed_noise(frf):
    matrices, names = measured_information(ROBOT, frf, DELAY_S, model_error=2.0)
    assumed, known = candidate_information(ROBOT, CONFIGURATIONS, frf.frequency_hz, 1e-3, DELAY_S, 2.0)
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
    with pytest.raises(SettingsError, match="both wanted and a nuisance"):
        measured_information(ROBOT, frf, DELAY_S, kinds=("stiffness",), nuisance=("stiffness",))
    with pytest.raises(SettingsError, match="`fixed` names elbow, which"):
        measured_information(ROBOT, frf, DELAY_S, fixed=("elbow",))
    with pytest.raises(DataError, match="the robot's motors"):
        measured_information(ROBOT, replace(frf, input_names=("elbow", "shoulder")), DELAY_S)
    with pytest.raises(ValueError, match="weights"):
        measured_information(ROBOT, frf, DELAY_S, weights=np.ones((3, 25, 2, 1)))
