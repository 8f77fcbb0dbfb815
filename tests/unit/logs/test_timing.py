"""The time of a log in every kind of number that loggers write."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robid.logs.mapping import LogMapping
from robid.logs.parts import chosen_part
from robid.logs.timing import going_on, read_clock
from robid.signals.log_channels import InputChannel, OutputChannel
from robid.signals.log_options import TimeChannel

MAPPING = LogMapping(
    file=Path("log.mat"),
    sampling_period_s=1e-3,
    time=TimeChannel("t", "ms"),
    inputs=(InputChannel("drive", "u"),),
    outputs=(OutputChannel("drive", "q"),),
)


@pytest.mark.parametrize("kind", [np.uint16, np.uint32, np.uint64, np.int32, np.int64, np.float32, np.float64])
def test_time_that_goes_back_is_told_whatever_the_kind_of_its_numbers(kind):
    stamps = np.arange(1000, 2000)
    stamps[500:] = np.arange(100, 600)
    clock, (problem,) = read_clock(MAPPING, stamps.astype(kind))
    assert clock is None
    assert "D122 Time does not advance after sample 499 (1 such steps)" in str(problem)


@pytest.mark.parametrize("kind", [np.uint64, np.int64])
def test_nanoseconds_since_1970_are_read_to_the_last(kind):
    mapping = replace(MAPPING, time=TimeChannel("t", "ns"), sampling_period_s=1e-6)
    stamps = (1_700_000_000_000_000_123 + 1000 * np.arange(5000)).astype(kind)
    clock, problems = read_clock(mapping, stamps)
    assert not problems
    np.testing.assert_allclose(clock.time_s, 1e-6 * np.arange(5000), atol=1e-12)
    columns = {"t": stamps, "u": np.zeros(5000), "q": np.zeros(5000)}
    assert chosen_part(replace(mapping, from_s=1000e-6, to_s=2000e-6), columns) == slice(1000, 2001)


@pytest.mark.parametrize(
    ("kind", "step", "size", "first"),
    [
        (np.uint8, 1, 256, 200),
        (np.uint16, 2, 65536, 65000),
        (np.uint32, 2000, 2**32, 2**32 - 99_999),
        (np.int32, 2000, 2**32, 2**31 - 99_999),
        (float, 2e-3, 2**32 / 1e6, 4294.0),
        (float, 4e-3, 86400.0, 86399.1),
        (float, 4e-3, 3600.0, 3599.1),
    ],
)
def test_a_time_that_begins_again_goes_on(kind, step, size, first):
    steps = step * np.arange(900)
    low = -size / 2 if kind is np.int32 else 0
    stamps = ((first + steps - low) % size + low).astype(kind)
    times, found = going_on(stamps)
    assert found == pytest.approx(size)
    np.testing.assert_allclose(times - times[0], steps, atol=1e-6 * step + 1e-9)


@pytest.mark.parametrize("size", [65536, 3600 * 500])
def test_two_recordings_in_a_row_are_not_joined(size):
    stamps = np.concatenate([np.arange(size), np.arange(300)])
    assert going_on(stamps)[1] == 0
    _, (problem,) = read_clock(MAPPING, stamps)
    assert "D122" in str(problem)
    assert "log of its own" in problem.remedy


@pytest.mark.parametrize("lost", [3, 40, 30_000])
def test_a_step_back_that_is_no_range_is_left(lost):
    stamps = (60000 + np.arange(9000)) % 65536
    stamps[stamps < 10_000] += lost
    assert going_on(stamps)[1] == 0
    np.testing.assert_array_equal(going_on(stamps)[0], stamps)
