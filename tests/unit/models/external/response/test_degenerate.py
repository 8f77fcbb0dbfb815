"""Responses with little or nothing to fit: a finite model with the fewest parameters, not an exception."""

import numpy as np
import pytest

from robid.models.external.response.data import MeasuredResponse
from robid.models.external.response.fitting import fit_response
from robid.models.external.response.options import ResponseFitOptions

FREQUENCY = np.geomspace(1, 100, 100)
S = 2j * np.pi * FREQUENCY
FLAT = np.ones(100, dtype=complex)


def noise(shape, seed=0):
    rng = np.random.default_rng(seed)
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2)


def fitted(response, deviation, options=None, frequency=FREQUENCY, **others):
    variance = np.broadcast_to(np.square(deviation), response.shape).copy()
    data = MeasuredResponse(frequency, response[:, None, None], variance[:, None, None], **others)
    fit = fit_response(data, options)
    at = fit.response_at(frequency)
    for values in (at.response, at.real_std, at.imaginary_std, fit.numerator, fit.denominator, fit.covariance_root):
        assert np.isfinite(values).all()
    return fit


@pytest.mark.parametrize(
    ("response", "deviation"),
    [
        (0 * FLAT, 1.0),
        (noise(100), 1.0),
        (5 * FLAT, 1.0),
        (5 * FLAT + noise(100), 1.0),
        (5 * FLAT, 1e-10),
        (1e-12 * (FLAT + 0.01 * noise(100)), 1e-14),
    ],
)
def test_a_constant_has_no_poles(response, deviation):
    fit = fitted(response, deviation)
    assert (fit.n_pole, fit.delay_s) == (0, 0.0)


def test_a_pure_delay_has_no_poles():
    fit = fitted(np.exp(-0.013 * S) + 0.01 * noise(100), 0.01)
    assert fit.n_pole == 0
    assert abs(fit.delay_s - 0.013) < 4 * fit.delay_std_s


def test_an_exact_integrator_is_one():
    fit = fitted(1 / S, 1e-3 * np.abs(1 / S))
    assert (fit.n_pole, fit.integrators) == (1, 1)
    np.testing.assert_allclose(fit.gain, 1.0, rtol=1e-8)


def test_a_differentiator_has_a_zero_and_no_pole():
    fit = fitted(1 * S, 1e-3 * np.abs(S), ResponseFitOptions(relative_degree=-1))
    assert (fit.n_pole, len(fit.zeros[0][0])) == (0, 1)


@pytest.mark.parametrize("seed", range(3))
def test_a_sampled_integrator_has_a_gain_per_second(seed):
    frequency, period = np.arange(1, 101) * 4.9, 1e-3
    z = np.exp(2j * np.pi * frequency * period)
    true = period / (z - 1)
    response = true * (1 + 0.01 * noise(100, seed))
    options = ResponseFitOptions(time="discrete")
    fit = fitted(response, 0.01 * np.abs(true), options, frequency, sampling_period_s=period)
    # 1 / (z - 1) is z^-1 / (1 - z^-1): a sample of delay and a constant numerator.
    assert (fit.n_pole, fit.integrators, round(fit.delay_s / period)) == (1, 1, 1)
    assert abs(fit.gain[0, 0] - 1) < 4 * fit.gain_std[0, 0]


@pytest.mark.parametrize("n_line", [1, 2, 3, 5, 8])
def test_few_lines_allow_few_poles(n_line):
    response = 1 / (S[:n_line] + 10) + 1e-3 * noise(n_line)
    fit = fitted(response, 1e-3, frequency=FREQUENCY[:n_line])
    assert fit.degrees_of_freedom >= 0
    with pytest.raises(ValueError, match="so few data"):
        fitted(response, 1e-3, ResponseFitOptions(poles=n_line + 1), frequency=FREQUENCY[:n_line])


def test_elements_known_at_different_lines():
    variance = np.full((100, 2, 1), 1e-6)
    variance[:50, 0], variance[60:, 1] = np.inf, np.inf
    response = np.stack([1 / (S + 20), 2 / (S + 20)], axis=1)[:, :, None] + 1e-3 * noise((100, 2, 1))
    fit = fit_response(MeasuredResponse(FREQUENCY, response, variance))
    assert fit.n_pole == 1
    assert abs(fit.poles[0].place + 20) < 4 * fit.poles[0].real_std
