"""Angles and counters that start again are told from those that jump or move fast."""

import numpy as np
import pytest

from robid.logs.inspection.quality import find_wrap, unwrapped

TIME = 1e-3 * np.arange(6000)
RNG = np.random.default_rng(4)
SLOW = 300 * TIME + 5 * np.sin(2 * np.pi * 7 * TIME)
HOP = np.cumsum(RNG.normal(size=6000)) * 1e-3


@pytest.mark.parametrize("motion", [SLOW, -SLOW, HOP])
@pytest.mark.parametrize(
    ("turn", "start", "stated", "unit"),
    [
        (360.0, 0.0, "deg", "deg"),
        (360.0, -180.0, "", "deg"),
        (2 * np.pi, -np.pi, "", "rad"),
        (2 * np.pi, 0.0, "rad", "rad"),
        (1.0, 0.0, "", "turn"),
        (400.0, 0.0, "gon", "gon"),
    ],
)
def test_angles_that_wrap_are_told_and_put_together(motion, turn, start, stated, unit):
    smooth = motion * turn / 360 + start
    found = find_wrap((smooth - start) % turn + start, stated)
    assert (found.size, found.unit) == (pytest.approx(turn), unit)
    back = unwrapped((smooth - start) % turn + start, found.size)
    np.testing.assert_allclose(back - back[0], smooth - smooth[0], atol=1e-9 * turn)


@pytest.mark.parametrize("size", [4096, 10_000, 36_000, 2**16, 2**20, 2**24])
@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize("stated", ["", "counts"])
def test_counters_that_wrap_are_told(size, signed, stated):
    counts = np.round(SLOW / 360 * size)
    half = size // 2 if signed else 0
    found = find_wrap((counts + half) % size - half, stated)
    assert (found.size, found.unit) == (size, "counts")


@pytest.mark.parametrize(
    ("values", "unit"),
    [
        (170 * np.sin(20 * TIME), "deg"),
        (179 * np.sign(np.sin(20 * TIME)), "deg"),
        (350.0 * (np.sin(20 * TIME) > 0), "deg"),
        (np.where(np.arange(6000) % 700 == 5, 0, 350 + 2 * np.sin(9 * TIME)), "deg"),
        (np.where(np.sin(3 * TIME) > 0, 5.0, 0) + 0.01 * RNG.normal(size=6000), ""),
        (RNG.normal(size=6000), ""),
        (RNG.integers(0, 65536, 6000).astype(float), "counts"),
        (1e5 * TIME % 360, "deg"),
        (1000 * TIME % 250, ""),
        (np.zeros(6000), "deg"),
        (np.full(6000, np.nan), "deg"),
    ],
)
def test_what_jumps_or_moves_fast_is_left_alone(values, unit):
    assert find_wrap(values, unit) is None


def test_a_jump_where_samples_are_missing_does_not_hide_the_wraps():
    values = np.delete(10 * SLOW, slice(3000, 3050)) % 360
    assert find_wrap(values, "deg").size == 360


def test_missing_samples_stay_missing():
    values = np.where(RNG.random(6000) < 0.01, np.nan, SLOW % 360)
    found = find_wrap(values, "deg")
    assert found.size == 360
    assert np.array_equal(np.isnan(unwrapped(values, 360)), np.isnan(values))
