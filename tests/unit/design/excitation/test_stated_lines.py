"""Lines that are stated one by one, or all of a band; and a band without lines."""

import numpy as np
import pytest

from robid.design.excitation.lines import check_signal, choose_lines, period_samples, signal_lines
from robid.design.excitation.options import ArbitraryOptions, MultisineOptions
from robid.errors import SettingsError

STEP_S = 1e-3


@pytest.mark.parametrize(
    ("stated", "wanted"),
    [
        ({"lines": (3, 4, 11, 250)}, [3, 4, 11, 250]),
        ({"lines": "all", "low_hz": 2, "high_hz": 6, "grid": "full"}, range(4, 13)),
        ({"lines": "found", "low_hz": 2, "high_hz": 6}, range(5, 12, 2)),
    ],
)
def test_lines_are_those_that_were_stated(stated, wanted):
    excited, detection = choose_lines(MultisineOptions(period_s=2, **stated), STEP_S)
    np.testing.assert_array_equal(excited, list(wanted))
    assert detection.size == 0


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        ({"lines": (3, 1000)}, "within 1 to 999"),
        ({"lines": (0, 3)}, "within 1 to 999"),
        ({"lines": ()}, "within 1 to 999"),
        ({"lines": (5, 3)}, "must rise"),
        ({"lines": (3, 3)}, "must rise"),
        ({"lines": "all", "low_hz": 2.1, "high_hz": 2.2}, "no line of a 2 s period lies in the band"),
        ({"lines": "all", "low_hz": 2, "high_hz": 600}, "not below the Nyquist frequency 500 Hz"),
    ],
)
def test_lines_that_cannot_be_are_refused(stated, said):
    with pytest.raises(SettingsError, match=said):
        check_signal(MultisineOptions(period_s=2, **stated), STEP_S)


def test_a_band_has_frequencies_a_resolution_apart():
    options = ArbitraryOptions(low_hz=3, high_hz=60, resolution_hz=0.7)
    check_signal(options, STEP_S)
    lines, _ = signal_lines(options, STEP_S)
    frequency = lines / (period_samples(options, STEP_S) * STEP_S)
    assert frequency.min() >= 3
    assert frequency.max() <= 60
    np.testing.assert_allclose(np.diff(frequency), 0.7, rtol=1e-3)


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        ({"low_hz": 60, "high_hz": 3}, "swap them"),
        ({"resolution_hz": 30}, r"lower resolution_hz to 14\.2"),
        ({"high_hz": 499.9}, "lower high_hz"),
    ],
)
def test_a_band_that_cannot_be_is_refused(stated, said):
    options = ArbitraryOptions(**{"low_hz": 3, "high_hz": 60, "resolution_hz": 0.5} | stated)
    with pytest.raises(SettingsError, match=said):
        check_signal(options, STEP_S)
