"""The pace of time stamps, as fine or as coarse as loggers write them."""

import numpy as np
import pytest

from robid.logs.pace import measure_pace, roundest

RNG = np.random.default_rng(0)


def rounded(time_s, step_s, kind):
    """Stamps as a logger writes them: cut off or rounded to a step."""
    return (np.floor if kind == "cut" else np.round)(time_s / step_s + 1e-9) * step_s


def instants(rate_hz, count, first_s=0.345):
    return first_s + np.arange(count) / rate_hz


@pytest.mark.parametrize("kind", ["cut", "round"])
@pytest.mark.parametrize(
    ("rate_hz", "step_s", "count"),
    [
        (1000, 1.0, 5500),
        (1000, 1.0, 2500),
        (4000, 1e-3, 4000),
        (2500, 1e-3, 4000),
        (3000, 1e-3, 4000),
        (1000, 1 / 64, 4000),
        (1000, 0.1, 3000),
        (700, 1e-3, 4000),
        (600, 1e-3, 4000),
        (400, 1e-3, 4000),
        (300, 1e-3, 4000),
        (512, 1e-3, 4000),
    ],
)
def test_the_rate_beneath_rounded_stamps_is_exact(rate_hz, step_s, count, kind):
    pace = measure_pace(rounded(instants(rate_hz, count), step_s, kind))
    assert pace.step == pytest.approx(1 / rate_hz, rel=1e-9)
    assert pace.unsure < 2e-3
    assert not len(pace.gaps)
    np.testing.assert_allclose(np.diff(pace.times), 1 / rate_hz, rtol=1e-6)


@pytest.mark.parametrize(("rate_hz", "step_s"), [(1000.37, 1.0), (3997.3, 1e-3), (437.19, 1e-3)])
def test_a_rate_that_is_not_round_lies_within_what_is_told(rate_hz, step_s):
    pace = measure_pace(rounded(instants(rate_hz, 6000), step_s, "cut"))
    assert abs(pace.step * rate_hz - 1) < 2 * pace.unsure < 1e-3


@pytest.mark.parametrize(
    ("rate_hz", "step_s", "lost"),
    [
        (1000, 1.0, 3),
        (1000, 1.0, 40),
        (4000, 1e-3, 7),
        (2500, 1e-3, 7),
        (700, 1e-3, 2),
        (1000, 1e-3, 1),
        (400, 1e-3, 1),
    ],
)
def test_lost_samples_are_gaps_of_coarse_stamps_and_no_other_rate(rate_hz, step_s, lost):
    time_s = np.delete(instants(rate_hz, 8000), np.arange(3100, 3100 + lost))
    pace = measure_pace(rounded(time_s, step_s, "cut"))
    assert pace.step == pytest.approx(1 / rate_hz, rel=1e-9)
    assert len(pace.gaps) in (1, 2)
    # Where the stamp hides the place, no part between gaps holds it.
    assert pace.gaps[0] <= 3099 <= pace.gaps[-1] + 1
    beside = pace.times - pace.times[0] - (time_s - time_s[0])
    parts = np.split(beside, pace.gaps + 1)
    assert max(abs(float(part.mean())) for part in (parts[0], parts[-1])) < 0.6 / rate_hz


def test_jitter_on_top_of_coarse_stamps_moves_no_rate():
    wander = 5e-3 * np.abs(np.sin(7 * instants(1000, 8000)))
    pace = measure_pace(rounded(instants(1000, 8000) + wander, 1.0, "cut"))
    assert pace.step == pytest.approx(1e-3, rel=1e-9)
    assert pace.unsure < 1e-2
    late = np.sort(instants(1000, 8000) + 3e-4 * RNG.normal(size=8000))
    assert measure_pace(rounded(late, 1e-3, "cut")).step == pytest.approx(1e-3, rel=1e-9)


def test_instants_that_jitter_keep_their_stamps():
    late = np.sort(instants(1000, 8000) + 3e-4 * RNG.normal(size=8000))
    pace = measure_pace(np.delete(late, np.arange(4000, 4005)))
    assert pace.step == pytest.approx(1e-3, rel=1e-4)
    assert pace.gaps.tolist() == [3999]
    assert pace.times[-1] == late[-1] - late[0]
    assert not pace.rounding


@pytest.mark.parametrize("scatter", [0.05, 0.1, 0.15])
def test_the_longest_steps_of_a_clock_that_jitters_are_no_gaps(scatter):
    time_s = np.sort(instants(1000, 9000) + scatter * 1e-3 * RNG.standard_normal(9000))
    pace = measure_pace(time_s)
    assert not len(pace.gaps)
    assert pace.step == pytest.approx(1e-3, rel=1e-4)
    lost = np.delete(time_s, slice(4000, 4010))
    assert measure_pace(lost).gaps.tolist() == [3999]


def test_stamps_that_change_once_tell_no_rate():
    assert measure_pace(rounded(instants(1000, 1500), 1.0, "cut")).unsure >= 1


def test_a_constant_column_is_no_clock():
    assert measure_pace(np.zeros(100)) is None
    assert measure_pace(np.full(100, 3.0)) is None


@pytest.mark.parametrize("stamps", [np.r_[0:500, 499:2000] * 1e-3, np.r_[0:500, 100:2000] * 1e-3])
def test_a_stamp_that_is_there_twice_or_goes_back_is_no_rounding(stamps):
    assert measure_pace(stamps) is None


def test_a_stated_step_stays_where_stamps_cannot_tell_it_from_theirs():
    stamps = rounded(instants(1000, 5500), 1.0, "cut")
    assert measure_pace(stamps, 1.0001e-3).step == 1.0001e-3
    assert measure_pace(stamps, 1.01e-3).step == 1e-3


def test_the_roundest_number_has_the_fewest_digits():
    assert roundest(0.99e-3, 1.02e-3) == 1e-3
    assert roundest(0.3333e-3, 0.3334e-3) == pytest.approx(1 / 3000, rel=1e-12)
