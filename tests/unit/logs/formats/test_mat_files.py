"""MAT files: names of fields, cells and columns as in MATLAB, both layouts, what only MATLAB can decode."""

import struct

import h5py
import numpy as np
import pytest
from scipy.io import savemat
from scipy.io.matlab import MatlabObject
from scipy.sparse import eye

from log_files import WRITERS
from robid.errors import DataError
from robid.logs.formats.load import load_variables
from robid.logs.formats.variables import find_variable


def test_fields_of_structures_are_named_as_in_matlab(tmp_path):
    channels = np.zeros((1, 2), [("Name", object), ("Data", object), ("Unit", object)])
    channels[0, 0], channels[0, 1] = ("angle", np.arange(5.0), "rad"), ("speed", np.arange(5.0) * 2, "rpm")
    cells = np.empty((1, 2), object)
    cells[0] = [np.ones(4), np.zeros(4)]
    savemat(tmp_path / "log.mat", {"meas": {"X": {"Data": np.arange(5.0) / 10}, "Y": channels}, "c": cells})
    variables = load_variables(tmp_path / "log.mat")
    np.testing.assert_array_equal(np.ravel(find_variable(variables, "meas.Y(2).Data")), np.arange(5.0) * 2)
    np.testing.assert_array_equal(np.ravel(find_variable(variables, "meas(1).X(1).Data")), np.arange(5.0) / 10)
    np.testing.assert_array_equal(np.ravel(find_variable(variables, "meas(1).Y(1).Data")), np.arange(5.0))
    np.testing.assert_array_equal(np.ravel(find_variable(variables, "c{1}")), np.ones(4))
    assert variables.units == {"meas.X.Data": "s", "meas.Y(1).Data": "rad", "meas.Y(2).Data": "rpm"}
    assert variables.texts["meas.Y(2).Name"] == "speed"
    for name in ("meas.Y(3).Data", "meas.Y.Data", "meas", "c"):
        with pytest.raises(KeyError):
            find_variable(variables, name)


def test_columns_of_matrices_have_numbers(tmp_path):
    matrix = np.arange(12.0).reshape(4, 3)
    savemat(tmp_path / "log.mat", {"rec": {"tau": matrix}, "row": np.arange(3.0)})
    names = ["rec.tau(:,3)", "rec.tau(:, 1)"]
    for variables in (load_variables(tmp_path / "log.mat"), load_variables(tmp_path / "log.mat", "mat", names)):
        np.testing.assert_array_equal(find_variable(variables, "rec.tau(:,3)"), matrix[:, 2])
        np.testing.assert_array_equal(find_variable(variables, "rec.tau(:, 1)"), matrix[:, 0])
        for name in ("rec.tau(:,4)", "rec.tau(:,0)", "tau(:,1)"):
            with pytest.raises(KeyError):
                find_variable(variables, name)


@pytest.mark.parametrize("kind", ["mat", "mat 7.3", "hdf5"])
def test_a_channel_may_be_a_row_of_a_matrix_or_lie_deeper(tmp_path, kind):
    wide, deep = np.arange(24.0).reshape(3, 8), np.arange(40.0).reshape(5, 1, 8)
    path, _ = WRITERS[kind][0](tmp_path / f"log.{'h5' if kind == 'hdf5' else 'mat'}", {"x": np.ones(4)})
    if kind == "mat":
        savemat(path, {"wide": wide, "deep": deep})
    else:
        with h5py.File(path, "r+") as file:
            for name, x in (("wide", wide), ("deep", deep)):
                # MATLAB writes the axes in reverse.
                file.create_dataset(name, data=x.T if kind == "mat 7.3" else x).attrs["MATLAB_class"] = np.bytes_(
                    "double"
                )
    asked = ["wide(3,:)", "wide(:, 2)", "deep(4, 1, :)"]
    for variables in (load_variables(path), load_variables(path, None, asked)):
        np.testing.assert_array_equal(find_variable(variables, "wide(3,:)"), wide[2])
        np.testing.assert_array_equal(find_variable(variables, "wide(:, 2)"), wide[:, 1])
        np.testing.assert_array_equal(find_variable(variables, "deep(4, 1, :)"), deep[3, 0])
        for name in ("wide(4,:)", "wide(0,:)", "wide(1,1,:)", "deep(1,:)", "none(1,:)"):
            with pytest.raises(KeyError):
                find_variable(variables, name)
    assert set(load_variables(path, None, asked)) == {"wide(3,:)", "wide(:,2)", "deep(4,1,:)"}


def test_times_of_what_simulink_and_controldesk_save_are_known(tmp_path):
    time = np.linspace(0, 1, 50)
    channels = [{"values": np.stack([time, time**2], 1), "label": "torque [Nm]"}, {"values": time, "label": ""}]
    rasters = [{"Data": time, "Raster": "1 ms"}, {"Data": time[:20], "Raster": "5 ms"}]
    recorded = [{"Name": "tau", "Data": time, "XIndex": 1.0}, {"Name": "phi", "Data": time[:20], "XIndex": 2.0}]
    savemat(
        tmp_path / "log.mat",
        {
            "out": {"time": time, "signals": np.array(channels, object), "blockName": "arm/scope"},
            "ans": np.stack([time, np.sin(9 * time), np.cos(9 * time)]),
            "rec": {"X": np.array(rasters, object), "Y": np.array(recorded, object)},
            "ts": {"Time": time, "Data": time, "TimeInfo": {"Units": "seconds"}, "DataInfo": {"Units": "rad"}},
            "both": np.stack([time, 2 * time]),
        },
    )
    variables = load_variables(tmp_path / "log.mat")
    units = {name: unit for name, unit in variables.units.items() if name.partition("(1,:)")[0] in variables.sizes}
    times = {name for name, unit in units.items() if unit in ("s", "seconds")}
    times -= {"rec.Y{1}.Data.time", "rec.Y{2}.Data.time"}
    assert times == {"out.time", "ans(1,:)", "rec.X{1}.Data", "rec.X{2}.Data", "ts.Time"}
    assert {name: unit for name, unit in units.items() if unit not in ("s", "seconds")} == {
        "out.signals{1}.values": "Nm",
        "ts.Data": "rad",
    }


@pytest.mark.parametrize("kind", ["structures", "cells"])
def test_channels_of_several_rasters_have_times_of_their_own(tmp_path, kind):
    fast, slow = np.linspace(0, 1, 50), np.linspace(0, 1, 20)
    rasters = [{"Data": fast}, {"Data": slow}]
    recorded = [{"Name": "tau", "Data": fast**2, "XIndex": 1.0}, {"Name": "phi", "Data": slow**2, "XIndex": 2.0}]
    if kind == "structures":
        rasters, recorded = (np.array([tuple(one.values()) for one in each], [(key, object) for key in each[0]])
                             for each in (rasters, recorded))  # fmt: skip
    else:
        rasters, recorded = np.array(rasters, object), np.array(recorded, object)
    savemat(tmp_path / "log.mat", {"rec": {"X": rasters, "Y": recorded}})
    opening, closing = "()" if kind == "structures" else "{}"
    second = f"rec.Y{opening}2{closing}.Data"
    for names in (None, [second, f"{second}.time"]):
        variables = load_variables(tmp_path / "log.mat", None, names)
        np.testing.assert_array_equal(np.ravel(find_variable(variables, f"{second}.time")), slow)
        assert variables.units[f"{second}.time"] == "s"
        assert names is None or set(variables) == set(names)


def refuse(variables, name, what, remedy=""):
    with pytest.raises(DataError) as caught:
        find_variable(variables, name)
    assert what in caught.value.what
    assert remedy in caught.value.remedy
    assert f"variable `{name}`" in caught.value.where


def part(kind, data):
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def opaque(name, class_name):
    """A variable that is an object of one of MATLAB's newer classes, byte for byte as MATLAB writes it."""
    flags = part(6, struct.pack("<II", 17, 0))
    ids = part(6, struct.pack("<II", 13, 0)) + part(5, struct.pack("<ii", 6, 1)) + part(1, b"")
    ids += part(6, struct.pack("<6I", 0xDD000000, 2, 1, 1, 1, 1))
    return part(14, flags + part(1, name) + part(1, b"MCOS") + part(1, class_name) + part(14, ids))


@pytest.mark.parametrize(("kind", "remedy"), [("table", "table2struct"), ("timeseries", "`name.Data`"), ("own", "")])
def test_objects_of_matlab_leave_the_rest_readable(tmp_path, kind, remedy):
    path = tmp_path / "log.mat"
    savemat(path, {"q": np.arange(5.0), "old": MatlabObject(np.zeros((1, 1), [("a", object)]), "thing")})
    path.write_bytes(path.read_bytes() + opaque(b"run", kind.encode()))
    for names in (None, ["q", "run.speed", "old.a"]):
        variables = load_variables(path, None, names)
        np.testing.assert_array_equal(np.ravel(find_variable(variables, "q")), np.arange(5.0))
        refuse(variables, "run.speed", f"an object of the MATLAB class `{kind}`", remedy)
        refuse(variables, "old.a", "an object of the MATLAB class `thing`")


def test_what_holds_no_columns_says_what_it_is(tmp_path):
    savemat(tmp_path / "log.mat", {"note": "text", "wide": eye(4), "q": np.arange(5.0)})
    variables = load_variables(tmp_path / "log.mat", None, ["note", "wide", "q"])
    refuse(variables, "note", "text, not numbers")
    refuse(variables, "wide", "sparse matrix", "full(name)")


def test_a_log_cut_short_keeps_what_lies_before(tmp_path):
    path = tmp_path / "log.mat"
    savemat(path, {"first": np.arange(900.0), "second": np.arange(900.0), "third": np.arange(900.0)})
    path.write_bytes(path.read_bytes()[:9000])
    variables = load_variables(path, None, ["first", "second", "third"])
    np.testing.assert_array_equal(np.ravel(find_variable(variables, "first")), np.arange(900.0))
    refuse(variables, "second", "damaged", "copied completely")
    refuse(variables, "third", "D062", "copied completely")


def test_version_4_is_read(tmp_path):
    savemat(tmp_path / "log.mat", {"q": np.arange(5.0), "m": np.eye(2)}, format="4")
    variables = load_variables(tmp_path / "log.mat", None, ["q"])
    np.testing.assert_array_equal(np.ravel(variables["q"]), np.arange(5.0))
    assert variables.sizes["m"] == 4


@pytest.fixture
def new_file(tmp_path):
    """A file as MATLAB writes it with `-v7.3`: a structure, an array of structures, a cell, text, a table."""
    path = tmp_path / "log.mat"

    def put(group, name, values, kind="double"):
        item = group.create_dataset(name, data=values)
        item.attrs["MATLAB_class"] = np.bytes_(kind)
        return item

    with h5py.File(path, "w", userblock_size=512) as file:
        exp = file.create_group("exp1")
        exp.attrs["MATLAB_class"] = np.bytes_("struct")
        put(exp, "tau", np.arange(12.0).reshape(3, 4))
        put(exp, "name", np.frombuffer("Achse".encode("utf-16-le"), np.uint16)[None], "char")
        refs = file.create_group("#refs#")
        parts = [put(refs, mark, np.full((1, 3), value)).ref for mark, value in (("a", 1.0), ("b", 2.0))]
        array = exp.create_group("Y")
        array.attrs["MATLAB_class"] = np.bytes_("struct")
        array.create_dataset("Data", data=np.array([parts]), dtype=h5py.ref_dtype)
        put(file, "cells", np.array([parts]).astype(h5py.ref_dtype), "cell")
        table = put(file, "T", np.arange(6, dtype=np.uint32)[None], "table")
        table.attrs["MATLAB_object_decode"] = 3
        pair = np.zeros((1, 2), [("real", float), ("imag", float)])
        pair["imag"] = 2
        put(file, "z", pair)
        put(file, "none", np.array([0, 0], np.uint64)).attrs["MATLAB_empty"] = 1
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + path.read_bytes()[128:])
    return path


def test_version_7_3_has_the_same_names(new_file):
    variables = load_variables(new_file)
    np.testing.assert_array_equal(find_variable(variables, "exp1.tau"), np.arange(12.0).reshape(3, 4).T)
    np.testing.assert_array_equal(find_variable(variables, "exp1.tau(:,3)"), np.arange(8.0, 12))
    np.testing.assert_array_equal(np.ravel(find_variable(variables, "exp1.Y(2).Data")), [2, 2, 2])
    np.testing.assert_array_equal(np.ravel(find_variable(variables, "cells{1}")), [1, 1, 1])
    np.testing.assert_array_equal(np.ravel(variables["z"]), [2j, 2j])
    assert variables.texts == {"exp1.name": "Achse"}
    refuse(variables, "T.speed", "an object of the MATLAB class `table`", "table2struct")
    refuse(variables, "exp1.name", "text")
    only = load_variables(new_file, None, ["exp1.tau(:,3)"])
    assert list(only) == ["exp1.tau(:,3)"]
    np.testing.assert_array_equal(find_variable(only, "exp1.tau(:,3)"), np.arange(8.0, 12))


def test_floats_that_a_flipped_bit_calls_integers_are_refused(tmp_path):
    path, numbers = tmp_path / "log.mat", np.random.default_rng(1).normal(size=50)
    savemat(path, {"x": numbers, "count": np.arange(50, dtype=np.uint64)})
    whole = bytearray(path.read_bytes())
    tag = whole.index(numbers.tobytes()) - 8
    assert struct.unpack("<II", whole[tag : tag + 8]) == (9, 400)  # doubles, 13 are unsigned integers
    whole[tag] = 13
    path.write_bytes(whole)
    variables = load_variables(path)
    np.testing.assert_array_equal(np.ravel(find_variable(variables, "count")), np.arange(50))
    with pytest.raises(DataError, match="damaged"):
        find_variable(variables, "x")
