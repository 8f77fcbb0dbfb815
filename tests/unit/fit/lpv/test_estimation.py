"""The whole fit on a system whose blocks are known."""

import dataclasses

import numpy as np
import pytest

from lpv_systems import LEFT_OUT, POSITIONS, STRUCTURE, basis, local_responses, true_systems
from robid.errors import DataError
from robid.fit.lpv.basis import polynomial_basis
from robid.fit.lpv.blocks import block_names
from robid.fit.lpv.estimation import LpvOptions, estimate_lpv
from robid.fit.lpv.path import PathOptions
from robid.fit.lpv.responses import LocalResponses
from robid.fit.lpv.state_space import response

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
    fitted, held_out = (_integrated(one, 1e-3, (1, 2)) for one in _drawn(0))
    options = dataclasses.replace(SHORT, integrators=(1, 2))
    return estimate_lpv(fitted, held_out, basis(), options), held_out


def test_the_true_blocks_are_found_behind_integrators_and_units(found):
    result, _ = found
    assert block_names(result.kept) == STRUCTURE
    assert result.stability.stable
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
    with pytest.raises(DataError, match="5 positions cannot tell 6 basis functions"):
        estimate_lpv(fitted, held_out, polynomial_basis(POSITIONS, 5), SHORT)


def test_validation_outside_the_range_is_refused():
    fitted, held_out = _drawn(2)
    far = dataclasses.replace(held_out, points=np.array([[1.5]]))
    with pytest.raises(DataError, match="from -1 to 1"):
        estimate_lpv(fitted, far, basis(), SHORT)


@pytest.mark.slow
def test_the_exact_structure_is_found_in_nearly_all_noisy_runs():
    hits = 0
    for seed in range(100):
        T = np.random.default_rng(1000 + seed).standard_normal((3, 3))
        fitted, held_out = _drawn(seed, T)
        hits += block_names(estimate_lpv(fitted, held_out, basis(), LpvOptions()).kept) == STRUCTURE
    assert hits >= 95
