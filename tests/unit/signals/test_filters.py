"""Filters without phase: closed forms, and the plain convolution that the decimator shortens."""

import numpy as np
import pytest

from robid.signals.filters import (
    central_differences,
    design_decimator,
    low_pass,
    low_pass_gain,
    low_pass_reach,
)
from tolerances import FINITE_DIFFERENCE, IDENTITY

PERIOD_S = 1e-3


def _sine(hertz: float, n_sample: int = 4000) -> np.ndarray:
    return np.sin(2 * np.pi * hertz * PERIOD_S * np.arange(n_sample) + 0.3)


@pytest.mark.parametrize("hertz", [5.0, 40.0, 70.0])
@pytest.mark.parametrize("order", [2, 4])
def test_low_pass_scales_a_sine_by_butterworths_power_gain_and_keeps_its_phase(hertz, order):
    signal = _sine(hertz)
    reach = low_pass_reach(PERIOD_S, 40.0, order)
    warped = np.tan(np.pi * hertz * PERIOD_S) / np.tan(np.pi * 40.0 * PERIOD_S)
    gain = 1 / (1 + warped ** (2 * order))
    inner = slice(2 * reach, -2 * reach)
    error = np.abs(low_pass(signal, PERIOD_S, 40.0, order) - gain * signal)[inner]
    assert error.max() < 1e-6
    angle, gains = low_pass_gain(PERIOD_S, 40.0, order)
    assert np.interp(2 * np.pi * hertz * PERIOD_S, angle, gains) == pytest.approx(gain, rel=1e-5)


def test_ends_of_a_record_reach_no_further_than_said():
    signal = _sine(3.0)
    changed = signal.copy()
    changed[-1] += 1.0
    reach = low_pass_reach(PERIOD_S, 20.0)
    difference = np.abs(low_pass(changed, PERIOD_S, 20.0) - low_pass(signal, PERIOD_S, 20.0))
    assert difference[:-reach].max() < 1e-3 * difference.max()
    assert difference[-reach // 4 :].max() == difference.max()


def test_a_cut_off_above_half_the_sampling_rate_is_refused():
    with pytest.raises(ValueError, match="between 0 and 500 Hz"):
        low_pass(_sine(3.0), PERIOD_S, 500.0)


def test_central_differences_are_of_second_order():
    errors = []
    for period in (1e-2, 5e-3):
        time = np.arange(0, 2, period)
        velocity, acceleration = central_differences(np.sin(3 * time), period)
        errors.append(
            (
                np.abs(velocity - 3 * np.cos(3 * time[1:-1])).max(),
                np.abs(acceleration + 9 * np.sin(3 * time[1:-1])).max(),
            )
        )
    np.testing.assert_allclose(np.divide(*errors), 4.0, rtol=0.01)


@pytest.mark.parametrize("factor", [1, 3, 10])
@pytest.mark.parametrize("last", [False, True])
def test_decimator_is_the_convolution_at_the_kept_samples(factor, last):
    decimator = design_decimator(factor)
    n_sample = 2 * decimator.reach + 37 * factor
    samples = np.random.default_rng(0).standard_normal((n_sample, 2, 3))
    if last:
        samples = np.moveaxis(np.ascontiguousarray(np.moveaxis(samples, 0, -1)), -1, 0)
    kept = decimator.kept(n_sample)
    assert decimator(samples).shape == (len(kept), 2, 3)
    whole = np.apply_along_axis(np.convolve, 0, samples, decimator.kernel, "same")
    np.testing.assert_allclose(decimator(samples), whole[kept], rtol=0, atol=IDENTITY)


def test_decimator_passes_what_it_should_and_folds_nothing():
    decimator = design_decimator(10)  # cut-off 50 Hz at 1 kHz
    kept = decimator.kept(4000)
    for hertz in (1.0, 25.0, 40.0):
        np.testing.assert_allclose(decimator(_sine(hertz)), _sine(hertz)[kept], atol=2e-4)
    for hertz in (60.0, 90.0, 310.0):
        assert np.abs(decimator(_sine(hertz))).max() < 2e-4
    assert decimator(np.ones(4000))[0] == pytest.approx(1.0, rel=FINITE_DIFFERENCE)


def test_autocorrelation_is_that_of_filtered_white_noise():
    decimator = design_decimator(4)
    n_kept = 100_000
    noise = np.random.default_rng(1).standard_normal(4 * n_kept + 2 * decimator.reach)
    kept = decimator(noise)
    found = np.array([kept[lag:] @ kept[: len(kept) - lag] for lag in range(6)]) / (kept @ kept)
    own = decimator.autocorrelation(5)
    assert own[0] == 1
    assert np.abs(own[1:]).max() > 0.03  # kept samples of this filter are not white
    np.testing.assert_allclose(found, own, atol=4 / np.sqrt(n_kept))
