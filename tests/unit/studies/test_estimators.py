import numpy as np
import pytest

from robid.studies.frf.study import elements, error_ratio, scatter

SHAPE = (2, 400, 3, 2, 2)


def drawn(std, bias=0.0, seed=1):
    """Estimates of a known response with a known spread (relative to 1) and a known bias."""
    generator = np.random.default_rng(seed)
    reference = np.exp(1j * generator.uniform(0, 2 * np.pi, (SHAPE[0], *SHAPE[2:]))) * 5
    noise = (generator.standard_normal(SHAPE) + 1j * generator.standard_normal(SHAPE)) / np.sqrt(2)
    return 5 * std * noise + reference[:, None] * (1 + bias), reference


def test_error_bias_and_ratio_are_those_of_the_draw():
    estimates, reference = drawn(0.03, bias=0.04)
    found = scatter(estimates, np.full(SHAPE, (5 * 0.06) ** 2), reference)
    assert found.error.shape == reference.shape
    np.testing.assert_allclose(found.error, 0.05, rtol=0.1)
    np.testing.assert_allclose(found.bias, 0.04, rtol=0.15)
    np.testing.assert_allclose(found.std_ratio, 2.0, rtol=0.15)


def test_refused_estimates_are_left_out():
    estimates, reference = drawn(0.03)
    kept = scatter(estimates[:, ::2], np.ones_like(estimates[:, ::2], float), reference)
    estimates[:, 1::2] = np.nan
    variance = np.where(np.isnan(estimates), np.nan, 1.0)
    found = scatter(estimates, variance, reference)
    for name in ("error", "bias", "std_ratio"):
        np.testing.assert_allclose(getattr(found, name), getattr(kept, name), rtol=1e-10)
    estimates[:, 1:] = np.nan
    assert np.isnan(scatter(estimates, variance, reference).error).all()


def test_twice_the_noise_is_twice_the_error():
    quiet, reference = drawn(0.03)
    loud, _ = drawn(0.06)
    ratio, lower, upper = error_ratio(loud, quiet, reference)
    assert ratio == pytest.approx(2, rel=1e-10)
    other, _ = drawn(0.06, seed=2)
    ratio, lower, upper = error_ratio(other - drawn(0, seed=2)[1][:, None] + reference[:, None], quiet, reference)
    assert 1.7 < lower < ratio < upper < 2.3
    assert error_ratio(quiet, quiet, reference) == (1, 1, 1)
    assert np.isnan(error_ratio(np.full(SHAPE, np.nan + 0j), quiet, reference)).all()


def test_elements_on_and_off_the_diagonal():
    values = np.array([[[1, 2, 3], [4, 5, 6]]])
    assert elements(values, diagonal=True).tolist() == [[1, 5]]
    assert elements(values, diagonal=False).tolist() == [[2, 3, 4, 6]]
