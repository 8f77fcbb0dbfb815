"""NumPy files: archives and lone arrays, in every order of their numbers; never objects."""

import zipfile

import numpy as np
import pytest

from robid.errors import DataError
from robid.logs.formats.load import load_variables
from robid.logs.formats.variables import find_variable

T = np.arange(300) * 0.004
BOTH = np.stack([np.sin(9 * T), np.cos(9 * T)], axis=1)


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
@pytest.mark.parametrize("kind", ["<f8", ">f4", "<i2", "<u8", "?"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_arrays_come_back_by_their_names_whatever_their_numbers(tmp_path, save, kind, order):
    table = np.asarray(100 * BOTH, kind, order=order)
    save(tmp_path / "log.npz", t=T, motion=table)
    for asked in (None, ["motion(:,2)", "t"]):
        variables = load_variables(tmp_path / "log.npz", None, asked)
        np.testing.assert_array_equal(find_variable(variables, "motion(:,2)"), table[:, 1])
        np.testing.assert_array_equal(find_variable(variables, "t"), T)


def test_a_lone_array_has_fields_or_columns(tmp_path):
    np.save(tmp_path / "log.npy", BOTH)
    np.testing.assert_array_equal(find_variable(load_variables(tmp_path / "log.npy"), "1(:,2)"), BOTH[:, 1])
    table = np.zeros(len(T), [("t", float), ("q", float, 2)])
    table["t"], table["q"] = T, BOTH
    np.save(tmp_path / "log.npy", table)
    np.testing.assert_array_equal(find_variable(load_variables(tmp_path / "log.npy"), "q(:,1)"), BOTH[:, 0])


def test_objects_are_refused_by_name_and_never_unpickled(tmp_path):
    class Trap:
        def __reduce__(self):
            return (open, (str(tmp_path / "trap"), "w"))

    np.savez(tmp_path / "log.npz", t=T, odd=np.array([Trap(), 1], object))
    variables = load_variables(tmp_path / "log.npz")
    np.testing.assert_array_equal(find_variable(variables, "t"), T)
    with pytest.raises(DataError, match="D659"):
        find_variable(variables, "odd")
    assert not (tmp_path / "trap").exists()


def test_a_header_that_states_more_than_there_is_takes_no_memory(tmp_path):
    np.save(tmp_path / "array.npy", T)
    raw = (tmp_path / "array.npy").read_bytes()
    long = raw.replace(b"(300,)", b"(999,)")
    with zipfile.ZipFile(tmp_path / "log.npz", "w") as archive:
        archive.writestr("t.npy", long)
        archive.writestr("q.npy", raw)
    variables = load_variables(tmp_path / "log.npz")
    np.testing.assert_array_equal(find_variable(variables, "q"), T)
    with pytest.raises(DataError, match="bytes are there"):
        find_variable(variables, "t")


def test_other_archives_are_told_from_those_of_numpy(tmp_path):
    with zipfile.ZipFile(tmp_path / "log.xlsx", "w") as archive:
        archive.writestr("xl/workbook.xml", "<a/>")
    with pytest.raises(DataError, match="D057"):
        load_variables(tmp_path / "log.xlsx")
