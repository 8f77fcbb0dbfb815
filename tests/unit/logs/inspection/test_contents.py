"""What is read of a log: signals, single numbers, matrices by columns, and a part of what is large."""

import gzip

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from robid.errors import DataError
from robid.logs.inspection import contents
from robid.logs.inspection.contents import join_contents, read_contents

N = 400
X = np.random.default_rng(1).normal(size=(N, 3))


def write_table(path, rows=N):
    text = "a [V],b\n" + "".join(f"{one:.9f},{two:.9f}\n" for one, two, _ in X[:rows])
    path.write_bytes(gzip.compress(text.encode()) if path.suffix == ".gz" else text.encode())
    return path


def test_signals_numbers_texts_and_what_is_neither(tmp_path):
    savemat(
        tmp_path / "log.mat",
        {"q": X, "t": X[:, 0], "Ts": 1e-3, "note": "today", "cube": np.zeros((4, 4, 4)), "wide": X.T, "two": [1.0, 2]}
        | {"deep": X.T[:, None]},
    )
    found = read_contents(tmp_path / "log.mat")
    assert {one.name for one in found.columns} == {
        *(f"q(:,{i})" for i in (1, 2, 3)),
        *(f"wide({i},:)" for i in (1, 2, 3)),
        *(f"deep({i},1,:)" for i in (1, 2, 3)),
        "t",
    }
    for name in ("q(:,2)", "wide(2,:)", "deep(2,1,:)"):
        assert np.array_equal(next(one for one in found.columns if one.name == name).values, X[:, 1])
    assert found.scalars == {"Ts": 1e-3}
    assert found.texts == ("note",)
    assert {"cube", "two"} <= set(found.unreadable)


def test_values_whose_powers_overflow_are_left_out_and_said(tmp_path):
    values = np.sin(np.arange(100.0))
    damaged = np.where(np.arange(100) == 7, -3e202, values)
    savemat(tmp_path / "log.mat", {"torque": damaged, "angle": values, "gap": np.where(damaged < -1, np.inf, values)})
    found = read_contents(tmp_path / "log.mat")
    kept = {one.name: one.values for one in found.columns}
    assert np.flatnonzero(np.isnan(kept["torque"])).tolist() == [7]
    assert (kept["angle"] == values).all()
    assert np.isinf(kept["gap"][7])
    assert [note for note in found.notes if "`torque`: 1 value " in note and "sample 7" in note] == [*found.notes]


def test_a_log_without_signals_says_why_each_variable_is_none(tmp_path):
    savemat(tmp_path / "log.mat", {"note": "today", "cube": np.zeros((4, 4, 4)), "two": [1.0, 2], "Ts": 1e-3})
    with pytest.raises(DataError, match="no signals") as caught:
        read_contents(tmp_path / "log.mat")
    for name, reason in (("note", "text"), ("cube", "(4, 4, 4)"), ("two", "2 values"), ("Ts", "single number")):
        assert next(line for line in str(caught.value).splitlines() if f"`{name}`" in line).count(reason) == 1


@pytest.mark.parametrize("name", ["log.csv", "log.csv.gz"])
def test_the_beginning_of_a_large_table_is_looked_at(tmp_path, monkeypatch, name):
    path = write_table(tmp_path / name)
    assert len(read_contents(path).columns[0].values) == N
    monkeypatch.setattr(contents, "_TABLE_BYTES", 4096)
    found = read_contents(path)
    count = len(found.columns[0].values)
    assert 100 < count < N
    assert np.allclose(found.columns[0].values, X[:count, 0], atol=1e-8)
    assert found.columns[0].unit == "V"
    assert found.file == path
    assert "were looked at" in found.notes[0]


def test_as_many_variables_of_a_large_log_as_there_is_room_for(tmp_path, monkeypatch):
    with h5py.File(tmp_path / "log.h5", "w") as file:
        for name in ("a", "b", "c"):
            file.create_dataset(name, data=X[:, 0])
    monkeypatch.setattr(contents, "_WHOLE_BYTES", 1000)
    monkeypatch.setattr(contents, "_VALUES", 2 * N)
    found = read_contents(tmp_path / "log.h5")
    assert [one.name for one in found.columns] == ["a", "b"]
    assert found.notes == ("Only 2 of 3 variables were looked at; the log is large.",)


def test_several_logs_are_one_recording(tmp_path):
    first, second = write_table(tmp_path / "one.csv"), write_table(tmp_path / "two.csv", N // 2)
    joined = join_contents([read_contents(first), read_contents(second)])
    assert [one.key for one in joined.columns] == ["a [V]", "b", "a [V] of two.csv", "b of two.csv"]
    assert [one.file for one in joined.columns] == [None, None, second, second]


def test_a_log_without_signals_is_refused(tmp_path):
    savemat(tmp_path / "log.mat", {"note": "today", "x": 3.0})
    with pytest.raises(DataError, match="contains no signals"):
        read_contents(tmp_path / "log.mat")
