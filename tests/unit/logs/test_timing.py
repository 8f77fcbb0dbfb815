"""The time of a log in every kind of number that loggers write."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robid.logs.mapping import LogMapping
from robid.logs.resample import chosen_part
from robid.logs.timing import read_clock
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
