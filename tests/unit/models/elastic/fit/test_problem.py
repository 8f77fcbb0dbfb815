"""The least-squares problem: derivatives against finite differences, weights written out."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot, two_mass_robot
from robid.errors import DataError
from robid.frf.friction import friction_move
from robid.frf.residual import RESIDUALS
from robid.models.elastic.fit.options import ElasticOptions, Weights
from robid.models.elastic.fit.parameters import map_parameters
from robid.models.elastic.fit.problem import make_problem
from robid.models.elastic.fit.weights import make_weights, make_whitening
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters
from tolerances import FINITE_DIFFERENCE, IDENTITY

FREQUENCY_HZ = np.array([2.0, 5.0, 9.0, 14.0, 27.0, 45.0])
CONFIGURATIONS = np.array([[-0.3, 0.5], [0.9, 1.2]])
EVERYTHING = ("stiffness", "damping", "viscous", "motor_inertia", "link_inertia", "delay")


def noisy_frf(seed=1, relative_noise=0.02):
    frf = exact_frf(
        two_joint_robot(), CONFIGURATIONS, FREQUENCY_HZ, delay_s=1e-3, relative_noise=relative_noise, seed=seed
    )
    generator = np.random.default_rng(seed)
    shape = (2, 2, *frf.response.shape[1:])
    random = generator.standard_normal(shape) + 1j * generator.standard_normal(shape)
    return replace(
        frf,
        sensitivity=random * frf.response[:, None],
        coefficient_names=("shoulder.level", "elbow.level"),
        coefficient_relative_std=np.array([0.1, 0.2]),
    )


def problem_of(options):
    robot, frf = two_joint_robot(), noisy_frf()
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, CONFIGURATIONS))
    nominal = nominal_parameters(robot, linear, 1e-3)
    parameters = map_parameters(robot, nominal, options, frf.coefficient_names, frf.coefficient_relative_std)
    return make_problem(frf, linear, parameters, options)[0]


@pytest.fixture(params=["lls", "nls", "llsm"])
def problem(request):
    fixed = ("gear_2.damping", "shoulder.motor_inertia")
    return problem_of(ElasticOptions(estimator=request.param, free=EVERYTHING, fixed=fixed))


@pytest.fixture
def point(problem):
    return np.random.default_rng(3).uniform(-0.05, 0.05, len(problem.parameters.names))


def test_fixed_parameters_are_left_out(problem):
    names = problem.parameters.names
    assert "gear_2.damping" not in names
    assert "shoulder.motor_inertia" not in names
    assert names[-2:] == ("shoulder.level", "elbow.level")
    assert len(names) == 4 + 3 + 2 + 1 + 2 + 1 + 2


def test_derivative_of_the_residual(problem, point):
    derivative = problem.linear(point)[1]
    for index in range(point.size):
        step = np.zeros(point.size)
        step[index] = 1e-5
        ahead, behind = (problem.residual(point + move, problem.model_response(point + move)) for move in (step, -step))
        difference = (ahead - behind) / 2e-5
        size = np.abs(difference).max()
        np.testing.assert_allclose(-derivative[..., index], difference, atol=FINITE_DIFFERENCE * size)


def test_gradient_is_half_that_of_the_cost(problem, point):
    normal = problem.normal(point)
    assert normal.cost == pytest.approx(problem.cost(point), rel=1e-12)
    for index in range(point.size):
        step = np.zeros(point.size)
        step[index] = 1e-5
        slope = (problem.cost(point + step) - problem.cost(point - step)) / 2e-5
        assert 2 * normal.gradient[index] == pytest.approx(slope, rel=1e-5, abs=1e-6 * np.abs(normal.gradient).max())


def test_prior_counts_as_half_its_square_in_deviations(problem):
    zero = np.zeros(len(problem.parameters.names))
    moved = zero.copy()
    moved[-1] = 0.2
    without = replace(problem, parameters=replace(problem.parameters, prior_std=np.full(zero.size, np.inf)))
    assert problem.cost(moved) - without.cost(moved) == pytest.approx(0.5, rel=1e-9)
    extra = np.diag(problem.normal(zero).hessian - without.normal(zero).hessian)
    np.testing.assert_allclose(extra[-2:], [0.5 / 0.1**2, 0.5 / 0.2**2], rtol=1e-6)


def test_values_and_slopes_of_the_map(problem, point):
    parameters = problem.parameters
    for index in range(point.size):
        step = np.zeros(point.size)
        step[index] = 1e-6
        difference = (parameters.values(point + step) - parameters.values(point - step))[index] / 2e-6
        assert parameters.slopes(point)[index] == pytest.approx(difference, rel=1e-6)
    np.testing.assert_array_equal(parameters.values(np.zeros(point.size)), parameters.nominal_values())
    fitted = parameters.parameters(point)
    assert fitted.damping[1] == parameters.nominal.damping[1]
    assert fitted.stiffness[1] == parameters.values(point)[1]


def test_optimal_weights_are_the_inverse_variance():
    frf = noisy_frf()
    power = np.abs(frf.response) ** 2
    relative = frf.element_variance() / power
    bias = 1 - 1e-6
    weight, dropped = make_weights(frf, Weights("optimal"), RESIDUALS["lls"])
    kept = relative <= 0.1
    assert dropped == (~kept).sum() > 0
    assert (weight[~kept] == 0).all()
    np.testing.assert_allclose(weight[kept], bias / relative[kept], rtol=1e-9)
    plain, dropped = make_weights(frf, Weights("optimal"), RESIDUALS["nls"])
    assert dropped == 0
    np.testing.assert_allclose(plain, bias / frf.element_variance(), rtol=1e-9)


def test_model_error_inflates_the_variance():
    frf = noisy_frf()
    relative = frf.element_variance() / np.abs(frf.response) ** 2
    weight = make_weights(frf, Weights("inflated", model_error=0.05), RESIDUALS["lls"])[0]
    kept = weight > 0
    np.testing.assert_allclose(weight[kept], (1 - 1e-6) / (relative[kept] + 0.05**2), rtol=1e-9)


def test_few_degrees_of_freedom_lower_the_weights():
    frf = replace(noisy_frf(), total_degrees_of_freedom=3.0)
    ratio = (
        make_weights(frf, Weights("optimal"), RESIDUALS["nls"])[0]
        / make_weights(noisy_frf(), Weights("optimal"), RESIDUALS["nls"])[0]
    )
    # The mean of the inverse of a complex sample variance is n/(n - 1) of the inverse.
    np.testing.assert_allclose(ratio, 2 / 3, rtol=1e-5)


def test_user_weights_are_constant_per_element_above_the_cut():
    frf = noisy_frf(relative_noise=1e-5)
    weight = make_weights(frf, Weights("user", off_diagonal=0.25, low_cut_hz=6.0), RESIDUALS["lls"])[0]
    assert (weight[:, FREQUENCY_HZ < 6.0] == 0).all()
    above = weight[:, FREQUENCY_HZ >= 6.0]
    np.testing.assert_allclose(above[..., 0, 1] / above[..., 0, 0], 0.25)
    np.testing.assert_allclose(above[..., 0, 0], above[0, 0, 1, 1])


def test_without_a_covariance_the_model_error_stands_for_the_noise():
    frf = exact_frf(two_joint_robot(), CONFIGURATIONS, FREQUENCY_HZ)
    weight, dropped = make_weights(frf, Weights(model_error=0.05), RESIDUALS["lls"])
    assert dropped == 0
    np.testing.assert_allclose(weight, 400.0)


def test_units_of_torque_nonlinearities_are_their_own():
    robot = two_mass_robot()
    linear = linearize(build_model(robot), solve_statics(build_model(robot), np.zeros((1, 1))))
    names = ("drive.level", "drive.lag", "drive.torque_scale")
    nominal = nominal_parameters(robot, linear, 0.0)
    mapped = map_parameters(robot, nominal, ElasticOptions(free=("stiffness",)), names, np.ones(3))
    assert mapped.units == ("N m/rad", "1", "samples", "1")


@pytest.mark.parametrize("estimator", ["lls", "llsm", "nls"])
@pytest.mark.parametrize(
    "kinds", [EVERYTHING, ("damping", "delay", "stiffness"), ("viscous",), ("stiffness", "link_inertia")]
)
@pytest.mark.parametrize("kind", ["user", "inflated"])
def test_symmetric_sums_are_those_of_all_residuals(estimator, kinds, kind):
    fixed = tuple(name for name in ("gear_2.damping", "forearm.stiffness") if name.rpartition(".")[2] in kinds)
    weights = Weights(kind, low_cut_hz=4.0)
    problem = problem_of(ElasticOptions(estimator=estimator, free=kinds, fixed=fixed, weights=weights))
    assert not np.allclose(problem.frf.response, np.swapaxes(problem.frf.response, -1, -2), rtol=1e-3)
    for seed in range(3):
        point = np.random.default_rng(seed).uniform(-0.5, 0.5, len(problem.parameters.names))
        ours, whole = problem.normal(point), problem.stacked_normal(point)
        assert problem.cost(point) == pytest.approx(ours.cost, rel=1e-14)
        assert ours.cost == pytest.approx(whole.cost, rel=IDENTITY)
        root = np.sqrt(np.diag(whole.hessian))
        np.testing.assert_allclose((ours.hessian - whole.hessian) / np.outer(root, root), 0, atol=IDENTITY)
        np.testing.assert_allclose((ours.gradient - whole.gradient) / root, 0, atol=IDENTITY * np.sqrt(whole.cost))


def test_point_is_not_mistaken_for_another(problem, point):
    there = problem.normal(point).gradient
    problem.cost(point + 0.1)
    np.testing.assert_array_equal(problem.normal(point).gradient, there)


def test_other_outputs_take_the_general_way():
    robot = two_joint_robot()
    names = ("shoulder.arm", "elbow")
    frf = exact_frf(robot, CONFIGURATIONS, FREQUENCY_HZ, delay_s=1e-3, output_names=names, relative_noise=0.01)
    linear = linearize(build_model(robot), solve_statics(build_model(robot), CONFIGURATIONS), names)
    options = ElasticOptions(free=EVERYTHING)
    parameters = map_parameters(robot, nominal_parameters(robot, linear, 1e-3), options, (), np.zeros(0))
    problem = make_problem(frf, linear, parameters, options)[0]
    assert problem.normal(np.zeros(13 + 2)).cost == pytest.approx(problem.stacked_normal(np.zeros(15)).cost)


def test_correlated_weights_are_the_inverse_covariance():
    frf = correlated_frf()
    relative = frf.response[1, 2].T.ravel()
    covariance = frf.full_covariance(1)[2] / np.outer(relative, relative.conj())
    kept = np.ones(frf.response.shape, bool)
    whitening = make_whitening(frf, kept, RESIDUALS["lls"])[1, 2]
    by_column = [0, 2, 1, 3]
    found = (whitening.conj().T @ whitening)[np.ix_(by_column, by_column)]
    np.testing.assert_allclose(found, np.linalg.inv(covariance) * (7 - 2) / 7, rtol=1e-9)


def test_correlated_weights_without_correlation_are_the_optimal_ones():
    frf = noisy_frf()
    weight, _ = make_weights(frf, Weights("optimal"), RESIDUALS["lls"])
    whitening = make_whitening(frf, weight > 0, RESIDUALS["lls"])
    np.testing.assert_allclose(
        np.abs(np.diagonal(whitening, axis1=-2, axis2=-1)) ** 2, weight.reshape(2, 6, 4), rtol=1e-5
    )


def correlated_frf():
    generator = np.random.default_rng(5)
    frf = noisy_frf(relative_noise=1e-3)

    def positive(size):
        root = generator.standard_normal((2, 6, size, size)) + 1j * generator.standard_normal((2, 6, size, size))
        return root @ np.swapaxes(root.conj(), -1, -2)

    scale = generator.uniform(0.5, 2, (2, 2, 2))
    return replace(
        frf,
        input_factor=positive(2),
        total_covariance=1e-6 * positive(2),
        element_scale=scale,
        total_degrees_of_freedom=7.0,
    )


@pytest.mark.parametrize("estimator", ["lls", "llsm", "nls"])
def test_gradient_with_correlated_weights(estimator):
    frf, robot = correlated_frf(), two_joint_robot()
    linear = linearize(build_model(robot), solve_statics(build_model(robot), CONFIGURATIONS))
    options = ElasticOptions(estimator=estimator, weights=Weights("optimal_full"))
    parameters = map_parameters(robot, nominal_parameters(robot, linear, 1e-3), options, (), np.zeros(0))
    problem = make_problem(replace(frf, sensitivity=frf.sensitivity[:, :0]), linear, parameters, options)[0]
    point = np.full(len(parameters.names), 0.02)
    gradient = problem.normal(point).gradient
    for index in range(point.size):
        step = np.zeros(point.size)
        step[index] = 1e-5
        slope = (problem.cost(point + step) - problem.cost(point - step)) / 2e-5
        assert 2 * gradient[index] == pytest.approx(slope, rel=1e-5, abs=1e-6 * np.abs(gradient).max())


def test_correlated_weights_need_enough_realizations():
    frf = replace(correlated_frf(), total_degrees_of_freedom=2.0)
    with pytest.raises(DataError, match="more than 2 degrees of freedom of the covariance, not 2"):
        make_whitening(frf, np.ones(frf.response.shape, bool), RESIDUALS["lls"])


def test_compensated_friction_moves_the_response_as_the_torque_does():
    # One block of two experiments: Y of the recorded torque less what friction took, at scales far from zero.
    generator = np.random.default_rng(5)
    torque, lost, other, motion = generator.standard_normal((4, 2, 2)) + 1j * generator.standard_normal((4, 2, 2))
    frictions, scales = 0.1 * np.stack([lost, other]), np.array([0.7, -1.0])

    def response(at):
        return motion @ np.linalg.inv(torque - np.einsum("k,kij->ij", at, frictions))

    here = response(np.zeros(2))
    sensitivity = here @ frictions @ np.linalg.inv(torque)
    frf = replace(noisy_frf(), response=here[None, None], sensitivity=sensitivity[None, :, None])
    move = friction_move(frf)
    np.testing.assert_allclose(move.moved(scales)[0, 0], response(scales), rtol=1e-10)
    slopes = move.slopes(scales)[0, 0]
    for index in range(2):
        step = 1e-6 * np.eye(2)[index]
        difference = (response(scales + step) - response(scales - step)) / 2e-6
        np.testing.assert_allclose(slopes[..., index], difference, rtol=FINITE_DIFFERENCE)
