"""How well responses are known: against the record's own noise, and with lines that were dropped."""

from dataclasses import replace

import numpy as np
import pytest

from robid.frf.quality import dropped_lines, judge, lowest, middle
from sample_reports import arm_fit, synthetic_frf
from tolerances import IDENTITY


@pytest.fixture(scope="module")
def frf():
    """Two outputs of one input, the second ten times smaller, with a standard deviation of 2 %."""
    response = np.ones((2, 5, 2, 1), complex) * np.array([[10.0], [1.0]])
    return synthetic_frf(response, np.linspace(1, 5, 5), np.zeros((2, 1)), 0.02, ("motor",), ("motor", "load"), 1)


def test_uncertainty_is_that_of_the_elements(frf):
    quality = judge(frf)
    expected = np.sqrt(frf.element_variance())[..., 0] / np.abs(frf.response)[..., 0]
    np.testing.assert_allclose(quality.relative_std, expected, rtol=IDENTITY)
    np.testing.assert_array_equal(quality.coherence, frf.coherence)
    unknown = judge(replace(frf, noise_covariance=None))
    assert np.isnan(unknown.signal_to_noise_db).all()


def test_noise_makes_the_signal_to_noise_ratio(frf):
    noisy = replace(frf, noise_covariance=frf.total_covariance / 4, noise_degrees_of_freedom=9.0)
    ratio = noisy.signal_to_noise[..., 0]
    np.testing.assert_allclose(judge(noisy).signal_to_noise_db, 10 * np.log10(ratio), rtol=IDENTITY)


def test_an_output_is_judged_at_the_input_that_moves_it_the_most():
    frf = arm_fit(2, 1, 20).frf
    quality = judge(frf)
    np.testing.assert_array_equal(quality.strongest, np.abs(frf.response).argmax(axis=-1))
    # An input played ten thousand times as strongly is known as much better.
    factor = frf.input_factor.copy()
    factor[..., 2, 2] *= 1e-8
    assert (judge(replace(frf, input_factor=factor)).strongest == 2).all()


def test_dropped_lines_count_nowhere(frf):
    dropped = np.zeros((2, 5, 1), bool)
    dropped[1, 2] = True
    coherence = np.where(dropped, np.nan, frf.coherence)
    gap = replace(frf, dropped=dropped, coherence=coherence)
    assert dropped_lines(gap).nonzero() == ([1], [2], [0])
    assert np.isnan(gap.known_response).sum() == 2
    quality = judge(gap)
    assert np.isnan(quality.relative_std[1, 2]).all()
    assert np.isnan(quality.coherence[1, 2]).all()
    assert np.isfinite(np.delete(quality.relative_std, 2, axis=1)).all()
    assert middle(quality.relative_std) == pytest.approx(np.nanmedian(quality.relative_std))


def test_a_record_that_does_not_tell_is_unknown(frf):
    bare = replace(frf, total_covariance=None, noise_covariance=None, coherence=None, silent_level=None)
    quality = judge(bare)
    for values in (quality.relative_std, quality.coherence, quality.odd, quality.even):
        assert np.isnan(values).all()
    assert np.isnan(middle(quality.coherence))
    assert np.isnan(lowest(quality.coherence))
