"""Bodies that are real: kept where the estimate allows, nearest to it where not; cvxpy solves the same another way."""

import numpy as np
import pytest

from robid.models.rigid.fit.consistency import make_consistent, parameter_scale, pseudo_inertia

BODIES = np.arange(20).reshape(2, 10)
MOTOR, FRICTION = 20, 21


def _moments(points, masses):
    """Moments of point masses (n, 3), about the origin."""
    second = np.einsum("n,ni,nj->ij", masses, points, points)
    inertia = np.trace(second) * np.eye(3) - second
    first = masses @ points
    return np.r_[inertia[0], inertia[1, 1:], inertia[2, 2], first, masses.sum()]


def _standard(seed):
    generator = np.random.default_rng(seed)
    bodies = [_moments(generator.uniform(-0.3, 0.3, (6, 3)) + 0.1, generator.uniform(0.2, 1, 6)) for _ in range(2)]
    return np.concatenate([*bodies, [0.05, 0.4]])


NOMINAL = _standard(0)


def _combination(seed=5, n_base=9):
    return np.random.default_rng(seed).standard_normal((n_base, 22)) / parameter_scale(NOMINAL, BODIES)


def _least_eigenvalue(standard):
    return min(np.linalg.eigvalsh(pseudo_inertia(standard[body]))[0] for body in BODIES)


def test_pseudo_inertia_is_the_second_moment_of_the_mass():
    points, masses = np.random.default_rng(1).standard_normal((5, 3)), np.arange(1.0, 6.0)
    longer = np.hstack([points, np.ones((5, 1))])
    np.testing.assert_allclose(pseudo_inertia(_moments(points, masses)), longer.T @ (masses[:, None] * longer))


def test_a_real_robot_keeps_its_estimate_and_gets_the_nearest_bodies():
    combination = _combination()
    truth = NOMINAL + 0.1 * (_standard(3) - NOMINAL)
    base = combination @ truth
    found = make_consistent(base, 1e-4 * np.eye(9), combination, NOMINAL, BODIES, (MOTOR, FRICTION))
    assert found.status == "estimated"
    np.testing.assert_allclose(found.base, base, rtol=1e-6)
    assert np.abs(found.moved).max() < 1e-3
    assert _least_eigenvalue(found.standard) > 0
    # Nothing binds here, so the nearest bodies follow from the estimate alone.
    np.testing.assert_allclose(found.standard, NOMINAL + found.gain @ (base - combination @ NOMINAL), atol=1e-6)
    scale = parameter_scale(NOMINAL, BODIES)
    distance = np.linalg.norm((found.standard - NOMINAL) / scale)
    assert distance <= np.linalg.norm((truth - NOMINAL) / scale)


def _impossible():
    """Base parameters: a mass too small for its first moment and inertia, a negative mass and motor inertia."""
    combination = np.zeros((7, 22))
    combination[range(7), [9, 19, MOTOR, 0, 5, 6, 1]] = 1.0
    base = combination @ NOMINAL
    base[[0, 1, 2, 5, 6]] = [0.5, -0.2, -0.01, 0.8, 0.3]
    covariance = np.diag([0.1, 0.1, 0.01, 0.02, 0.02, 0.1, 0.05]) ** 2
    covariance[0, 1] = covariance[1, 0] = 0.005
    return base, covariance, combination


def test_an_impossible_estimate_is_moved_as_little_as_its_covariance_allows():
    cvxpy = pytest.importorskip("cvxpy")
    base, covariance, combination = _impossible()
    found = make_consistent(base, covariance, combination, NOMINAL, BODIES, (MOTOR,))
    assert found.status == "moved"
    assert _least_eigenvalue(found.standard) > 0
    assert found.standard[MOTOR] > -1e-9
    assert np.abs(found.moved).max() > 1

    unknown = cvxpy.Variable(22)
    bodies = []
    for body in BODIES:
        moments = [unknown[int(index)] for index in body]
        inertia = cvxpy.bmat([moments[:3], [moments[1], *moments[3:5]], [moments[2], moments[4], moments[5]]])
        second = 0.5 * cvxpy.trace(inertia) * np.eye(3) - inertia
        first = cvxpy.reshape(cvxpy.hstack(moments[6:9]), (3, 1), order="C")
        bodies.append(cvxpy.bmat([[second, first], [first.T, cvxpy.reshape(moments[9], (1, 1), order="C")]]))
    miss = np.linalg.inv(np.linalg.cholesky(covariance)) @ (combination @ unknown - base)
    pull = 1e-3 * cvxpy.multiply(1 / parameter_scale(NOMINAL, BODIES), unknown - NOMINAL)
    constraints = [*((one + one.T) / 2 >> 0 for one in bodies), unknown[MOTOR] >= 0]
    problem = cvxpy.Problem(cvxpy.Minimize(cvxpy.sum_squares(miss) + cvxpy.sum_squares(pull)), constraints)
    problem.solve(solver=cvxpy.CLARABEL)
    np.testing.assert_allclose(found.base, combination @ unknown.value, atol=2e-3)


def test_shapes_are_checked():
    base, covariance, combination = _impossible()
    with pytest.raises(ValueError, match="combination"):
        make_consistent(base[:3], covariance, combination, NOMINAL, BODIES)
    with pytest.raises(ValueError, match="bodies"):
        make_consistent(base, covariance, combination, NOMINAL, BODIES[:, :9])


def test_what_nothing_shows_stays_as_it_was_beside_friction_of_any_size():
    """Friction that the robot file does not state is many times its scale away; bodies do not feel that."""
    nominal = NOMINAL.copy()
    nominal[FRICTION] = 0.0
    combination = np.zeros((3, 22))
    combination[range(3), [9, FRICTION, 5]] = 1.0
    base, covariance = combination @ nominal * [1.1, 0.0, 1.1] + [0.0, 204.0, 0.0], np.diag([1e-3, 0.4, 1e-4]) ** 2
    found = make_consistent(base, covariance, combination, nominal, BODIES, (MOTOR, FRICTION))
    assert found.status == "estimated"
    np.testing.assert_allclose(found.base, base, rtol=1e-9)
    silent = np.setdiff1d(np.arange(22), [9, FRICTION, 5])
    np.testing.assert_allclose(found.standard[silent], nominal[silent], rtol=0, atol=1e-6)


def test_a_body_that_nothing_shows_stays_where_another_one_has_to_move():
    base, covariance, combination = _impossible()
    rows = [0, 3, 4, 5, 6]
    # The second body is left out; the first one's mass is too small for its first moment and inertia.
    moved = [row for row in rows if not combination[row, 10:20].any()]
    found = make_consistent(
        base[moved], covariance[np.ix_(moved, moved)], combination[moved], NOMINAL, BODIES, (MOTOR,)
    )
    assert found.status == "moved"
    # The solver stops at 1e-8 of squares.
    np.testing.assert_allclose(found.standard[10:20], NOMINAL[10:20], rtol=0, atol=2e-3)
    assert found.standard[MOTOR] == pytest.approx(NOMINAL[MOTOR], rel=1e-3)
