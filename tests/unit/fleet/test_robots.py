"""Whose measurements the rows of a manifest are."""

import numpy as np
import pytest

from robid.fleet.manifest import read_manifest, robots_of, wrong_times


@pytest.fixture
def manifest(tmp_path):
    def write(text):
        (tmp_path / "robots.csv").write_text(text)
        return read_manifest(tmp_path / "robots.csv")

    return write


def test_every_row_is_a_robot_of_one_population_unless_columns_say_otherwise(manifest):
    robots = robots_of(manifest("id,log\na,1\nb,2\n"))
    assert (robots.names, robots.groups, robots.repeated) == (("a", "b"), ("all",), 0)
    robots = robots_of(manifest("id,robot,group\na,X,north\nb,Y,south\nc,X,north\nd,,\n"))
    assert (robots.names, robots.robot.tolist()) == (("X", "Y", "d"), [0, 1, 0, 2])
    assert (robots.groups, robots.group.tolist()) == (("north", "south", ""), [0, 1, 0, 2])
    assert (robots.time.tolist(), robots.time_unit, robots.repeated) == ([0, 0, 1, 0], "measurement", 1)


def test_a_column_that_names_robot_files_names_no_robots(manifest):
    text = "id,robot\na,type.yaml\nb,type.yaml\n"
    assert robots_of(manifest(text), ("robot",)).names == ("a", "b")
    assert robots_of(manifest(text)).names == ("type.yaml",)


@pytest.mark.parametrize(
    ("times", "expected", "unit"),
    [
        (["2026-01-31", "2026-02-01T12:00:00Z", ""], [0, 1.5, np.nan], "day"),
        (["2026-01-31T00:00+01:00", "2026-01-31", "2026-02-10"], [0, 1 / 24, 10 + 1 / 24], "day"),
        (["10", "1.2e1", ""], [0, 2, np.nan], "unit of `time`"),
    ],
)
def test_times_are_dates_or_numbers(manifest, times, expected, unit):
    robots = robots_of(manifest("\n".join(["id,time", *(f"r{place},{text}" for place, text in enumerate(times))])))
    np.testing.assert_allclose(robots.time - robots.time[0], expected, atol=1e-9)
    assert robots.time_unit == unit


@pytest.mark.parametrize(
    ("times", "wrong"),
    [
        (["2026-01-31", "soon"], ["robots.csv:3: time: `soon` is no date and time as 2026-01-31T14:00"]),
        (["3", "2026-01-31"], ["robots.csv:3: time: `2026-01-31` is no number"]),
        (
            ["31.01.2026", "1 Feb"],
            ["robots.csv:2: time: `31.01.2026` is neither a date as 2026-01-31 nor", "robots.csv:3: time: `1 Feb`"],
        ),
        (["soon", "2026-01-31"], ["robots.csv:2: time: `soon` is no date and time"]),
        (
            ["20260131", "20260201", ""],
            [
                "robots.csv:2: time: `20260131` is a date without hyphens: write dates as",
                "robots.csv:3: time: `20260201`",
            ],
        ),
        (["20260131", "20269999"], []),
        (["1", "1e308"], ["robots.csv:3: time: `1e308` is too large"]),
        (["1", "2"], []),
        (["1", ""], []),
    ],
)
def test_a_time_that_is_none_is_told_with_its_line(manifest, times, wrong):
    found = list(wrong_times(manifest("\n".join(["id,time", *(f"r{n},{text}" for n, text in enumerate(times))]))))
    assert len(found) == len(wrong)
    assert all(text in told for text, told in zip(wrong, found, strict=True))
