"""State-space models against closed forms, and what a change of basis leaves alone."""

import control
import numpy as np
import pytest

from lpv_systems import POSITIONS, SIZES, true_systems
from robid.errors import DataError
from robid.models.lpv.fit.state_space import (
    StateSpace,
    balance,
    pack,
    remap,
    response,
    similarity_tangent,
    transform,
    unpack,
)
from tolerances import FINITE_DIFFERENCE, IDENTITY

Z = np.exp(1j * np.linspace(0.05, 3.0, 30))


def _random(generator, n_state=4, n_in=2, n_out=3):
    A = generator.standard_normal((n_state, n_state))
    A *= 0.9 / np.abs(np.linalg.eigvals(A)).max()
    shapes = ((n_state, n_in), (n_out, n_state), (n_out, n_in))
    return StateSpace(A, *(generator.standard_normal(shape) for shape in shapes))


def test_response_of_one_state_in_closed_form():
    system = StateSpace(np.array([[0.8]]), np.array([[2.0]]), np.array([[3.0]]), np.array([[0.5]]))
    np.testing.assert_allclose(response(system, Z)[:, 0, 0], 6 / (Z - 0.8) + 0.5, rtol=IDENTITY)


def test_response_is_that_of_another_library():
    system = _random(np.random.default_rng(1))
    other = control.ss(*system.matrices, 1.0)
    expected = np.moveaxis(control.frequency_response(other, np.angle(Z)).complex, -1, 0)
    np.testing.assert_allclose(response(system, Z), expected, rtol=1e-8)


def test_packing_is_undone():
    systems = true_systems(POSITIONS)
    packed = pack(systems)
    assert packed.shape == (5, SIZES.n_local)
    for one, other in zip(unpack(packed, SIZES).matrices, systems.matrices, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_balanced_basis_has_one_diagonal_gramian_and_the_same_response():
    system = _random(np.random.default_rng(2))
    balanced, T = balance(system)
    reached, seen = np.zeros((4, 4)), np.zeros((4, 4))
    power = np.eye(4)
    for _ in range(1000):
        reached += power @ balanced.B @ balanced.B.T @ power.T
        seen += power.T @ balanced.C.T @ balanced.C @ power
        power = power @ balanced.A
    np.testing.assert_allclose(reached, seen, atol=1e-9)
    np.testing.assert_allclose(reached, np.diag(np.diag(reached)), atol=1e-9)
    np.testing.assert_allclose(response(balanced, Z), response(system, Z), rtol=1e-8)
    np.testing.assert_allclose(balanced.A, T @ system.A @ np.linalg.inv(T), atol=IDENTITY)


def test_a_state_that_nothing_moves_is_refused():
    system = _random(np.random.default_rng(3))
    idle = StateSpace(np.diag([0.5, 0.6, 0.7, 0.8]), np.eye(4)[:, :1] @ np.ones((1, 2)), system.C, system.D)
    with pytest.raises(DataError, match="D174"):
        balance(idle)


def test_remapping_evaluates_the_model_at_the_mapped_point():
    system = _random(np.random.default_rng(4))
    a, b, c, d = 1.3, -0.7, -0.7, 1.3
    mapped = remap(system, a, b, c, d)
    np.testing.assert_allclose(response(mapped, Z), response(system, (a * Z + b) / (c * Z + d)), rtol=1e-9)


def test_the_tangent_of_a_change_of_basis_by_finite_differences():
    systems = true_systems(POSITIONS)
    tangent = similarity_tangent(systems)
    step = 1e-6
    for index in range(9):
        change = np.zeros(9)
        change[index] = step
        ends = [pack(transform(systems, np.eye(3) + sign * change.reshape(3, 3))) for sign in (1, -1)]
        slope = (ends[0] - ends[1]) / (2 * step)
        np.testing.assert_allclose(tangent[..., index], slope, atol=FINITE_DIFFERENCE)
