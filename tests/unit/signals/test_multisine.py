"""Orthogonality, RMS and spectrum of multisines; the crest reduction's gradient and its result."""

import numpy as np
import pytest
from scipy.optimize import check_grad

from robid.signals.multisine import (
    _BlockNorm,
    crest_factor,
    multisine,
    orthogonal_matrix,
    reduce_crest,
    time_signal,
)

LINES = np.array([11, 13, 15, 17, 21, 25, 31, 37, 45, 55, 67, 81])


@pytest.mark.parametrize("size", [1, 2, 3, 6])
def test_orthogonal_matrix_is_orthogonal(size):
    matrix = orthogonal_matrix(size)
    np.testing.assert_allclose(matrix @ matrix.conj().T, size * np.eye(size), atol=1e-12)
    np.testing.assert_allclose(np.abs(matrix), 1.0, rtol=1e-12)


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


def test_time_signal_is_the_sum_of_cosines_and_obeys_parseval():
    generator = np.random.default_rng(2)
    spectrum = generator.normal(size=(len(LINES), 1)) + 1j * generator.normal(size=(len(LINES), 1))
    signal = time_signal(spectrum, LINES, 400)
    sample = np.arange(400)
    direct = np.real(np.exp(2j * np.pi * np.outer(sample, LINES) / 400) @ spectrum)
    np.testing.assert_allclose(signal, direct, atol=1e-12)
    np.testing.assert_allclose(np.mean(signal**2), np.sum(np.abs(spectrum) ** 2) / 2, rtol=1e-12)


@pytest.mark.parametrize("lines", [LINES, np.array([3, 4, 8, 9, 14])], ids=["odd", "full"])
def test_gradient_and_peak_of_the_block_norm(lines):
    generator = np.random.default_rng(3)
    phases = generator.uniform(0, 6, len(lines))
    shifts = 2 * np.pi * 2 * np.arange(6) / 6
    amplitudes = generator.uniform(0.5, 2, len(lines))
    norm = _BlockNorm(amplitudes, lines, shifts)
    error = check_grad(lambda x: norm(x, 6)[0], lambda x: norm(x, 6)[1], phases, epsilon=1e-7)
    assert error < 1e-5 * np.linalg.norm(norm(phases, 6)[1])
    copies = amplitudes * np.exp(1j * (phases + shifts[:, None]))
    fine = time_signal(copies[:, :, None], lines, 16384)
    assert norm.peak(phases) == pytest.approx(crest_factor(fine).max(), rel=0.03)


@pytest.mark.parametrize(("motor", "bound"), [(0, 1.8), (1, 2.0), (3, 1.8)])
def test_crest_factor_of_the_whole_block_falls(motor, bound):
    lines = np.unique(2 * (np.geomspace(11, 399, 60) // 2).astype(int) + 1)
    amplitudes = np.full(len(lines), 1.0)
    shifts = 2 * np.pi * motor * np.arange(6) / 6
    start = np.random.default_rng(4).uniform(0, 2 * np.pi, len(lines))

    def crest(phases):
        return crest_factor(time_signal(np.exp(1j * (phases + shifts[:, None]))[:, :, None], lines, 5000)).max()

    best = reduce_crest(start, amplitudes, lines, shifts, iterations=60)
    assert crest(start) > 2.5
    assert crest(best) < bound


def test_no_iterations_keep_the_random_phases():
    start = np.random.default_rng(5).uniform(0, 6, len(LINES))
    np.testing.assert_array_equal(reduce_crest(start, np.ones(len(LINES)), LINES, np.zeros(1), iterations=0), start)
