"""The error's derivative against finite differences, its reduction against all rows, and descents."""

import numpy as np
import pytest

from lpv_systems import POSITIONS, SIZES, local_responses, problem, true_parameters
from robid.models.lpv.fit.model import polynomial_basis
from robid.models.lpv.fit.responses import (
    LocalResponses,
    cost,
    errors,
    local_jacobian,
    make_problem,
    normal,
    output_scales,
    reduce_rows,
    remove_integrators,
    smooth_variance,
    solve,
)
from tolerances import FINITE_DIFFERENCE


def _random_problem(seed, n_in=2, n_out=3):
    generator = np.random.default_rng(seed)
    shape = (5, 25, n_out, n_in)
    measured = generator.standard_normal((*shape, 2)) @ np.array([1, 1j])
    responses = LocalResponses(POSITIONS, np.linspace(0.01, 0.45, 25), measured, generator.uniform(0.5, 2, shape), 1.0)
    basis = polynomial_basis(POSITIONS, 2)
    posed = make_problem(responses, basis, 4, np.ones(n_out), weighted=True)
    point = 0.15 * generator.standard_normal((3, posed.sizes.n_local))
    return posed, point


def test_the_derivative_by_finite_differences():
    posed, point = _random_problem(1)
    _, slope = local_jacobian(posed, point)
    full = np.einsum("qk,qrl->qrkl", posed.values, slope).reshape(-1, point.size)
    step = 1e-6
    numeric = np.empty_like(full)
    for index in range(point.size):
        change = np.zeros(point.size)
        change[index] = step
        ends = [errors(posed, point + sign * change.reshape(point.shape)).ravel() for sign in (1, -1)]
        numeric[:, index] = (ends[0] - ends[1]) / (2 * step)
    np.testing.assert_allclose(full, numeric, atol=FINITE_DIFFERENCE * np.abs(full).max())


def test_reduced_rows_keep_the_normal_equations_of_all_rows():
    posed, point = _random_problem(2)
    error, slope = local_jacobian(posed, point)
    full = np.einsum("qk,qrl->qrkl", posed.values, slope).reshape(-1, point.size)
    here, reduced = normal(posed, point), reduce_rows(posed, point)
    assert reduced.rows.shape[0] == 5 * posed.sizes.n_local < 2 * len(full)
    np.testing.assert_allclose(here.hessian, np.real(full.conj().T @ full), atol=1e-9 * np.abs(here.hessian).max())
    np.testing.assert_allclose(here.gradient, np.real(full.conj().T @ error.ravel()), atol=1e-9 * here.cost)
    assert here.cost == pytest.approx(cost(posed, point), rel=1e-12)


def test_positions_with_fewer_rows_than_elements_reduce_too():
    responses = local_responses(POSITIONS, frequency=np.array([0.05, 0.2]))
    posed = problem(responses)
    _, slope = local_jacobian(posed, true_parameters() * 1.01)
    full = np.einsum("qk,qrl->qrkl", posed.values, slope).reshape(-1, 100)
    here = normal(posed, true_parameters() * 1.01)
    np.testing.assert_allclose(here.hessian, np.real(full.conj().T @ full), atol=1e-9 * np.abs(here.hessian).max())


def test_the_truth_comes_back_from_near_it():
    posed = problem(local_responses(POSITIONS))
    start = true_parameters() + 1e-3 * np.random.default_rng(3).standard_normal((5, SIZES.n_local))
    assert cost(posed, start) > 1
    found, minimum = solve(posed, start)
    assert cost(posed, found) < 1e-12 * cost(posed, start)
    free = true_parameters() != 0
    kept, _ = solve(posed, true_parameters() * 1.002, free=free)
    assert np.all(kept[~free] == 0)
    assert cost(posed, kept) < 1e-12 * cost(posed, true_parameters() * 1.002)
    assert minimum.status == "converged"


def test_an_element_without_weight_counts_for_nothing():
    responses = local_responses(POSITIONS, np.random.default_rng(4))
    lost = responses.response.copy()
    lost[2, 50] = 1e6
    variance = responses.variance.copy()
    variance[2, 50] = np.inf
    for weighted in (True, False):
        posed = make_problem(
            LocalResponses(POSITIONS, responses.frequency_hz, lost, variance, 1.0),
            polynomial_basis(POSITIONS, 4),
            3,
            np.ones(2),
            weighted=weighted,
        )
        assert posed.n_data == 5 * 200 * 2 - 2
        assert cost(posed, true_parameters()) < 3000


def test_scales_of_the_outputs_leave_the_cost_alone():
    responses = local_responses(POSITIONS, np.random.default_rng(5))
    scales = output_scales(responses)
    for weighted in (True, False):
        posed = make_problem(responses, polynomial_basis(POSITIONS, 4), 3, scales, weighted=weighted)
        shrunk = true_parameters()
        for part in SIZES.parts[2:]:
            shrunk[:, part] /= np.repeat(scales, (part.stop - part.start) // 2)
        own = make_problem(responses, polynomial_basis(POSITIONS, 4), 3, np.ones(2), weighted=weighted)
        assert cost(posed, shrunk) == pytest.approx(cost(own, true_parameters()), rel=1e-9)


def test_integrators_leave_response_and_variance():
    period = 1e-3
    frequency = np.linspace(1, 100, 20)
    factor = (np.exp(2j * np.pi * frequency * period) - 1) / period
    shape = (1, 20, 2, 1)
    measured = np.stack([1 / factor**2, 3 / factor], axis=1)[None, :, :, None]
    responses = LocalResponses(np.zeros((1, 1)), frequency, measured, np.ones(shape), period)
    left = remove_integrators(responses, (2, 1))
    np.testing.assert_allclose(left.response[..., 0], np.broadcast_to([1, 3], (1, 20, 2)), rtol=1e-9)
    np.testing.assert_allclose(left.variance[0, :, 1, 0], np.abs(factor) ** 2, rtol=1e-9)


def test_responses_that_make_no_sense_are_refused():
    shape = (5, 25, 1, 1)
    good = np.ones(shape, complex)
    with pytest.raises(ValueError, match="half the sampling rate"):
        LocalResponses(POSITIONS, np.linspace(0.1, 0.6, 25), good, None, 1.0)
    with pytest.raises(ValueError, match="must be finite"):
        LocalResponses(POSITIONS, np.linspace(0.1, 0.4, 25), np.full(shape, np.nan + 0j), None, 1.0)
    with pytest.raises(ValueError, match="shape of `response`"):
        LocalResponses(POSITIONS, np.linspace(0.1, 0.4, 25), good, np.ones((5, 25)), 1.0)
    responses = LocalResponses(POSITIONS, np.linspace(0.1, 0.4, 25), good, np.zeros(shape), 1.0)
    with pytest.raises(ValueError, match="positive variance"):
        make_problem(responses, polynomial_basis(POSITIONS, 2), 2, np.ones(1), weighted=True)
    with pytest.raises(ValueError, match="one count per output"):
        remove_integrators(responses, (1, 1))


def test_variances_are_averaged_over_their_neighbours_without_lost_lines():
    variance = np.arange(1.0, 8.0)[None, :, None, None].copy()
    variance[0, 3] = np.inf
    found = smooth_variance(variance, 3)[0, :, 0, 0]
    np.testing.assert_allclose(found, [1.5, 2.0, 2.5, np.inf, 5.5, 6.0, 6.5])
    np.testing.assert_allclose(smooth_variance(variance, 1), variance)
