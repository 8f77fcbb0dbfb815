"""What lines, realizations and repeats scatter, against closed forms."""

import numpy as np
import pytest
from scipy.stats import norm, t

from robid.frf.local_model import (
    LINE_SCATTER_FREEDOM,
    half_width,
    jackknife_variance,
    leaving_out,
    line_scatter,
    rational_mode,
)

HZ = np.arange(20.0, 220.0)


def swinging(hz, at=75.3, damping=0.02):
    s = 2j * np.pi * hz
    natural = 2 * np.pi * at
    return (3 * s**2 + 0.7 * (3 * natural) ** 2) / (s**2 + 2 * damping * natural * s + natural**2)


def noisy(curve, relative, seed=0):
    generator = np.random.default_rng(seed)
    noise = (generator.standard_normal(curve.shape) + 1j * generator.standard_normal(curve.shape)) / np.sqrt(2)
    return curve * (1 + relative * noise)


def element(curve):
    return curve[None, :, None, None]


def test_scatter_of_lines_is_that_of_their_noise():
    found = [line_scatter(element(noisy(swinging(HZ), 0.05, seed)), element(swinging(HZ))) for seed in range(50)]
    assert np.sqrt(np.mean(found)) == pytest.approx(0.05, rel=0.05)


def test_scatter_of_lines_has_the_freedom_that_it_says():
    """The variance of a chi-squared quotient is two over its degrees of freedom."""
    clean = element(swinging(HZ))
    found = np.array([line_scatter(element(noisy(swinging(HZ), 0.05, seed)), clean)[0, 100] for seed in range(400)])
    assert 2 / (found.std() / found.mean()) ** 2 == pytest.approx(LINE_SCATTER_FREEDOM, rel=0.3)


def test_a_model_that_has_one_resonance_elsewhere_scatters_little():
    off = line_scatter(element(noisy(swinging(HZ), 0.01)), element(swinging(HZ, at=74.3)))
    assert np.sqrt(np.median(off)) < 0.015
    assert line_scatter(element(swinging(HZ)), element(2 * swinging(HZ))).max() < 1e-20


def test_two_lines_say_nothing_of_scatter():
    two = element(swinging(HZ[:2]))
    assert not line_scatter(two, two).any()


def test_leaving_out_gives_the_variance_of_a_mean():
    sample = np.random.default_rng(1).standard_normal(9)
    left_out = (sample.sum() - sample) / 8
    assert float(jackknife_variance(left_out)) == pytest.approx(sample.var(ddof=1) / 9)


def test_realizations_whose_resonance_moved_scatter_as_far_as_it_moved():
    places = 75.3 + np.array([-0.4, 0.1, 0.5, -0.2])
    each = np.array([swinging(HZ, at) for at in places])
    errors = (each - each.mean(axis=0)) / len(each)
    found = leaving_out(
        rational_mode,
        HZ,
        each.mean(axis=0),
        np.zeros(HZ.size),
        errors,
        int(np.abs(each.mean(axis=0)).argmax()),
        "resonance",
    )
    assert found.shape == (4, 2)
    deviation = np.sqrt(jackknife_variance(found))
    np.testing.assert_allclose(deviation, places.std(ddof=1) / np.sqrt(4), rtol=0.2)


def test_the_larger_variance_decides_and_few_realizations_widen():
    assert half_width((4.0, np.inf), (), 0.95) == pytest.approx(2 * norm.ppf(0.975))
    assert half_width((4.0, np.inf), [(1e-9, 1.0)], 0.95) == pytest.approx(2 * norm.ppf(0.975), rel=1e-6)
    assert half_width((1e-9, np.inf), [(4.0, 1.0)], 0.95) == pytest.approx(2 * t.ppf(0.975, 1), rel=1e-6)
    both = half_width((4.0, np.inf), [(4.0, 1.0)], 0.95)
    assert 2 * norm.ppf(0.975) < both < 2 * t.ppf(0.975, 3)
    assert half_width((0.0, np.inf), (), 0.95) == 0.0
