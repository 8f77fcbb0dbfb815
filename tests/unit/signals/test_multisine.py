"""Orthogonality, RMS and spectrum of multisines, against SciPy and the package `multisine` too."""

import numpy as np
import pytest
from scipy.signal import periodogram

from robid.signals.waveforms import crest_factor, multisine, orthogonal_matrix, time_signal

LINES = np.array([11, 13, 15, 17, 21, 25, 31, 37, 45, 55, 67, 81])


@pytest.mark.parametrize("size", range(1, 10))
def test_orthogonal_matrix_is_orthogonal(size):
    matrix = orthogonal_matrix(size)
    np.testing.assert_allclose(matrix @ matrix.conj().T, size * np.eye(size), atol=1e-12)
    np.testing.assert_allclose(np.abs(matrix), 1.0, rtol=1e-12)


@pytest.mark.parametrize(("size", "count"), [(1, 1), (2, 1), (3, 3), (4, 1), (6, 2), (7, 7), (8, 1)])
def test_signals_of_a_block_differ_as_little_as_they_can(size, count):
    angles = np.round(np.mod(np.angle(orthogonal_matrix(size)), np.pi), 9) % np.round(np.pi, 9)
    assert max(len(np.unique(row)) for row in angles) == count


def test_spectra_are_the_diagonal_times_the_orthogonal_matrix():
    generator = np.random.default_rng(1)
    amplitude = generator.uniform(0.5, 2, (3, 4))
    phase = generator.uniform(0, 6, (2, 3, 4))
    spectrum = multisine(amplitude, phase)
    assert spectrum.shape == (2, 3, 4, 3)
    for realization in range(2):
        for line in range(4):
            by_experiment = spectrum[realization, :, line, :].T
            diagonal = np.diag(amplitude[:, line] * np.exp(1j * phase[realization, :, line]))
            np.testing.assert_allclose(by_experiment, diagonal @ orthogonal_matrix(3), rtol=1e-12)
            gram = by_experiment @ by_experiment.conj().T
            np.testing.assert_allclose(gram, 3 * np.diag(amplitude[:, line] ** 2), atol=1e-12)


@pytest.mark.parametrize("size", [2, 3, 6])
def test_turned_experiments_stay_orthogonal_and_none_repeats(size):
    generator = np.random.default_rng(2)
    phase, turn = generator.uniform(0, 6, (2, 2, size, 9))
    spectrum = multisine(np.ones((size, 9)), phase, turn)
    block = np.moveaxis(spectrum, 1, -1)
    gram = block @ np.swapaxes(block, -1, -2).conj()
    np.testing.assert_allclose(gram, np.broadcast_to(size * np.eye(size), gram.shape), atol=1e-12)
    signals = np.swapaxes(spectrum, 2, 3).reshape(2, -1, size, 9)
    alike = np.abs(np.einsum("reik,rfik->rief", signals, signals.conj())) / 9
    assert alike[..., ~np.eye(size, dtype=bool)].max() < 0.95


def test_time_signal_is_the_sum_of_cosines_and_obeys_parseval():
    generator = np.random.default_rng(2)
    spectrum = generator.normal(size=(len(LINES), 1)) + 1j * generator.normal(size=(len(LINES), 1))
    signal = time_signal(spectrum, LINES, 400)
    sample = np.arange(400)
    direct = np.real(np.exp(2j * np.pi * np.outer(sample, LINES) / 400) @ spectrum)
    np.testing.assert_allclose(signal, direct, atol=1e-12)
    np.testing.assert_allclose(np.mean(signal**2), np.sum(np.abs(spectrum) ** 2) / 2, rtol=1e-12)


def test_multisine_has_the_power_spectrum_of_an_independent_estimate():
    amplitude = np.random.default_rng(6).uniform(0.5, 2, (1, len(LINES)))
    phase = np.random.default_rng(7).uniform(0, 6, (1, 1, len(LINES)))
    signal = time_signal(multisine(amplitude, phase), LINES, 400)[0, 0, :, 0]
    line, power = periodogram(signal, fs=400, scaling="spectrum", detrend=False)
    expected = np.zeros(201)
    expected[LINES] = amplitude[0] ** 2 / 2
    np.testing.assert_array_equal(line, np.arange(201))
    np.testing.assert_allclose(power, expected, atol=1e-12)
    assert crest_factor(signal[:, None])[0] == pytest.approx(np.abs(signal).max() / np.sqrt(power.sum()), rel=1e-12)


@pytest.mark.parametrize("size", [1, 2, 3, 6])
def test_multisine_agrees_with_the_package_of_that_name(size):
    other = pytest.importorskip("multisine")
    options = {"n_samples": 500, "fs": 500, "f_min": 11, "f_max": 90}
    theirs = other.random_phase_orthogonal_multisine(
        **options, nu=size, amplitude=3.0, independent_subexperiments=False
    )
    lines = np.asarray(theirs.freq.excited_bins)
    signal = theirs.u.reshape(500, size, -1).transpose(2, 0, 1)
    spectrum = np.fft.rfft(signal, axis=1)[:, lines] / 250
    phase = np.angle(spectrum[0] / orthogonal_matrix(size)[:, 0]).T
    ours = multisine(np.full((size, len(lines)), 3 * np.sqrt(2 / len(lines))), phase[None])[0]
    np.testing.assert_allclose(np.abs(ours), np.abs(spectrum), rtol=1e-10)
    for block in (ours, spectrum):
        gram = np.einsum("eki,ekj->kij", block, block.conj())
        np.testing.assert_allclose(gram, np.broadcast_to(size * 18 / len(lines) * np.eye(size), gram.shape), atol=1e-12)
    first = time_signal(ours, lines, 500)[0]
    np.testing.assert_allclose(first, signal[0], atol=1e-12)
    rms = np.sqrt(np.mean(signal[0] ** 2, axis=0))
    np.testing.assert_allclose(crest_factor(first), np.abs(signal[0]).max(axis=0) / rms, rtol=1e-10)
