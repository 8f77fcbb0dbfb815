"""Numbers, grid, band, spread and refusals of the excited and detection lines."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robid.design.excitation.lines import choose_lines
from robid.design.excitation.options import MultisineOptions
from robid.errors import SettingsError


def test_default_lines_are_odd_in_band_and_as_many_as_asked():
    options = MultisineOptions()
    excited, detection = choose_lines(options, 1e-3)
    both = np.sort(np.concatenate([excited, detection]))
    assert len(excited) == options.count
    assert len(detection) == 7
    assert np.all(both % 2 == 1)
    assert len(np.unique(both)) == len(both)
    assert both[0] >= options.low_hz * options.period_s
    assert both[-1] <= options.high_hz * options.period_s


def test_log_spacing_is_consecutive_below_the_grid_and_geometric_above():
    excited, _ = choose_lines(MultisineOptions(detection_share=0.0), 1e-3)
    assert np.all(np.diff(excited[:8]) == 2)
    ratio = excited[1:] / excited[:-1]
    assert ratio[-10:].std() < 0.02
    assert excited[0] == 11
    assert excited[-1] == 399


def test_detection_lines_spread_over_the_band():
    excited, detection = choose_lines(MultisineOptions(), 1e-3)
    position = np.searchsorted(np.sort(np.concatenate([excited, detection])), detection)
    assert np.all(np.diff(position) <= 2 * 10)
    assert position[0] < 10
    assert position[-1] > 67 - 11
    assert excited[0] < detection[0]
    assert excited[-1] > detection[-1]


def test_detection_lines_follow_the_seed():
    first, second = (choose_lines(MultisineOptions(seed=seed), 1e-3)[1] for seed in (1, 2))
    again = choose_lines(MultisineOptions(seed=1), 1e-3)[1]
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, second)


def test_a_full_grid_takes_every_line_of_the_band():
    band = {"period_s": 1, "low_hz": 11, "high_hz": 250, "count": 240}
    options = MultisineOptions(**band, spacing="linear", grid="full", detection_share=0.0)
    excited, detection = choose_lines(options, 4e-4)
    np.testing.assert_array_equal(excited, np.arange(11, 251))
    assert len(detection) == 0


@given(
    count=st.integers(1, 60),
    share=st.floats(0, 0.4),
    spacing=st.sampled_from(["log", "linear"]),
    seed=st.integers(0, 100),
)
def test_any_count_that_fits_comes_out_exactly(count, share, spacing, seed):
    options = MultisineOptions(count=count, detection_share=share, spacing=spacing, seed=seed)
    excited, detection = choose_lines(options, 1e-3)
    both = np.concatenate([excited, detection])
    assert len(excited) == count
    assert len(np.unique(both)) == len(both)
    assert np.all(both % 2 == 1)
    assert both.min() >= 10
    assert both.max() <= 400
    assert (len(detection) > 0) == (share > 0)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"high_hz": 600.0}, ["Nyquist", "500"]),
        ({"low_hz": 90.0}, ["low_hz", "not below"]),
        ({"count": 300}, ["300 excited", "195 odd lines", "lengthen the period"]),
        ({"period_s": 5.00037}, ["whole number", "5 s"]),
        ({"high_hz": 600.0, "count": 3000}, ["Nyquist", "3000 excited"]),
    ],
)
def test_impossible_lines_are_refused_with_every_reason(changes, words):
    with pytest.raises(SettingsError) as caught:
        choose_lines(MultisineOptions(**changes), 1e-3)
    for word in words:
        assert word in str(caught.value)
    assert caught.value.remedy


@pytest.mark.parametrize(
    ("period_s", "count", "low_hz", "high_hz"), [(4, 300, 2, 80), (0.7, 97, 3.3, 91.7), (1, 11, 5, 9)]
)
def test_a_period_that_is_advised_holds_the_lines(period_s, count, low_hz, high_hz):
    options = MultisineOptions(period_s=period_s, count=count, low_hz=low_hz, high_hz=high_hz)
    with pytest.raises(SettingsError) as error:
        choose_lines(options, 1e-3)
    advised = float(re.search(r"lengthen the period to ([\d.e-]+) s", error.value.what)[1])
    excited, _ = choose_lines(replace(options, period_s=advised), 1e-3)
    assert len(excited) == count
