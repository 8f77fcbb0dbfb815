"""Chirps, stepped sines, resting Fourier series and slow motions against what defines them."""

import numpy as np
import pytest
from scipy.signal import chirp as scipy_chirp

from robid.signals.waveforms import chirp, orthogonal_matrix, resting_series, slow_motion, stepped_sine, whole_cycles
from tolerances import IDENTITY

N_SAMPLE = 4000


@pytest.mark.parametrize("peak", [0.0, 0.25, 0.5])
def test_a_chirp_is_scipys_with_a_triangle_on_it(peak):
    time = np.arange(N_SAMPLE)
    triangle = np.interp(time, [0, peak * N_SAMPLE, N_SAMPLE], [0, 1, 0]) if peak else 1 - time / N_SAMPLE
    wave = scipy_chirp(time, 0.002, N_SAMPLE, 0.08, phi=-90)
    np.testing.assert_allclose(chirp(0.002, 0.08, N_SAMPLE, peak=peak), triangle * wave, atol=1e-9)


def test_a_stepped_sine_dwells_whole_cycles_on_every_frequency():
    frequency = np.geomspace(0.002, 0.05, 12)
    count = whole_cycles(frequency, N_SAMPLE)
    assert count.min() >= 1
    assert N_SAMPLE - 1 / frequency[-1] < np.sum(count / frequency) <= N_SAMPLE
    signal = stepped_sine(frequency, N_SAMPLE)
    stretch = np.sum(count / frequency) / N_SAMPLE
    assert stretch > 1 - 1 / frequency[-1] / N_SAMPLE
    begin = 0.0
    for cycles, value in zip(count, frequency * stretch, strict=True):
        inside = np.arange(int(np.ceil(begin)), int(begin + cycles / value))
        np.testing.assert_allclose(signal[inside], np.sin(2 * np.pi * value * (inside - begin)), atol=1e-7)
        begin += cycles / value
    assert begin == pytest.approx(N_SAMPLE)
    assert np.abs(np.diff(signal)).max() <= 2 * np.pi * frequency[-1]


def test_a_stepped_sine_needs_a_cycle_of_each():
    with pytest.raises(ValueError, match="one cycle of each"):
        whole_cycles(np.array([0.001, 0.002]), 1499)
    np.testing.assert_array_equal(whole_cycles(np.array([0.001, 0.002]), 1500), [1, 1])


@pytest.mark.parametrize("orders", [(-1, 0, 1), (0, 1, 2), (0, 1)])
@pytest.mark.parametrize("lines", [np.arange(1, 6), np.array([1, 3, 5, 9, 15, 21, 41])])
def test_a_resting_series_and_its_copies_begin_at_rest(lines, orders):
    generator = np.random.default_rng(2)
    start = 3.0 * np.exp(2j * np.pi * generator.uniform(size=(2, 3, len(lines))))
    series = resting_series(start, lines, orders)
    copies = np.einsum("rik,ie->reik", series, orthogonal_matrix(3))
    for order in orders:
        terms = (1j * lines) ** float(order) * copies
        assert np.abs(terms.sum(axis=-1).real).max() < 1e-10 * np.abs(terms).max()
    assert np.abs(series).max() <= 3.0 * np.sqrt(len(lines))
    if len(lines) > 2 * len(orders):
        assert np.abs(series).min() > 0.5
    with pytest.raises(ValueError, match="need more than"):
        resting_series(start[..., : len(orders)], lines[: len(orders)], orders)


def test_a_slow_motion_has_one_line_and_its_motors_never_stop_together():
    signal = slow_motion(7.0, 4, 2, 3, N_SAMPLE, np.random.default_rng(1))
    spectrum = np.abs(np.fft.rfft(signal, axis=2)) * 2 / N_SAMPLE
    np.testing.assert_allclose(spectrum[:, :, 4], 7.0, rtol=IDENTITY)
    assert np.delete(spectrum, 4, axis=2).max() < 1e-9
    slow = np.sum(np.abs(signal) < 7.0 * np.sin(np.pi / 6) * 0.999, axis=-1)
    assert slow.max() == 1
    assert np.abs(signal[0] - signal[1]).max() > 1.0
    assert np.abs(signal[:, 0] - signal[:, 1]).max() > 1.0
