"""Degrees of freedom of a block's covariance: what the experiments repeat does not count twice."""

import numpy as np
import pytest

from realizations import complex_normal
from robid.frf.covariance import distinct_experiments, freedom_share, total_covariance
from robid.signals.waveforms import multisine

N_REAL, N_FREQ = 4, 60


def signals(size, *, random, seed=0):
    """Reference spectra (n_real, n_freq, n_motor, n_exp) of a design."""
    generator = np.random.default_rng(seed)
    phase, turn = generator.uniform(0, 2 * np.pi, (2, N_REAL, size, N_FREQ))
    return multisine(np.ones((size, N_FREQ)), phase, turn if random else None).transpose(0, 2, 3, 1)


def friction(played):
    """The cube of each motor's signal at the same lines: an odd law without memory."""
    n_real, n_freq, size, n_exp = played.shape
    full = np.zeros((n_real, 8 * n_freq, size, n_exp), complex)
    full[:, 1 : 2 * n_freq : 2] = played
    cube = np.fft.fft(np.fft.ifft(full, axis=1).real ** 3, axis=1)
    return cube[:, 1 : 2 * n_freq : 2] * 1e4


def residual(played, output):
    """What is left of outputs once one response serves all realizations."""
    response = (output @ np.linalg.inv(played)).mean(axis=0)
    return output - response @ played


@pytest.mark.parametrize("size", [1, 2, 3, 6])
def test_noise_keeps_all_experiments(size):
    for seed in range(5):
        played = signals(size, random=False, seed=seed)
        left = residual(played, complex_normal(np.random.default_rng([3, seed]), played.shape))
        assert distinct_experiments(left) == size
        assert freedom_share(left, total_covariance(left, size, 3)[1]) == 1


@pytest.mark.parametrize("size", [2, 4])
def test_friction_of_signals_that_repeat_counts_once(size):
    """Hadamard's signs leave each motor one signal and one friction in all experiments of a block."""
    played = signals(size, random=False)
    left = residual(played, friction(played))
    np.testing.assert_allclose(distinct_experiments(left), 1.0, rtol=1e-6)
    np.testing.assert_allclose(freedom_share(left, 100.0), 1 / size)


@pytest.mark.parametrize("size", [2, 3, 6])
def test_random_phases_of_experiments_make_friction_count_again(size):
    plain, turned = (signals(size, random=random) for random in (False, True))
    assert distinct_experiments(residual(plain, friction(plain))) < 0.5 * size + 1e-6
    assert distinct_experiments(residual(turned, friction(turned))) > 0.85 * size


def test_stated_freedom_is_that_of_the_scatter():
    """A variance with nu complex degrees of freedom scatters by 1 / sqrt(nu) of itself."""
    size, variances, stated = 6, [], []
    for seed in range(60):
        played = signals(size, random=False, seed=seed)
        left = residual(played, friction(played))
        covariance, freedom = total_covariance(left, size, 1)
        variances.append(np.real(np.diagonal(covariance, axis1=1, axis2=2)))
        stated.append(freedom * freedom_share(left, freedom))
    variances = np.array(variances)
    scatter = np.var(variances, axis=0, ddof=1) / np.mean(variances, axis=0) ** 2
    found = 1 / scatter.mean()
    # 18 are counted; the scatter of 60 draws at 60 lines that share a distortion is known to some 20 %.
    np.testing.assert_allclose(np.mean(stated), found, rtol=0.35)
