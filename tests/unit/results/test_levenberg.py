"""Levenberg-Marquardt on problems with known minima, and how it ends."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from robid.results.levenberg import Normal, minimise


def least_squares(residual, jacobian):
    def cost(point):
        return float(np.sum(residual(point) ** 2))

    def normal(point):
        r, J = residual(point), jacobian(point)
        return Normal(float(r @ r), J.T @ r, J.T @ J)

    return cost, normal


def rosenbrock():
    return least_squares(
        lambda x: np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]]),
        lambda x: np.array([[-20 * x[0], 10.0], [-1.0, 0.0]]),
    )


@pytest.mark.parametrize("start", [(-1.2, 1.0), (3.0, -3.0), (0.0, 0.0), (-20.0, 5.0)])
def test_rosenbrock(start):
    found = minimise(*rosenbrock(), np.array(start))
    assert found.status == "converged"
    np.testing.assert_allclose(found.parameters, 1.0, rtol=1e-7)
    assert found.cost < 1e-15


def test_linear_least_squares_in_few_steps():
    generator = np.random.default_rng(1)
    A, b = generator.standard_normal((30, 4)), generator.standard_normal(30)
    found = minimise(*least_squares(lambda x: A @ x - b, lambda _: A), np.zeros(4))
    np.testing.assert_allclose(found.parameters, np.linalg.lstsq(A, b, rcond=None)[0], rtol=1e-6)
    assert found.iterations < 10


def test_parameter_without_influence_does_not_hold_the_others_back():
    A = np.diag([1.0, 1e-7])
    target = np.array([5.0, 1e-3])
    found = minimise(*least_squares(lambda x: A @ x - target, lambda _: A), np.zeros(2), max_iterations=30)
    np.testing.assert_allclose(found.parameters[0], 5.0, rtol=1e-6)


def test_step_is_bounded():
    visited = []

    def residual(x):
        visited.append(x.copy())
        return x - 100.0

    minimise(*least_squares(residual, lambda _: np.eye(1)), np.zeros(1), max_iterations=5, max_step=0.5)
    assert np.abs(np.diff(np.unique(np.array(visited)[:, 0]))).max() <= 0.5 + 1e-12


def test_iteration_limit_is_a_status():
    found = minimise(*rosenbrock(), np.array([-1.2, 1.0]), max_iterations=3)
    assert (found.status, found.iterations) == ("iteration_limit", 3)


def test_points_without_a_cost_are_stepped_around():
    cost, normal = least_squares(lambda x: np.log(x), lambda x: np.diag(1 / x))

    def guarded(point):
        return cost(point) if (point > 0).all() else np.inf

    found = minimise(guarded, normal, np.array([5.0]), max_step=10.0)
    np.testing.assert_allclose(found.parameters, 1.0, rtol=1e-6)


def test_what_follows_a_refused_step_is_a_quarter_as_long_at_most():
    wall, tried = 50.3, []
    cost, normal = least_squares(lambda x: x - 100.0, lambda _: np.eye(1))

    def walled(point):
        tried.append(float(point[0]))
        return cost(point) if point[0] < wall else np.inf

    # Forty-nine steps that were accepted leave next to no damping when the wall comes.
    minimise(walled, normal, np.array([0.9]), max_iterations=60)
    refused = next(index for index, point in enumerate(tried) if point >= wall)
    place, step, following = (
        tried[refused - 1],
        *(tried[index] - tried[refused - 1] for index in (refused, refused + 1)),
    )
    assert (place, step) == (pytest.approx(49.9), pytest.approx(1.0))
    assert 0 < following <= 0.25


def test_cost_never_rises():
    accepted = []
    cost, normal = rosenbrock()

    def watched(point):
        here = normal(point)
        accepted.append(here.cost)
        return here

    minimise(cost, watched, np.array([-1.2, 1.0]))
    assert (np.diff(accepted) <= 0).all()


def test_a_bound_holds_and_the_others_reach_their_own_minimum():
    A = np.array([[2.0, 1.0, 0.3], [0.0, 1.0, -0.5], [1.0, 0.0, 1.0], [0.2, 0.7, 0.0]])
    b = np.array([3.0, -1.0, 2.0, 0.5])
    lower, upper = np.array([-1.0, -0.4, -9.0]), np.array([0.8, 1.0, 9.0])
    problem = least_squares(lambda x: A @ x - b, lambda _: A)
    found = minimise(*problem, np.zeros(3), lower=lower, upper=upper)
    wanted = lsq_linear(A, b, (lower, upper), tol=1e-14).x
    assert found.status == "converged"
    np.testing.assert_allclose(found.parameters, wanted, rtol=1e-7)
    assert (np.isclose(wanted, lower) | np.isclose(wanted, upper)).any()
    assert found.iterations < 30


def test_a_parameter_leaves_a_bound_that_it_does_not_need():
    found = minimise(*rosenbrock(), np.array([-1.0, 1.0]), lower=np.array([-1.0, -9.0]), upper=np.array([9.0, 1.0]))
    assert found.status == "converged"
    np.testing.assert_allclose(found.parameters, 1.0, rtol=1e-6)


def test_a_clipped_step_that_goes_down_is_taken_though_the_model_promises_nothing():
    hessian = np.array([[100.0, 9.9], [9.9, 1.0]])
    gradient = -hessian @ [-0.5, 9.0]
    clipped = np.array([-0.5, 1.0])
    assert clipped @ (2 * gradient + hessian @ clipped) > 0

    def cost(point):
        return 100.0 - point[1]

    end = minimise(cost, lambda point: Normal(cost(point), gradient, hessian), np.zeros(2), max_iterations=1)
    assert end.cost == 99.0
    up = minimise(
        lambda p: 100.0 + p[1], lambda p: Normal(100.0 + p[1], gradient, hessian), np.zeros(2), max_iterations=1
    )
    assert up.cost == 100.0


@pytest.mark.parametrize("size", [1.0, 1e6])
def test_a_step_that_damping_made_small_is_not_convergence(size):
    # The cost rises in every direction, whatever its derivatives say: all steps are refused.
    found = minimise(
        lambda point: size + float(np.abs(point).sum()),
        lambda _: Normal(size, np.array([-0.5, 0.2]), np.diag([1.0, 2.0])),
        np.zeros(2),
        max_iterations=1000,
    )
    assert found.status == "stalled"
    np.testing.assert_array_equal(found.parameters, 0.0)


def test_a_small_step_without_damping_is_convergence():
    found = minimise(lambda _: 1.0, lambda _: Normal(1.0, np.array([1e-2]), np.array([[1e8]])), np.zeros(1))
    assert found.status == "converged"


def test_a_step_that_gains_more_than_any_quadratic_model_foresaw_is_taken():
    """Where a bound cuts a step short, what is foreseen of the rest may be next to nothing."""
    foreseen, curvature = 1e-130, 1e-250

    def cost(point):
        return float((1 - 0.5 * point[0]) ** 2)

    def normal(point):
        return Normal(cost(point), np.array([-foreseen]), np.array([[curvature]]))

    found = minimise(cost, normal, np.zeros(1), lower=np.zeros(1), upper=np.ones(1))
    assert found.parameters[0] == 1.0
    assert found.cost == 0.25
