"""What single formats hold beside plain columns: units, times, nested columns, records, names that repeat."""

import datetime

import h5py
import numpy as np
import pytest

from robid.errors import DataError
from robid.logs.formats.load import load_variables
from robid.logs.formats.variables import find_variable


def refuse(variables, name, what):
    with pytest.raises(DataError, match=what) as caught:
        find_variable(variables, name)
    assert caught.value.remedy


def test_hdf5_has_records_units_and_columns(tmp_path):
    path = tmp_path / "log.h5"
    table = np.zeros(5, [("t", float), ("state", "S4")])
    table["t"] = np.arange(5)
    matrix = np.arange(15.0).reshape(5, 3)
    with h5py.File(path, "w") as file:
        file["run/table"] = table
        file["run/q"] = matrix
        file["run/q"].attrs["unit"] = "rad"
        file["note"] = "text"
    variables = load_variables(path, None, ["/run/q(:,3)", "run/q(:, 1)", "run/table.t", "note"])
    np.testing.assert_array_equal(find_variable(variables, "/run/q(:,3)"), matrix[:, 2])
    np.testing.assert_array_equal(find_variable(variables, "run/q(:, 1)"), matrix[:, 0])
    np.testing.assert_array_equal(find_variable(variables, "run/table.t"), np.arange(5))
    assert set(variables) == {"run/q(:,1)", "run/q(:,3)", "run/table.t"}
    assert variables.units == {"run/q": "rad"}
    refuse(variables, "run/table.state", "no numbers")
    refuse(variables, "note", "no numbers")
    with pytest.raises(KeyError):
        find_variable(variables, "run/q(:,4)")


@pytest.mark.parametrize("name", ["log.parquet", "log.feather"])
def test_parquet_and_feather_have_nested_columns_lists_gaps_and_times(tmp_path, name):
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    feather = pytest.importorskip("pyarrow.feather")
    start = datetime.datetime(2024, 1, 1, tzinfo=datetime.UTC)
    table = pa.table(
        {
            "drive": [{"q": float(i), "inner": {"w": i}} for i in range(5)],
            "tau": [[i, 2 * i, 3 * i] for i in range(5)],
            "ragged": [[i] * (i + 1) for i in range(5)],
            "gap": [0, None, 2, 3, 4],
            "when": [start + datetime.timedelta(milliseconds=i) for i in range(5)],
            "word": list("abcde"),
        }
    )
    fields = [one.with_metadata({"unit": "N m"}) if one.name == "gap" else one for one in table.schema]
    table = table.cast(pa.schema(fields))
    if name.endswith("parquet"):
        pq.write_table(table, tmp_path / name, row_group_size=2)
    else:
        feather.write_feather(table, tmp_path / name, chunksize=2)
    variables = load_variables(tmp_path / name)
    np.testing.assert_array_equal(find_variable(variables, "drive.q"), np.arange(5))
    np.testing.assert_array_equal(find_variable(variables, "drive.inner.w"), np.arange(5))
    np.testing.assert_array_equal(find_variable(variables, "tau(:,2)"), 2 * np.arange(5))
    np.testing.assert_array_equal(find_variable(variables, "gap"), [0, np.nan, 2, 3, 4])
    np.testing.assert_allclose(find_variable(variables, "when"), np.arange(5) * 1e-3, atol=1e-12)
    assert variables.units == {"gap": "N m", "when": "s"}
    refuse(variables, "word", "contains string")
    refuse(variables, "ragged(:,1)", "several lengths")


def test_tdms_has_units_and_times(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    told = {"wf_increment": 2e-3, "unit_string": "A"}
    with nptdms.TdmsWriter(tmp_path / "log.tdms") as writer:
        for part in (np.arange(3.0), np.arange(3.0, 7)):
            writer.write_segment(
                [nptdms.ChannelObject("a", "i", part, told), nptdms.ChannelObject("b", "i", -part, {})]
            )
    variables = load_variables(tmp_path / "log.tdms")
    np.testing.assert_array_equal(find_variable(variables, "a/i"), np.arange(7))
    np.testing.assert_array_equal(find_variable(variables, "b/i"), -np.arange(7))
    np.testing.assert_allclose(find_variable(variables, "a/i.time"), np.arange(7) * 2e-3)
    assert variables.units["a/i"] == "A"
    assert "b/i.time" not in variables


def test_mdf_has_groups_of_channels_each_with_its_time(tmp_path):
    asammdf = pytest.importorskip("asammdf")
    fast, slow = np.arange(40) * 1e-3, np.arange(4) * 1e-2
    with asammdf.MDF(version="4.10") as file:
        for time in (fast, slow):
            signals = [asammdf.Signal(samples=np.sin(time), timestamps=time, name="speed", unit="rpm")]
            file.append([*signals, asammdf.Signal(samples=time + 1, timestamps=time, name=f"q{len(time)}")])
        file.save(tmp_path / "log.mf4")
    variables = load_variables(tmp_path / "log.mf4", None, ["q4", "q4.time", "speed(2)", "speed"])
    np.testing.assert_allclose(find_variable(variables, "q4.time"), slow)
    np.testing.assert_allclose(find_variable(variables, "q4"), slow + 1)
    np.testing.assert_allclose(find_variable(variables, "speed(2)"), np.sin(slow))
    np.testing.assert_allclose(find_variable(variables, "speed(1)"), np.sin(fast))
    assert variables.units["speed(2)"] == "rpm"
    refuse(variables, "speed", "occurs 2 times")
