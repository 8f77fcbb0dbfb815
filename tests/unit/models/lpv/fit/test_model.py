"""The model at rest and in motion."""

import numpy as np
import pytest

from lpv_systems import FREQUENCY, LEFT_OUT, POSITIONS, SIZES, basis, true_parameters, true_systems
from robid.errors import DataError
from robid.models.lpv.fit.model import LpvModel, add_integrators, largest_pole, polynomial_basis, simulate_lpv
from robid.models.lpv.fit.state_space import response
from tolerances import IDENTITY

MODEL = LpvModel(true_parameters(), SIZES, basis(), 1.0)


def test_matrices_at_a_position_are_sums_of_their_blocks():
    here, expected = MODEL.at(LEFT_OUT), true_systems(LEFT_OUT)
    for one, other in zip(here.matrices, expected.matrices, strict=True):
        np.testing.assert_allclose(one, other, atol=IDENTITY)


def test_outside_the_range_there_is_no_model():
    with pytest.raises(DataError, match=r"is valid from -1 to 1, not at 1\.2"):
        MODEL.frozen_response(np.array([[1.2]]), FREQUENCY)


def test_at_rest_a_simulation_settles_at_the_frozen_response():
    n, line = 100, 7
    phase = 2 * np.pi * line * np.arange(20 * n) / n
    outputs, _ = simulate_lpv(MODEL, np.cos(phase)[:, None], np.full((20 * n, 1), -0.25))
    spectrum = np.fft.fft(outputs[-n:], axis=0)[line] / (n / 2)
    expected = MODEL.frozen_response(LEFT_OUT, np.array([line / n]))[0, 0, :, 0]
    np.testing.assert_allclose(spectrum, expected, rtol=1e-8)


def test_in_motion_every_sample_has_its_own_matrices():
    generator = np.random.default_rng(0)
    inputs, scheduling = generator.standard_normal((12, 1)), generator.uniform(-1, 1, (12, 1))
    first = generator.standard_normal(3)
    outputs, last = simulate_lpv(MODEL, inputs, scheduling, first)
    state = first
    for index in range(12):
        here = true_systems(scheduling[index : index + 1])[0]
        np.testing.assert_allclose(outputs[index], here.C @ state + here.D @ inputs[index], rtol=1e-9)
        state = here.A @ state + here.B @ inputs[index]
    np.testing.assert_allclose(last, state, rtol=1e-9)


def test_half_of_a_run_goes_on_from_the_state_of_the_other():
    generator = np.random.default_rng(1)
    inputs, scheduling = generator.standard_normal((20, 1)), generator.uniform(-1, 1, (20, 1))
    whole, _ = simulate_lpv(MODEL, inputs, scheduling)
    _, between = simulate_lpv(MODEL, inputs[:9], scheduling[:9])
    rest, _ = simulate_lpv(MODEL, inputs[9:], scheduling[9:], between)
    np.testing.assert_allclose(rest, whole[9:], rtol=1e-9)


def test_integrators_go_behind_the_outputs_that_have_them():
    period = 0.01
    inner = LpvModel(true_parameters(), SIZES, basis(), period)
    outer = add_integrators(inner, (2, 1))
    frequency = FREQUENCY / period
    step = np.exp(2j * np.pi * FREQUENCY) - 1
    behind = np.stack([(period / step) ** 2, period / step], axis=1)[..., None]
    expected = inner.frozen_response(POSITIONS, frequency) * behind
    np.testing.assert_allclose(response(outer.at(POSITIONS), np.exp(2j * np.pi * FREQUENCY)), expected, rtol=1e-8)
    generator = np.random.default_rng(2)
    inputs, scheduling = generator.standard_normal((30, 1)), generator.uniform(-1, 1, (30, 1))
    rate, _ = simulate_lpv(inner, inputs, scheduling)
    outputs, _ = simulate_lpv(outer, inputs, scheduling)
    np.testing.assert_allclose(np.diff(outputs[:, 1]) / period, rate[:-1, 1], atol=1e-9)
    np.testing.assert_allclose(np.diff(outputs[:, 0], 2) / period**2, rate[:-2, 0], atol=1e-9)


def test_stability_is_looked_for_between_the_positions():
    assert largest_pole(MODEL)[0] < 1
    swollen = true_parameters(5)
    zero_at_positions = np.array([0.25, 0.0, -1.25, 0.0, 1.0])  # of p, p^2, ...: p (p^2 - 1/4) (p^2 - 1)
    swollen[1:, SIZES.parts[0]] += 5 * zero_at_positions[:, None] * np.eye(3).ravel()
    model = LpvModel(swollen, SIZES, polynomial_basis(POSITIONS, 5), 1.0)
    radius, point = largest_pole(model)
    assert np.all(model.at(POSITIONS).spectral_radius < 1)
    assert radius >= 1
    assert radius == pytest.approx(float(model.at(point[None]).spectral_radius[0]))
    assert abs(point[0]) not in (0.0, 0.5, 1.0)
