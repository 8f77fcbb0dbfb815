"""Errors of measured responses: by coherence against simulated analysers, by neighbours against known noise."""

import numpy as np
import pytest

from robid.logs.responses.variance import coherence_variance, neighbour_variance

RUNS, LINES = 200, 40


def analysed(generator, truth, averages, noise, inputs=1):
    """H1 and multiple coherence of an analyser: spectra of `averages` blocks of normal noise at each line."""
    shape = (LINES, averages)
    given = (generator.normal(size=(2, *shape, inputs)).T @ [1, 1j]).T / np.sqrt(2)
    error = noise * (generator.normal(size=(2, *shape)).T @ [1, 1j]).T / np.sqrt(2)
    measured = (given * truth[:, None]).sum(axis=2) + error
    cross = np.einsum("fa,fai->fi", measured, given.conj())
    auto = np.einsum("fai,faj->fij", given, given.conj())
    response = np.linalg.solve(auto.transpose(0, 2, 1), cross[..., None])[..., 0]
    explained = np.abs(np.einsum("fi,fi->f", response, cross.conj()))
    return response, explained / (np.abs(measured) ** 2).sum(axis=1)


@pytest.mark.parametrize("averages", [8, 16, 32])
@pytest.mark.parametrize("noise", [0.3, 2.0])
def test_variance_by_coherence_is_that_of_simulated_analysers(averages, noise):
    generator = np.random.default_rng(averages)
    truth = np.exp(generator.normal(size=LINES) + 2j * np.pi * generator.uniform(size=LINES))[:, None]
    stated, square = [], []
    for _ in range(RUNS):
        response, coherence = analysed(generator, truth, averages, noise * np.abs(truth))
        stated.append(coherence_variance(response[:, None], coherence[:, None, None], averages)[:, 0, 0])
        square.append(np.abs(response - truth)[:, 0] ** 2)
    ratio = np.mean(np.array(stated) / np.abs(truth[:, 0]) ** 2) / np.mean(np.array(square) / np.abs(truth[:, 0]) ** 2)
    assert ratio == pytest.approx(1.0, abs=0.1)


def test_variance_by_multiple_coherence_of_two_inputs():
    generator, averages = np.random.default_rng(1), 24
    truth = np.array([[1.0, 0.4j]] * LINES)
    stated, square = [], []
    for _ in range(RUNS):
        response, coherence = analysed(generator, truth, averages, np.full((LINES, 1), 0.5), inputs=2)
        stated.append(coherence_variance(response[:, None], coherence[:, None, None], averages, np.ones(2))[:, 0])
        square.append(np.abs(response - truth) ** 2)
    np.testing.assert_allclose(np.mean(stated, axis=(0, 1)) / np.mean(square, axis=(0, 1)), 1.0, atol=0.1)


def test_variance_by_neighbours_is_that_of_the_noise():
    generator = np.random.default_rng(2)
    frequency = np.geomspace(1, 100, 120)
    smooth = (1 / (1 + 1j * frequency / 20))[:, None, None] * np.array([[1.0, 3.0]])
    found = []
    for _ in range(100):
        noise = 0.02 * (generator.normal(size=(2, *smooth.shape)).T @ [1, 1j]).T / np.sqrt(2)
        variance, freedom = neighbour_variance(frequency, smooth + noise)
        found.append(variance)
    assert freedom == 4
    assert np.mean(found) == pytest.approx(0.02**2, rel=0.05)
    # A parabola has no scatter at all.
    variance, _ = neighbour_variance(frequency, (np.log(frequency) ** 2 * (1 + 2j))[:, None, None])
    np.testing.assert_allclose(variance, 0.0, atol=1e-20)
