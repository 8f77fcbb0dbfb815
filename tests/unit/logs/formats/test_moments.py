"""Dates and times of day in every usual order, read to the nanosecond and fast."""

import time
from datetime import datetime, timedelta

import numpy as np
import pytest

from robid.logs.formats.moments import Moments, is_moment

ORDERS = {
    "iso": "%Y-%m-%dT%H:%M:%S.%f",
    "iso, Z": "%Y-%m-%d %H:%M:%S.%fZ",
    "iso, zone": "%Y-%m-%dT%H:%M:%S,%f+02:00",
    "compact": "%Y%m%dT%H%M%S.%f",
    "underscores": "%Y-%m-%d_%H-%M-%S-%f",
    "slashes": "%Y/%m/%d %H:%M:%S.%f",
    "German": "%d.%m.%Y %H:%M:%S,%f",
    "German, short": "%d.%m.%y %H:%M:%S,%f",
    "US": "%m/%d/%Y %H:%M:%S.%f",
    "US, halves": "%m/%d/%Y %I:%M:%S.%f %p",
    "British": "%d/%m/%Y %H:%M:%S.%f",
    "dashes": "%d-%m-%Y %H:%M:%S.%f",
    "Japanese, short": "%y/%m/%d %H:%M:%S.%f",
    "month first": "%b %d %Y %H:%M:%S.%f",
    "month first, comma": "%B %d, %Y, %I:%M:%S.%f %p",
    "month": "%d-%b-%Y %H:%M:%S.%f",
    "weekday": "%A, %d %B %Y %H:%M:%S.%f",
    "server": "%d/%b/%Y:%H:%M:%S.%f +0000",
    "ctime": "%a %b %d %H:%M:%S.%f %Y",
    "time first": "%H:%M:%S.%f %d.%m.%Y",
}


def read(cells):
    moments = Moments()
    assert moments.add(cells) is None, cells[0]
    assert moments.first_wrong() is None
    return moments.seconds()


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize(
    "start", ["2022-05-02 15:56:59.5", "2024-02-28 23:59:59.9", "2023-12-31 23:59:59.9", "2022-05-04 11:59:59.9"]
)
@pytest.mark.parametrize("step_s", [0.00025, 7200.5])
def test_dates_in_any_order_are_read(order, start, step_s):
    steps = np.arange(60) * step_s
    begin = datetime.fromisoformat(start)
    found = read([(begin + timedelta(seconds=s)).strftime(ORDERS[order]) for s in steps.tolist()])
    np.testing.assert_allclose(found, steps, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("cells", "seconds"),
    [
        (["15:57:01.2", "15:57:02", "15:57:02.4"], [0, 0.8, 1.2]),
        (["23:59:59.9", "0:00:00.1", "12:00:00.1", "23:00:00", "1:00:00"], [0, 0.2, 43200.2, 82800.1, 90000.1]),
        (["11:59:59 PM", "12:00:01 AM", "1:00:00 a.m."], [0, 2, 3601]),
        (["12:59:59.5", "1:00:00.5", "2:00:00.5"], [0, 1, 3601]),
        (["59:59.9", "00:00.1", "00:00.3"], [0, 0.2, 0.4]),
        (["59:59.9", "1:00:00.1", "1:00:00.3"], [0, 0.2, 0.4]),
        (["99:59:59.5", "100:00:00.5"], [0, 1]),
        (["0 days 23:59:59.999", "1 days 00:00:00.001"], [0, 0.002]),
        (["0.23:59:59.9990000", "1.00:00:00.0010000"], [0, 0.002]),
        (["15:57:01:5", "15:57:01:50", "15:57:01:500"], [0, 0.045, 0.495]),
        (["2024-10-27T02:59:59 CEST", "2024-10-27T02:00:01 CET"], [0, 2]),
        (["2024-10-27T02:59:59+02:00", "2024-10-27T02:00:01+01:00"], [0, 2]),
        (["24. Okt. 2024 14:05:15", "24. Okt. 2024 14:05:16"], [0, 1]),
        (["Montag, 2. Mai 2022 15:56:24.3760000000000000001"] * 2, [0, 0]),
        (["31.12.2024 23:59:59,9", "", "01.01.2025 00:00:00,1"], [0, np.nan, 0.2]),
        (["9/5/2024 9:05:03", "10/5/2024 10:05:03"], [0, 86400 + 3600]),
        (["9/5/2024 9:05:03 AM", "9/13/2024 9:05:03 AM"], [0, 8 * 86400]),
    ],
)
def test_times_go_on(cells, seconds):
    found = read(cells)
    np.testing.assert_allclose(found, seconds, rtol=0, atol=1e-9)


def test_parts_of_a_column_join():
    moments = Moments()
    for cells in (["23:59:59"], ["", "00:00:00"], ["00:00:01.5"]):
        assert moments.add(cells) is None
    np.testing.assert_array_equal(moments.seconds(), [0, np.nan, 1, 2.5])


@pytest.mark.parametrize(
    "cell",
    [
        *("", "x", "12", "3.5", "1:2", "2024-13-01 10:00:00", "30.02.2024 10:00:00", "2024-05-01 25:00:00"),
        *("10:61:00", "13:00:00 PM", "Run 24 2024 10:00:00", "192.168.1.20", "10:00:00 x y"),
    ],
)
def test_what_is_no_moment(cell):
    assert not is_moment(cell)


def test_a_cell_that_does_not_fit_is_told():
    moments = Moments()
    assert moments.add(["10:00:00", "10:00:01", "2024-01-01 10:00:02"]) == 2
    assert Moments().add(["10:00:00", "lost"]) == 1
    assert Moments().add(["10:00:00", "1" * 10**6]) == 1
    wrong = Moments()
    assert wrong.add(["01.02.2024 10:00:00", "31.02.2024 10:00:00"]) is None
    assert wrong.first_wrong() == 1


def test_a_long_column_is_read_fast():
    cells = [f"02.05.2022 15:{i // 60000 % 60:02d}:{i // 1000 % 60:02d}.{i % 1000:03d}" for i in range(100_000)]
    begin = time.perf_counter()
    found = read(cells)
    # A parser that takes cells one by one needs twenty times as long.
    assert time.perf_counter() - begin < 3
    assert found[-1] == pytest.approx(99.999)
