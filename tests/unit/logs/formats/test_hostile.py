"""Logs that were made to do harm: they are refused with a remedy, in little memory, and no other file is read."""

import bz2
import gzip
import lzma
import os
import resource
import tempfile
import threading

import h5py
import numpy as np
import pytest

from robid.errors import DataError
from robid.logs.formats import load, unpacking
from robid.logs.formats.load import Limits, Reader, load_variables
from robid.logs.formats.unpacking import LEAST_ROOM, LONGEST_LINE, ROOM_PER_BYTE
from robid.logs.inspection.contents import read_contents

GIGABYTE = 1 << 30
HEADER = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
TIME = np.arange(100.0)


@pytest.fixture(params=["h5", "mat"])
def log(request, tmp_path):
    """Makes a log of HDF5, or of MAT 7.3, of a time and whatever else is written into it."""

    def make(write):
        path = tmp_path / f"log.{request.param}"
        with h5py.File(path, "w", userblock_size=512) as file:
            file["t"] = TIME
            write(file)
        if request.param == "mat":
            with path.open("r+b") as raw:
                raw.write(HEADER)
        return path

    return make


def external_link(file, other):
    file["s"] = h5py.ExternalLink(other, "/secret")


def external_link_of_a_group(file, other):
    file.create_group("g")["s"] = h5py.ExternalLink(other, "/")


def external_storage(file, other):
    file.create_dataset("s", (10,), "u1", external=[(other, 0, 10)])


def virtual_dataset(file, other):
    layout = h5py.VirtualLayout((100,), "f8")
    layout[:] = h5py.VirtualSource(other, "secret", (100,))
    file.create_group("g").create_virtual_dataset("s", layout)


@pytest.mark.parametrize("way", [external_link, external_link_of_a_group, external_storage, virtual_dataset])
@pytest.mark.parametrize("names", [None, ["t"]], ids=["all", "others"])
def test_no_other_file_is_read_through_a_log(log, tmp_path, way, names):
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["secret"] = TIME
    path = log(lambda file: way(file, str(tmp_path / "other.h5")))
    with pytest.raises(DataError, match="another file") as caught:
        load_variables(path, names=names)
    assert caught.value.remedy


def deep(file):
    group = file
    for _ in range(3000):
        group = group.create_group("g")
    group["x"] = TIME


def doubling(file):
    """Groups in each other, of two names each: few objects, and a hundred million ways through them."""
    group = file.create_group("x")
    for _ in range(27):
        inner = group.create_group("a")
        group["b"] = inner
        group = inner
    group["x"] = TIME


def circle(file):
    group = file.create_group("x")
    group["a"] = group["b"] = group
    group["all"] = file["/"]


def cell_of_itself(file):
    cell = file.create_dataset("c", (3,), h5py.ref_dtype)
    cell.attrs["MATLAB_class"] = np.bytes_("cell")
    cell[:] = [cell.ref] * 3


def huge(file):
    file.create_dataset("s", (10**12,), "f8", chunks=(1000,))


def large(file):
    file.create_dataset("s", (10**8,), "f8", chunks=(1000,))


def large_table(file):
    file.create_dataset("s", (10**9,), np.dtype([("real", "f8"), ("imag", "f8")]), chunks=(1000,))


def long_text(file):
    text = file.create_dataset("s", (10**8,), "u2", chunks=(1000,))
    text.attrs["MATLAB_class"] = np.bytes_("char")


def many_references(file):
    cell = file.create_dataset("c", (10**8,), h5py.ref_dtype, chunks=(1000,))
    cell.attrs["MATLAB_class"] = np.bytes_("cell")


def zeros(file):
    values = file.create_dataset("s", (2 * 10**7,), "f8", chunks=(10**6,), compression="gzip")
    for start in range(0, 2 * 10**7, 10**6):
        values[start : start + 10**6] = np.zeros(10**6)


ENDLESS = [deep, doubling, circle, cell_of_itself, huge, large, large_table, long_text, many_references, zeros]


@pytest.mark.parametrize("way", ENDLESS)
def test_what_a_log_declares_is_read_within_limits_or_refused(log, monkeypatch, way):
    path = log(way)
    reader = Reader(Limits(seconds=20.0, memory=GIGABYTE, memory_per_byte=0))
    monkeypatch.setattr(load, "READER", reader)
    outcome = _outcome(path)
    reader.close()
    if isinstance(outcome, DataError):
        assert not any(words in str(outcome) for words in ("longer than", "of memory"))
        assert outcome.remedy
        return
    np.testing.assert_array_equal(outcome["t"], TIME)
    assert sum(values.nbytes for values in outcome.values()) < LEAST_ROOM


def _outcome(path):
    try:
        return load_variables(path)
    except DataError as error:
        return error


@pytest.mark.parametrize("packer", [gzip, bz2, lzma])
@pytest.mark.parametrize("block", [b"0,0\n" * (1 << 18), bytes(1 << 20)], ids=["rows", "zeros"])
@pytest.mark.parametrize("suffix", ["csv", "mat", "h5"])
def test_a_packed_log_unpacks_within_limits_and_leaves_nothing(tmp_path, monkeypatch, packer, block, suffix):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "room"))
    monkeypatch.setattr(unpacking, "LEAST_ROOM", 1 << 20)
    (tmp_path / "room").mkdir()
    path = tmp_path / f"log.{suffix}.{packer.__name__}"
    with packer.open(path, "wb") as file:
        for _ in range(16):
            file.write(block)
    assert ROOM_PER_BYTE * path.stat().st_size < 15 << 20
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(DataError) as caught:
        load_variables(path)
    assert caught.value.codes in {("D505",), ("D506",)}
    assert caught.value.remedy
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100 << 10
    assert not any((tmp_path / "room").iterdir())


def test_the_folder_of_an_unpacked_log_goes_when_its_reader_is_killed(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "room"))
    (tmp_path / "room").mkdir()
    path = tmp_path / "log.h5.gz"
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["t"] = np.random.default_rng(1).normal(size=10**6)
    path.write_bytes(gzip.compress((tmp_path / "log.h5").read_bytes(), 1))
    reader = Reader(Limits(seconds=0.0, seconds_per_byte=0.0))
    monkeypatch.setattr(load, "READER", reader)
    with pytest.raises(DataError, match="D059"):
        load_variables(path)
    assert not any((tmp_path / "room").iterdir())


def test_a_line_that_does_not_end_is_refused(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(b"t,q\n" + b"0," * LONGEST_LINE)
    with pytest.raises(DataError, match="D506"):
        load_variables(path)


@pytest.mark.parametrize("suffix", ["csv", "h5", "db3"])
def test_a_pipe_is_refused_and_nobody_waits(tmp_path, suffix):
    path = tmp_path / f"log.{suffix}"
    os.mkfifo(path)
    errors = []

    def read():
        for look in (load_variables, read_contents):
            try:
                look(path)
            except DataError as error:
                errors.append(error.codes)

    reading = threading.Thread(target=read, daemon=True)
    reading.start()
    reading.join(5.0)
    assert errors == [("D504",)] * 2
    with pytest.raises(DataError, match="D504"):
        load_variables(tmp_path.joinpath("/dev/zero"))
