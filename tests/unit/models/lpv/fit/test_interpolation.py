"""One basis for local models, and their interpolation."""

import numpy as np
import pytest

from lpv_systems import POSITIONS, SIZES, basis, local_responses, problem, true_parameters, true_systems
from robid.errors import DataError
from robid.models.lpv.fit.local import align_neighbours, check_positions, fit_local_models, interpolate, middle_position
from robid.models.lpv.fit.model import polynomial_basis
from robid.models.lpv.fit.options import SparseBasisOptions
from robid.models.lpv.fit.path import _Search, find_sparse_bases
from robid.models.lpv.fit.responses import normal
from robid.models.lpv.fit.state_space import StateSpace, balance, measure, pack, response, stack, transform, unpack
from tolerances import FINITE_DIFFERENCE

VALUES = basis().values(POSITIONS)
Z = np.exp(1j * np.linspace(0.05, 3.0, 40))


def _scattered(seed):
    """The true systems, each in a basis of its own."""
    T = np.random.default_rng(seed).standard_normal((5, 3, 3)) + 2 * np.eye(3)
    return transform(true_systems(POSITIONS), T)


def test_models_that_are_alike_come_to_the_very_same_basis():
    one = true_systems(np.zeros((5, 1)))
    T = np.random.default_rng(1).standard_normal((5, 3, 3))
    aligned = align_neighbours(transform(one, T), POSITIONS)
    expected = balance(one[0])[0]
    for index in range(5):
        for ours, other in zip(aligned[index].matrices, aligned[2].matrices, strict=True):
            np.testing.assert_allclose(ours, other, atol=1e-7)
    np.testing.assert_allclose(np.abs(aligned.A[2]), np.abs(expected.A), atol=1e-7)


def test_alignment_keeps_responses_and_forgets_the_bases_it_was_given():
    aligned = [align_neighbours(_scattered(seed), POSITIONS) for seed in (1, 2)]
    np.testing.assert_allclose(response(aligned[0], Z), response(true_systems(POSITIONS), Z), rtol=1e-7)
    sizes = [measure(interpolate(one, VALUES), basis().largest, SIZES).relative for one in aligned]
    np.testing.assert_allclose(sizes[0], sizes[1], atol=1e-6)
    naive = measure(interpolate(_scattered(1), VALUES), basis().largest, SIZES).relative
    assert sizes[0][0].max() < 0.1 * naive[0].max()


def test_the_middle_position_is_nearest_to_the_mean():
    assert middle_position(np.array([[-0.35], [-0.1625], [0.025], [0.2125], [0.4]])) == 2


def test_as_many_functions_as_positions_reproduce_every_local_model():
    local = fit_local_models(problem(local_responses(POSITIONS, np.random.default_rng(2))))
    aligned = align_neighbours(local.systems, POSITIONS)
    parameters = interpolate(aligned, VALUES)
    np.testing.assert_allclose(VALUES @ parameters, pack(aligned), rtol=1e-8, atol=1e-8)
    exact = response(local.systems, Z)
    ours = response(unpack(VALUES @ parameters, SIZES), Z)
    np.testing.assert_allclose(ours, exact, atol=1e-8 * np.abs(exact).max())


def test_fewer_functions_than_positions_are_a_least_squares_fit():
    systems = true_systems(POSITIONS)
    values = polynomial_basis(POSITIONS, 2).values(POSITIONS)
    np.testing.assert_allclose(interpolate(systems, values), true_parameters(2), atol=1e-9)


def test_too_few_or_too_poor_positions_are_refused():
    with pytest.raises(DataError, match="5 different positions cannot tell 6 basis functions apart"):
        check_positions(polynomial_basis(POSITIONS, 5).values(POSITIONS))
    line = np.linspace(0, 1, 6)[:, None] * np.array([1.0, 2.0])
    with pytest.raises(DataError, match="D170") as caught:
        interpolate(true_systems(np.zeros((6, 1))), polynomial_basis(line, 1).values(line))
    assert "every scheduling parameter" in caught.value.remedy


def test_local_models_of_different_order_are_refused():
    system = true_systems(POSITIONS)[0]
    smaller = StateSpace(system.A[:2, :2], system.B[:2], system.C[:, :2], system.D)
    with pytest.raises(DataError, match="order 2, 3") as caught:
        stack([system, smaller, system])
    assert "same order" in caught.value.remedy
    assert stack([system, system]).A.shape == (2, 3, 3)


def test_the_search_for_a_sparse_basis_has_the_derivative_of_finite_differences():
    search = _Search(_scattered(3), VALUES, basis().largest, 2)
    generator = np.random.default_rng(4)
    point = np.tile(np.eye(3).ravel(), 4) + 0.1 * generator.standard_normal(36)
    weights = generator.uniform(0.5, 2, (9, SIZES.n_local))
    steps = 1e-6 * np.eye(36)
    slope = [(search.residual(point + s, weights) - search.residual(point - s, weights)) / 2e-6 for s in steps]
    jacobian = np.array(slope).T
    here = search.normal(point, weights)
    np.testing.assert_allclose(here.hessian, jacobian.T @ jacobian, atol=FINITE_DIFFERENCE * np.abs(here.hessian).max())
    np.testing.assert_allclose(here.gradient, jacobian.T @ search.residual(point, weights), rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("degree", [4, 2])
def test_without_noise_one_of_the_bases_has_the_true_blocks_alone(degree):
    """Also with more positions than functions, where few bases let the functions explain the models at all."""
    powers = polynomial_basis(POSITIONS, degree)
    values = powers.values(POSITIONS)
    aligned = align_neighbours(_scattered(5), POSITIONS)
    before = measure(interpolate(aligned, values), powers.largest, SIZES).relative
    options = SparseBasisOptions(smallest=1e-5, passes=20)
    bases = find_sparse_bases(aligned, values, powers.largest, fixed=2, options=options)
    sizes = [measure(interpolate(one, values), powers.largest, SIZES).relative for one in bases]
    true = np.zeros((4, degree), bool)
    true[0, 0] = true[1, 1] = True
    assert before[~true].max() > 0.01
    assert min(size[~true].max() for size in sizes) < 1e-3
    left = [np.abs(values @ interpolate(one, values) - pack(one)).max() for one in bases]
    assert max(left) < 1e-3
    for one in bases:
        np.testing.assert_allclose(response(one, Z), response(aligned, Z), rtol=1e-6)


def test_what_moves_no_response_is_kept_out_of_the_steps_alone():
    """Each of five positions has a basis of its own: 45 directions, no more, move nothing."""
    posed = problem(local_responses(POSITIONS))
    hessian = normal(posed, true_parameters()).hessian
    root = np.sqrt(np.diag(hessian))
    values = np.linalg.eigvalsh(hessian / np.outer(root, root))
    assert np.count_nonzero(values < 1e-11 * values[-1]) == 45
