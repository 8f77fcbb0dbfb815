"""Models along a moving scheduling parameter: steady states solved at once, drift, and what repeats of an error."""

import numpy as np
import pytest

from lpv_systems import SIZES, basis, true_parameters, true_systems
from robid.errors import DataError
from robid.models.lpv.fit.model import LpvModel
from robid.studies.turk2018.moving import (
    LEAD,
    deviation,
    error_excess,
    measured_amplitudes,
    simulated_amplitudes,
    split_errors,
)
from tolerances import IDENTITY

STEP, COUNT, PERIODS = 0.01, 120, 3
LINES = np.array([3, 7, 20])


def steady_states(inputs, scheduling):
    """Outputs of the periodic steady state: all equations of a period solved together."""
    systems, n = true_systems(scheduling), SIZES.n_state
    matrix = np.eye(n * COUNT)
    for sample, A in enumerate(systems.A):
        after = (sample + 1) % COUNT
        matrix[n * after : n * after + n, n * sample : n * sample + n] -= A
    driven = np.roll((systems.B @ inputs[..., None])[..., 0], 1, axis=0)
    states = np.linalg.solve(matrix, driven.ravel()).reshape(COUNT, n, 1)
    return (systems.C @ states + systems.D @ inputs[..., None])[..., 0]


def amplitudes(samples):
    turns = np.exp(-2j * np.pi * np.outer(LINES, np.arange(len(samples))) / len(samples))
    return turns @ samples / len(samples)


@pytest.fixture(scope="module")
def motion():
    inputs = np.random.default_rng(1).standard_normal((COUNT, 1)) + 0.5
    scheduling = 0.8 * np.sin(2 * np.pi * np.arange(COUNT) / COUNT + 0.3)[:, None]
    return inputs, scheduling


def simulated(motion, integrators=(0, 0)):
    model = LpvModel(true_parameters(), SIZES, basis(), STEP)
    periods = [np.broadcast_to(one, (PERIODS, *one.shape)) for one in motion]
    return simulated_amplitudes(model, integrators, *periods, LINES)


def test_a_moving_model_is_simulated_in_its_steady_state(motion):
    found = simulated(motion)
    assert found.shape == (PERIODS, len(LINES), SIZES.n_out)
    wanted = amplitudes(steady_states(*motion))
    left = np.abs(np.linalg.eigvals(true_systems(np.zeros((1, 1))).A)).max() ** COUNT
    assert left < 0.05  # what is left of the transient after one period
    np.testing.assert_allclose(found, [wanted] * PERIODS, atol=left**LEAD * np.abs(wanted).max())
    assert np.abs(found[0] - wanted).max() > left ** (LEAD + 2) * np.abs(wanted).max()


def test_integrators_are_put_back_behind_the_moving_part(motion):
    inner = steady_states(*motion)
    inner = inner - inner.mean(axis=0)
    once = STEP * np.cumsum(np.vstack([np.zeros((1, 2)), inner[:-1]]), axis=0)
    found = simulated(motion, (1, 0))[-1]
    scale = np.abs(amplitudes(once)[:, 0]).max()
    np.testing.assert_allclose(found[:, 0], amplitudes(once)[:, 0], atol=1e-4 * scale)
    np.testing.assert_allclose(found[:, 1], simulated(motion)[-1, :, 1], rtol=IDENTITY)


def test_a_parameter_outside_the_range_is_refused(motion):
    with pytest.raises(DataError, match="is valid from -1 to 1"):
        simulated((motion[0], 1.5 * motion[1]))


def test_a_steady_drift_leaves_no_trace():
    time = np.arange(PERIODS * COUNT) / COUNT
    tone = np.cos(2 * np.pi * 7 * time + 0.4)
    samples = (tone + 5.0 * time - 3.0).reshape(PERIODS, COUNT, 1)
    found = measured_amplitudes(samples, LINES)
    wanted = np.array([0, 0.5 * np.exp(0.4j), 0])[None, :, None] * np.ones((PERIODS, 1, 1))
    np.testing.assert_allclose(found, wanted, atol=5 * IDENTITY)
    assert np.abs(measured_amplitudes(samples[:1], LINES) - wanted[:1]).max() > 0.1


def test_an_error_is_what_repeats_and_the_rest():
    generator = np.random.default_rng(2)
    noise = generator.standard_normal((7, 4000, 2, 2)) @ np.array([1, 1j])
    parts = split_errors(noise)
    np.testing.assert_allclose(parts.total**2, parts.systematic**2 + parts.stochastic**2, rtol=IDENTITY)
    np.testing.assert_allclose(parts.over_stochastic, np.sqrt(7 / 6), rtol=0.005)
    repeated = 2.0 * np.exp(1j * generator.uniform(0, 6, (4000, 2)))
    more = split_errors(noise + repeated)
    np.testing.assert_allclose(deviation(more.stochastic), deviation(parts.stochastic), rtol=IDENTITY)
    np.testing.assert_allclose(more.over_stochastic, np.sqrt((2 + 4) / (2 * 6 / 7)), rtol=0.02)
    np.testing.assert_allclose(error_excess(more, parts), np.sqrt(6 / 2) - 1, rtol=0.02)
    assert error_excess(parts, parts).tolist() == [0, 0]
