"""Times in two variables: seconds and nanoseconds, as ROS 2 and POSIX have them."""

import numpy as np
import pytest

from robid.errors import DataError
from robid.logs.formats.load import load_variables
from robid.logs.formats.variables import find_variable
from robid.logs.inspection.findings import inspect_log

START = 1_767_225_600
NS = START * 10**9 + 900_123_456 + 2_000_000 * np.arange(400)


def write(folder, names, parts, more=""):
    path = folder / "log.csv"
    rows = (f"{a},{b},{np.sin(0.1 * i)}" for i, (a, b) in enumerate(zip(*parts, strict=True)))
    path.write_text("\n".join([f"{','.join(names)},q{more}", *rows]) + "\n")
    return path


@pytest.mark.parametrize(
    ("names", "per", "made"),
    [
        (("header.stamp.sec", "header.stamp.nanosec"), 10**9, "header.stamp"),
        (("/state/header/stamp/sec", "/state/header/stamp/nanosec"), 10**9, "/state/header/stamp"),
        (("field.header.stamp.secs", "field.header.stamp.nsecs"), 10**9, "field.header.stamp"),
        (("tv_sec", "tv_usec"), 10**6, "tv"),
        (("Sec", "NanoSec"), 10**9, "stamp"),
    ],
)
def test_both_make_a_time_with_its_origin(tmp_path, names, per, made):
    parts = NS // 10**9, NS % 10**9 // (10**9 // per)
    path = write(tmp_path, names, parts)
    for asked in (None, [made]):
        variables = load_variables(path, None, asked)
        np.testing.assert_allclose(np.diff(find_variable(variables, made)), 2e-3, atol=1.01 / per)
        assert find_variable(variables, made)[0] == pytest.approx(0.900123, abs=1e-6)
        assert variables.origin(made) == ("1970", START * 10**9)
    sampling = inspect_log([path]).sampling
    assert (sampling.variable, sampling.unit, sampling.step_s) == (made, "s", pytest.approx(2e-3, rel=1e-3))


def test_parts_that_are_none_make_no_time(tmp_path):
    path = write(tmp_path, ("stamp.sec", "stamp.nanosec"), (1e-9 * NS, NS))
    with pytest.raises(DataError):
        find_variable(load_variables(path, None, ["stamp"]), "stamp")
    assert inspect_log([path]).sampling.variable != "stamp"


def test_a_time_that_is_there_is_not_made_anew(tmp_path):
    path = write(tmp_path, ("stamp.sec", "stamp"), (NS // 10**9, NS - NS[0]))
    np.testing.assert_array_equal(find_variable(load_variables(path), "stamp"), NS - NS[0])
