"""What is kept of a fit: poles with intervals, agreement, and a model that comes back from plain values."""

from dataclasses import replace

import numpy as np
import pytest

from lpv_systems import LEFT_OUT, POSITIONS, local_responses, true_systems
from robid.errors import DataError
from robid.models.lpv.fit.fitting import fit_lpv
from robid.models.lpv.fit.model import polynomial_basis, spline_basis
from robid.models.lpv.fit.options import BasisOptions, LpvOptions, PathOptions
from robid.models.lpv.fit.responses import LocalResponses, agree, expected_share, hidden_error
from robid.models.lpv.fit.solution import Ports, tabulate_basis
from robid.models.lpv.fit.uncertainty import estimate_poles

SHORT = LpvOptions(order=3, path=PathOptions(count=2, smallest=30, largest=300))
PORTS = Ports(("u",), ("N m",), ("y1", "y2"), ("rad", "m"), ("slide",), ("m",), 1.0)
LEVELS = {"degrees_of_freedom": 3.0, "confidence": 0.95, "identifiable_relative_std": 0.2}


@pytest.fixture(scope="module")
def found():
    generator = np.random.default_rng(1)
    own, choosing = local_responses(POSITIONS, generator), local_responses(LEFT_OUT, generator)
    return fit_lpv(own, choosing, PORTS, BasisOptions(), SHORT, **LEVELS)


def test_poles_are_those_of_the_system(found):
    estimate = found.estimate
    poles = np.log(np.linalg.eigvals(true_systems(POSITIONS).A))
    wanted = [np.abs(one[one.imag > 0]).item() for one in poles]
    names = [f"p{index + 1}.pole2.frequency" for index in range(5)]
    at = [estimate.names.index(name) for name in names]
    np.testing.assert_allclose(estimate.value[at], wanted, rtol=2e-3)
    inside = (estimate.lower[at] <= wanted) & (wanted <= estimate.upper[at])
    assert inside.sum() >= 3
    assert (estimate.relative_std[at] < 2e-3).all()


def test_slopes_of_the_poles_are_differences(found):
    core, generator = found.core_model, np.random.default_rng(2)
    step = generator.standard_normal(core.parameters.size)
    levels = {"confidence": 0.95, "identifiable_relative_std": 0.2}
    moved = [
        estimate_poles(
            type(core)(
                core.parameters + size * 1e-6 * step.reshape(core.parameters.shape), core.sizes, core.basis, 1.0
            ),
            np.outer(step, step),
            POSITIONS,
            "converged",
            **levels,
        )
        for size in (-1, 0, 1)
    ]
    slope = (moved[2].value - moved[0].value) / 2e-6
    np.testing.assert_allclose(np.sqrt(np.diag(moved[1].covariance)), np.abs(slope), rtol=1e-5)


def test_the_model_comes_back_from_plain_values(found):
    frequency = np.array([0.01, 0.1, 0.3])
    points = np.array([[-0.7], [0.2]])
    here = found.response(points, frequency)
    np.testing.assert_allclose(here.response, found.model.frozen_response(points, frequency), rtol=1e-9)
    matrices = found.model.coefficients
    np.testing.assert_array_equal(matrices.A, found.matrices.A)
    assert (here.total > 0).all()


def test_models_with_all_blocks_are_kept(found):
    def cost(model, held):
        error = model.frozen_response(held.points, held.frequency_hz) - held.response
        return np.sum(np.abs(error / held.std) ** 2)

    assert found.path.gamma[0] == 0
    assert cost(found.full_model, found.own) == pytest.approx(found.path.refit_cost[0], rel=1e-6)
    assert cost(found.full_model, found.choosing) == pytest.approx(found.path.validation_cost[0], rel=1e-6)
    # As many functions as positions: every local model comes back, which no common model can better at its position.
    costs = [cost(model, found.own) for model in (found.smile_model, found.full_model, found.model)]
    assert costs[0] <= costs[1] * (1 + 1e-9) < costs[2]
    assert np.count_nonzero(np.abs(found.dense.smile).max(axis=1)) == 5


def test_intervals_widen_where_the_residual_is_larger_than_its_variance(found):
    generator = np.random.default_rng(1)
    own, choosing = (
        replace(one, variance=one.variance / 9)
        for one in (local_responses(POSITIONS, generator), local_responses(LEFT_OUT, generator))
    )
    other = fit_lpv(own, choosing, PORTS, BasisOptions(), SHORT, **LEVELS)
    assert other.misfit == pytest.approx(9, rel=0.1)
    np.testing.assert_allclose(other.estimate.relative_std, found.estimate.relative_std, rtol=0.1)


@pytest.mark.parametrize("pieces", [0, 2])
def test_a_basis_comes_back_from_its_table(pieces):
    points = np.random.default_rng(1).uniform(-1, 2, (20, 2))
    basis = spline_basis(points, pieces=pieces, degree=2) if pieces else polynomial_basis(points, 3)
    again = tabulate_basis(basis).basis()
    np.testing.assert_array_equal(again.values(points), basis.values(points))
    assert again.functions.names == basis.functions.names


def test_agreement_of_noise_is_what_noise_gives(found):
    agreement = found.own.agreement
    assert agreement.share_within.mean() == pytest.approx(1 - np.exp(-4), abs=0.01)
    assert agreement.error_ratio.mean() == pytest.approx(1, abs=0.05)
    assert expected_share(3) == pytest.approx(1 - (3 / 7) ** 3)
    assert found.misfit == pytest.approx(1, abs=0.1)


def test_agreement_tells_what_deviations_do_not_explain():
    response = np.ones((1, 50, 1, 1), complex)
    noise = np.full(response.shape, 0.06)
    found = agree(response, 1.1 * response, noise, noise)
    explained = 0.06**2 * (1 + 3 / np.sqrt(50))
    assert found.excess.item() == pytest.approx(np.sqrt(0.1**2 - explained))
    assert hidden_error(response, noise).item() == pytest.approx(0.06 * np.sqrt(3 / np.sqrt(50)))
    assert found.relative_error.item() == pytest.approx(0.1)
    assert found.share_within.item() == 1
    assert found.error_db.item() == pytest.approx(20 * np.log10(1.1))
    unsure = agree(response, 1.1 * response, 3 * noise, noise)
    assert unsure.excess.item() == pytest.approx(found.excess.item())  # a model that knows nothing is no better for it
    assert unsure.error_ratio.item() == pytest.approx(found.error_ratio.item() / 3)


@pytest.mark.parametrize("level", [0.3, 1.0, 3.0])
def test_a_right_model_is_within_noise_however_much_of_it_there_is(level):
    generator = np.random.default_rng(1)
    shape = (100, 99, 2, 1)
    std = level * np.sqrt(generator.chisquare(12, shape) / 12)
    noise = level * (generator.standard_normal(shape) + 1j * generator.standard_normal(shape)) / np.sqrt(2)
    response = np.ones(shape, complex)
    found = agree(response + noise, response, std, std)
    assert np.mean(found.excess > 0) < 0.02


def test_coupling_that_is_hardly_there_need_not_be_known():
    response = np.tile(np.array([[4.0, 0.04], [0.01, 1.0]]).astype(complex), (2, 30, 1, 1))
    modelled = response + np.array([[0.0, 0.02], [0.005, 0.0]])
    unknown = np.full(response.shape, np.nan)
    found = agree(response, modelled, unknown, unknown)
    np.testing.assert_allclose(found.relative_error[:, [0, 1], [1, 0]], 0.5)
    natural = np.sqrt(np.sqrt(4 * 1) * np.sqrt(0.04 * 0.01)) * np.array([2.0, 0.5])
    np.testing.assert_allclose(found.excess[0, [0, 1], [1, 0]], [0.02, 0.005] / natural, rtol=1e-9)
    metres = np.array([[1.0], [1e-3]]) * np.array([5.0, 0.2])
    other = agree(response * metres, modelled * metres, unknown, unknown)
    np.testing.assert_allclose(other.excess, found.excess, rtol=1e-9)


def test_weights_without_a_covariance_are_refused():
    responses = local_responses(POSITIONS)
    bare = LocalResponses(responses.points, responses.frequency_hz, responses.response, None, 1.0)
    with pytest.raises(DataError, match="no covariance"):
        fit_lpv(bare, bare, PORTS, BasisOptions(), SHORT, **LEVELS)
