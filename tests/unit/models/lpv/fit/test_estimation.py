"""The whole fit on a system whose blocks are known."""

import dataclasses

import numpy as np
import pytest

from lpv_systems import LEFT_OUT, POSITIONS, STRUCTURE, basis, local_responses, true_systems
from robid.errors import DataError
from robid.models.lpv.fit.fitting import estimate_lpv
from robid.models.lpv.fit.model import Basis, Polynomials, polynomial_basis
from robid.models.lpv.fit.options import LpvOptions, PathOptions
from robid.models.lpv.fit.responses import LocalResponses
from robid.models.lpv.fit.state_space import StateSpace, block_names, response
from robid.studies.turk2018.synthetic import ORDER, fit_synthetic

SHORT = LpvOptions(order=3, path=PathOptions(count=3, smallest=10, largest=1000))


def _drawn(seed, T=None):
    generator = np.random.default_rng(seed)
    return local_responses(POSITIONS, generator, T=T), local_responses(LEFT_OUT, generator, T=T)


def _integrated(responses, period, counts):
    """The same system at another rate, some outputs integrated and in other units."""
    factor = (period / (responses.z[:, None] - 1)) ** np.array(counts) * np.array([1e3, 1e-3])
    return LocalResponses(
        responses.points,
        responses.frequency_hz / period,
        responses.response * factor[..., None],
        responses.variance * np.abs(factor[..., None]) ** 2,
        period,
    )


@pytest.fixture(scope="module")
def found():
    """Behind integrators, with variances as four realizations give them."""
    fitted, held_out = (_integrated(one, 1e-3, (1, 2)) for one in _drawn(0))
    scatter = np.random.default_rng(8).chisquare(6, fitted.variance.shape) / 6
    fitted = dataclasses.replace(fitted, variance=fitted.variance * scatter)
    options = dataclasses.replace(SHORT, integrators=(1, 2))
    return estimate_lpv(fitted, held_out, basis(), options), held_out


def test_the_true_blocks_are_found_behind_integrators_and_units(found):
    result, _ = found
    assert block_names(result.kept) == STRUCTURE
    assert result.largest_pole[0] < 1
    # Without averaging, weights of three degrees of freedom would give 1.5.
    assert result.parameters.misfit == pytest.approx(1.0, abs=0.15)
    dropped = np.ones((5, 4), bool)
    dropped[0] = dropped[1, 0] = dropped[2, 1] = False
    for row in range(4):
        for function in range(5):
            norm = np.linalg.norm(result.core.parameters[function, result.core.sizes.parts[row]])
            assert (norm == 0) == dropped[function, row]
    assert result.model.sizes.n_state == 3 + 1 + 2


def test_the_left_out_position_is_met_within_its_noise(found):
    result, held_out = found
    ours = result.model.frozen_response(LEFT_OUT, held_out.frequency_hz)
    error = np.abs(ours - held_out.response) ** 2 / held_out.variance
    assert error.mean() == pytest.approx(1.0, abs=0.2)
    smile = result.smile.frozen_response(LEFT_OUT, held_out.frequency_hz)
    assert smile.shape == ours.shape


def test_intervals_hold_the_true_response(found):
    result, _ = found
    frequency = np.linspace(5.0, 350.0, 40)
    asked = result.uncertainty(np.array([[-0.25], [0.8]]), frequency)
    z = np.exp(2j * np.pi * frequency * 1e-3)
    factor = (1e-3 / (z[:, None] - 1)) ** np.array([1, 2]) * np.array([1e3, 1e-3])
    truth = response(true_systems(np.array([[-0.25], [0.8]])), z) * factor[..., None]
    inside = np.abs(asked.response - truth) / asked.total
    assert 0.2 < np.sqrt(np.mean(inside**2)) < 2.0
    np.testing.assert_allclose(asked.response, result.model.frozen_response(np.array([[-0.25], [0.8]]), frequency))


def test_too_few_positions_are_refused_before_the_fit():
    fitted, held_out = _drawn(1)
    with pytest.raises(DataError, match="5 different positions cannot tell 6 basis functions"):
        estimate_lpv(fitted, held_out, polynomial_basis(POSITIONS, 5), SHORT)


def test_a_position_that_was_measured_twice_counts_once():
    points = POSITIONS.copy()
    points[2] = points[1] + 1e-5
    options = LpvOptions(order=3)
    with pytest.raises(DataError, match="4 different positions cannot tell 5 basis functions"):
        estimate_lpv(local_responses(points), local_responses(LEFT_OUT), polynomial_basis(points, 4), options)


def test_validation_outside_the_range_is_refused():
    fitted, held_out = _drawn(2)
    far = dataclasses.replace(held_out, points=np.array([[1.5]]))
    with pytest.raises(DataError, match="from -1 to 1"):
        estimate_lpv(fitted, far, basis(), SHORT)


def test_responses_without_variances_are_weighed_alike():
    fitted, held_out = (dataclasses.replace(one, variance=None) for one in _drawn(3))
    options = dataclasses.replace(SHORT, weighted=False, path=PathOptions(count=2, smallest=10, largest=300))
    found = estimate_lpv(fitted, held_out, basis(), options)
    assert block_names(found.kept) == STRUCTURE
    assert found.uncertainty(LEFT_OUT, np.array([0.1])).total.min() > 0


def test_two_parameters_and_two_inputs():
    """A follows the first parameter, C the second; positions on a grid, bilinear functions."""
    p1, p2 = (side.ravel()[:, None, None] for side in np.meshgrid([-1.0, 0.0, 1.0], [0.0, 0.5, 1.0]))
    ones = np.ones_like(p1)
    generator = np.random.default_rng(4)
    B, D = generator.standard_normal((3, 2)), np.zeros((2, 2))
    A1 = np.array([[0.0, 0.02, 0.0], [0.0, 0.0, 0.06], [0.01, -0.06, 0.0]])
    nominal = true_systems(np.zeros((1, 1)))[0]
    C1 = np.array([[0.3, 0.0, 0.2], [0.0, -0.4, 0.0]])
    systems = StateSpace(nominal.A + A1 * p1, B * ones, nominal.C + C1 * p2, D * ones)
    points = np.concatenate([p1, p2], axis=1)[:, :, 0]
    frequency = np.linspace(0.005, 0.4, 30)
    exact = response(systems, np.exp(2j * np.pi * frequency))
    drawn = [
        LocalResponses(
            points,
            frequency,
            exact + 1e-2 * generator.standard_normal((*exact.shape, 2)) @ np.array([1, 1j]),
            np.full(exact.shape, 2e-4),
            1.0,
        )
        for _ in range(2)
    ]
    functions = Basis(Polynomials(((1, 0), (0, 1), (1, 1)), (0.0, 0.0), (1.0, 1.0)), points.min(0), points.max(0))
    found = estimate_lpv(*drawn, functions, SHORT)
    assert block_names(found.kept) == ("A1", "C2")


@pytest.mark.slow
def test_the_exact_structure_is_found_in_nearly_all_noisy_runs():
    found = [block_names(fit_synthetic(seed, LpvOptions(order=ORDER)).kept) for seed in range(100)]
    assert found.count(STRUCTURE) >= 95
