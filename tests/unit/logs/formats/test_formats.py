"""What every format of logs must do alike: named columns exactly, the rest by name, damage as one clear message."""

import gzip
import os

import h5py
import numpy as np
import pytest

from log_files import WRITERS, make_columns
from robid.errors import DataError
from robid.logs.formats import load
from robid.logs.formats.load import Limits, Reader, load_variables
from robid.logs.formats.variables import FORMATS, find_variable

COLUMNS = make_columns()
KINDS = sorted(WRITERS)


def write(folder, kind, columns=COLUMNS):
    writer, name = WRITERS[kind]
    return writer(folder / name, columns)


@pytest.mark.parametrize("kind", KINDS)
def test_columns_come_back_exactly(tmp_path, kind):
    path, names = write(tmp_path, kind)
    variables = load_variables(path)
    for name, column in COLUMNS.items():
        np.testing.assert_array_equal(np.ravel(find_variable(variables, names[name])), column)
    with pytest.raises(KeyError):
        find_variable(variables, "none")


@pytest.mark.parametrize("kind", KINDS)
def test_only_what_is_asked_for_is_read_and_the_rest_is_known_by_name(tmp_path, kind):
    path, names = write(tmp_path, kind)
    variables = load_variables(path, kind.partition(" ")[0], [names["tau"], "none"])
    assert list(variables) == [names["tau"]]
    np.testing.assert_array_equal(np.ravel(variables[names["tau"]]), COLUMNS["tau"])
    assert set(names.values()) <= set(variables.sizes)
    assert variables.sizes[names["q"]] == 700
    assert not set(load_variables(path, None, ()))


@pytest.mark.parametrize("kind", KINDS)
def test_a_log_packed_by_gzip_is_unpacked(tmp_path, kind):
    path, names = write(tmp_path, kind)
    packed = path.with_name(f"{path.name}.gz")
    packed.write_bytes(gzip.compress(path.read_bytes()))
    variables = load_variables(packed, None, [names["q"]])
    np.testing.assert_array_equal(np.ravel(variables[names["q"]]), COLUMNS["q"])


@pytest.mark.parametrize("kind", [kind for kind in KINDS if not kind.startswith("csv")])
def test_the_format_is_told_by_the_first_bytes(tmp_path, kind):
    path, names = write(tmp_path, kind)
    path = path.rename(path.with_suffix(".csv"))
    assert names["q"] in load_variables(path, None, [names["q"]])


@pytest.mark.parametrize("stated", [name for name in FORMATS if name not in ("csv", "hdf5")])
def test_a_wrong_format_is_answered_with_the_right_one(tmp_path, stated):
    pytest.importorskip(FORMATS[stated].needs[0] if FORMATS[stated].needs else "numpy")
    path, names = write(tmp_path, "hdf5")
    with pytest.raises(DataError) as caught:
        load_variables(path, stated)
    assert "format: hdf5" in caught.value.remedy
    assert names["q"] in load_variables(path, "hdf5")


@pytest.mark.parametrize("kind", KINDS)
def test_a_damaged_log_gives_its_values_or_one_message(tmp_path, kind, monkeypatch):
    path, names = write(tmp_path, kind, make_columns(150))
    monkeypatch.setattr(load, "READER", Reader(Limits(seconds=5.0)))
    whole, generator = path.read_bytes(), np.random.default_rng(11)
    told = 0
    for index in range(24):
        damaged = bytearray(whole)
        if index % 3:
            region = len(damaged) if index % 3 == 1 else min(len(damaged), 2000)
            for _ in range(3):
                damaged[generator.integers(0, region)] ^= 1 << generator.integers(0, 8)
        else:
            damaged = damaged[: generator.integers(0, len(damaged))]
        path.write_bytes(bytes(damaged))
        error = refusal(path, kind.partition(" ")[0], names["q"])
        told += error is not None
        assert error is None or (path.name in error.where and error.remedy and "Traceback" not in str(error))
    assert told >= 4
    load.READER.close()


def refusal(path, stated, name):
    """The error with which a variable is refused; None where it is read, or has lost its name to a flipped bit."""
    try:
        find_variable(load_variables(path, stated, [name]), name)
    except DataError as error:
        return error
    except KeyError:
        return None
    return None


@pytest.mark.parametrize("kind", [kind for kind in KINDS if not kind.startswith("csv")])
def test_a_truncated_log_never_passes_for_a_whole_one(tmp_path, kind):
    path, names = write(tmp_path, kind)
    whole = path.read_bytes()
    for share in (0.0, 0.01, 0.1, 0.5, 0.9):
        path.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(DataError) as caught:
            find_variable(load_variables(path, kind.partition(" ")[0], [names["told"]]), names["told"])
        assert path.name in caught.value.where


@pytest.mark.skipif(os.name == "nt", reason="memory limits are those of POSIX")
def test_of_a_matrix_larger_than_memory_the_named_columns_are_read(tmp_path, monkeypatch):
    monkeypatch.setattr(load, "READER", Reader(Limits(memory=1 << 30, memory_per_byte=0)))
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file.create_dataset("x", (10**6, 300), float, chunks=(10**5, 1))[5, 7] = 3.0
    column = load_variables(tmp_path / "log.h5", None, ["x(:,8)"])["x(:,8)"]
    assert (column.shape, column[5], column.sum()) == ((10**6,), 3.0, 3.0)
    with pytest.raises(DataError, match="D507"):
        find_variable(load_variables(tmp_path / "log.h5", None, ["x"]), "x")
    load.READER.close()


@pytest.mark.parametrize("name", [name for name, one in FORMATS.items() if one.needs])
def test_a_missing_reader_names_the_command_that_installs_it(tmp_path, name, monkeypatch):
    monkeypatch.setattr(load, "find_spec", lambda _: None)
    path = tmp_path / f"log{FORMATS[name].suffixes[0]}"
    path.write_bytes(b"some bytes")
    with pytest.raises(DataError, match="D058") as caught:
        load_variables(path)
    assert f"pip install 'robid[{FORMATS[name].extra}]'" in caught.value.remedy


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"#ROSBAG V2.0\n", "rosbags-convert"),
        (b"PK\x03\x04", "save the sheet as CSV"),
        (b"\x28\xb5\x2f\xfd", "zstd -d"),
    ],
)
def test_known_formats_that_are_not_read_have_a_way_in(tmp_path, content, words):
    (tmp_path / "log").write_bytes(content)
    with pytest.raises(DataError) as caught:
        load_variables(tmp_path / "log")
    assert words in caught.value.remedy


def test_a_folder_is_a_bag_or_none(tmp_path):
    with pytest.raises(DataError, match="is a folder"):
        load_variables(tmp_path, "csv")
    pytest.importorskip("rosbags")
    with pytest.raises(DataError, match="D073"):
        load_variables(tmp_path)


@pytest.mark.parametrize(
    ("file", "names", "sizes"),
    [
        ("motor_bench/MultisineTypeA.mat", ("iq_adx", "theta_mx", "time"), {50000}),
        ("emps/DATA_EMPS.mat", ("qm", "vir", "t"), {24841}),
        ("crane/meas1.mat", ("meas1.X.Data", "meas1.Y(3).Data"), {86851}),
        ("crane/meas2.mat", ("meas2.X.Data", "meas2.Y(5).Data"), {85001}),
        ("tx40/pos_read_data.csv", ("Joint_1", "Joint_6"), {45000}),
        ("tx40/curr_data.csv", ("Joint_1", "Joint_6"), {45000}),
    ],
)
def test_real_logs_are_read(data_folder, file, names, sizes):
    folder, _, name = file.partition("/")
    variables = load_variables(data_folder(folder) / name, None, names)
    assert {variables[one].size for one in names} == sizes == {variables.sizes[one] for one in names}
    assert variables.found.damage is None
