"""Distortion and coherence of a closed loop whose nonlinearity and noise are known."""

from dataclasses import replace

import numpy as np
import pytest

from closed_loops import ALL, EXCITED, N_SAMPLE, OMEGA, PERIOD_S, SPEED_GAIN, linear_response, loop_record
from robid.frf.distortion import interpolate_response, silent_levels, silent_lines
from robid.frf.estimate import estimate_frf
from robid.frf.options import EstimateOptions
from robid.frf.spectra import Blocks

PLAIN = EstimateOptions(compensation="none", pooled_lines=1)


def predicted_level(motion, power, strength):
    """RMS of `G D` at all lines, D by convolving the two-sided spectra of the undisturbed motion."""
    two_sided = np.zeros((*motion.shape[:2], 2 * ALL.size + 1, 2), complex)
    two_sided[:, :, ALL.size + ALL] = motion
    two_sided[:, :, ALL.size - ALL] = motion.conj()
    torque = np.zeros_like(motion)
    for index in np.ndindex(*motion.shape[:2]):
        for motor in range(2):
            line = two_sided[(*index, slice(None), motor)]
            product = line
            for _ in range(power - 1):
                product = np.convolve(product, line)
            middle = product.size // 2
            torque[(*index, slice(None), motor)] = strength * product[middle + ALL]
    residual = np.einsum("kij,rekj->reki", linear_response(), torque)
    return np.sqrt((np.abs(residual) ** 2).mean(axis=(0, 1)))


@pytest.mark.parametrize(("kind", "power", "parity"), [("cubic", 3, 1), ("quadratic", 2, 0)])
def test_nonlinearity_shows_at_lines_of_its_parity_with_its_level(kind, power, parity):
    strength = {"cubic": 3.0, "quadratic": 1.0}[kind]
    record, motion = loop_record(**{kind: strength})
    frf = estimate_frf(record, PLAIN)
    np.testing.assert_array_equal(frf.silent_lines, silent_lines(EXCITED))
    expected = predicted_level(motion, power, strength)[frf.silent_lines - 1]
    shows = frf.silent_lines % 2 == parity
    np.testing.assert_allclose(frf.silent_level[0, shows], expected[shows], rtol=0.02)
    assert frf.silent_level[0, ~shows].max() < 1e-2 * np.median(frf.silent_level[0, shows])
    assert (frf.silent_interpolation[0, shows] < frf.silent_level[0, shows]).all()
    lines = frf.silent_lines[shows]
    raw = np.fft.rfft(record.outputs[0, :, :, 0], axis=-2, norm="forward")[..., lines, :]
    raw = np.sqrt((np.abs(raw) ** 2).mean(axis=(0, 1))) * OMEGA[lines - 1, None] ** 2
    assert np.median(np.abs(raw / expected[shows] - 1)) > 0.25  # without the correction for feedback


def test_linear_loop_shows_its_noise_and_nothing_else():
    noise, periods = 1e-5, 2
    record, _ = loop_record(noise=noise, realizations=30, periods=periods)
    frf = estimate_frf(record, PLAIN)
    known = noise / np.sqrt(N_SAMPLE * periods) * (2 * np.pi * frf.silent_lines / PERIOD_S)[:, None] ** 2
    # 60 experiments: an RMS deviates by 1 / (2 sqrt(60)).
    for level in (frf.silent_level[0], frf.silent_noise[0]):
        np.testing.assert_allclose(level / known, 1, atol=4 / (2 * np.sqrt(60)))
        np.testing.assert_allclose((level / known).mean(), 1, atol=0.02)


def test_distortion_in_the_unit_of_the_response_is_its_scatter():
    record, _ = loop_record(cubic=100.0, realizations=12)
    frf = estimate_frf(record, PLAIN)
    ratio = frf.response_level("odd") / np.sqrt(frf.element_variance())
    # What odd lines left out show is what the excited ones suffer, up to terms that follow the input's phase.
    assert 0.4 < np.median(ratio) < 1.6
    assert np.median(frf.response_level("even")) < 1e-6 * np.median(frf.response_level("odd"))


def test_coherence_is_the_share_of_power_that_noise_leaves():
    noise = 3e-5
    record, motion = loop_record(noise=noise, realizations=40, periods=1)
    lines = EXCITED - 1
    power = (np.abs(motion * (1j * OMEGA[:, None])) ** 2).mean(axis=(0, 1))[lines]
    lost = noise**2 / N_SAMPLE * OMEGA[lines, None] ** 4
    frf = estimate_frf(record, PLAIN)
    sensitivity = np.linalg.inv(np.eye(2) + linear_response() @ SPEED_GAIN / (1j * OMEGA[:, None, None]))[lines]
    measured = power + np.einsum("kij,kj->ki", np.abs(sensitivity) ** 2, lost)
    np.testing.assert_allclose(1 - frf.coherence[0], lost / measured, rtol=0.5)
    np.testing.assert_allclose(((1 - frf.coherence[0]) / (lost / measured)).mean(), 1, atol=0.05)


def test_coherence_without_realizations_comes_from_periods():
    record, _ = loop_record(noise=3e-5, realizations=1, periods=8)
    many, _ = loop_record(noise=3e-5, realizations=8, periods=8)
    single, whole = (estimate_frf(one, PLAIN).coherence for one in (record, many))
    np.testing.assert_allclose((1 - single).mean(), (1 - whole).mean(), rtol=0.2)
    assert np.isnan(estimate_frf(loop_record(realizations=1, periods=1)[0], PLAIN).coherence).all()


def test_a_full_grid_has_no_silent_lines():
    record, _ = loop_record(noise=1e-5)  # which excites every line a little
    few = replace(record, excited_lines=np.array([3, 5]), detection_lines=np.zeros(0, int))
    frf = estimate_frf(replace(few, excited_lines=np.array([4, 5])), replace(PLAIN, weak_line_std=1e9))
    assert frf.silent_lines.size == 0
    assert frf.silent_level.shape == (1, 0, 2)
    assert frf.response_level("odd") is None
    assert any("Every line of the band is excited" in note for note in frf.notes)
    assert estimate_frf(few, PLAIN).silent_lines.tolist() == [4]
    mixed = estimate_frf(replace(few, excited_lines=np.array([3, 6])), replace(PLAIN, weak_line_std=1e9))
    assert any("does not tell odd from even" in note for note in mixed.notes)


def test_doubt_bounds_the_interpolation_where_a_resonance_hides_between_lines():
    sparse = np.arange(3, 60, 8)
    wanted = silent_lines(sparse)
    s = 2j * np.pi * np.arange(1, 60)[:, None, None] / PERIOD_S
    response = 1 + s**2 / (s**2 + 6.0 * s + 70.0**2)
    nothing = np.zeros((1, 0, wanted.size, 1, 1), complex)
    torque = np.ones((1, wanted.size, 1, 1), complex)
    silent = Blocks(wanted, torque, response[None, wanted - 1], None, nothing, nothing, 0)
    levels = silent_levels(silent, sparse, response[sparse - 1])
    hidden = levels.level > 0.05  # all of it is interpolation error: torque and response are exact
    assert hidden.sum() > 3
    assert (levels.interpolation[hidden] > 0.3 * levels.level[hidden]).all()
    assert levels.noise is None
    found = interpolate_response(sparse, response[sparse - 1], sparse)
    np.testing.assert_allclose(found, response[sparse - 1], rtol=1e-12)


def test_signal_to_noise_is_that_of_each_element():
    frf = estimate_frf(loop_record(noise=1e-5)[0], PLAIN)
    expected = np.abs(frf.response) ** 2 / frf.element_variance(noise_only=True)
    np.testing.assert_allclose(frf.signal_to_noise, expected)
    assert replace(frf, noise_covariance=None).signal_to_noise is None
    silent = replace(frf, noise_covariance=0 * frf.noise_covariance).signal_to_noise
    assert np.all(np.isfinite(silent))
    assert silent.min() > 1e200
