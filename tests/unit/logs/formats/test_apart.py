"""The process that reads binary logs: a reader that crashes, hangs or devours memory ends in one message."""

import os

import numpy as np
import pytest

from robid.errors import DataError
from robid.logs.formats import load as apart
from robid.logs.formats import variables as known
from robid.logs.formats.load import Limits, Reader
from robid.logs.formats.variables import Format


@pytest.fixture
def reader(monkeypatch):
    table = {**known.EVERY, "toy": Format("a toy", "reader_of_nothing:read", ())}
    monkeypatch.setattr(apart, "EVERY", table)
    reader = Reader(Limits(seconds=8.0, memory=2 << 30))
    yield reader
    reader.close()


def read(reader, folder, deed, names=None):
    (folder / "log.toy").write_text(deed)
    return reader.read(folder / "log.toy", "toy", names)


def process_of(reader):
    return reader._process.pid


def test_one_process_reads_log_after_log(tmp_path, reader):
    found = read(reader, tmp_path, "print")
    np.testing.assert_array_equal(found.arrays["here"], np.arange(6.0).reshape(3, 2))
    assert found.unreadable["text"].what.startswith("D086")
    process = process_of(reader)
    assert process != os.getpid()
    np.testing.assert_array_equal(read(reader, tmp_path, "", ["here(:,2)"]).arrays["here(:,2)"], [1, 3, 5])
    assert process_of(reader) == process


@pytest.mark.skipif(os.name == "nt", reason="signals and memory limits are those of POSIX")
@pytest.mark.parametrize(
    ("deed", "words"),
    [("crash", r"crashed its reader \(SIGSEGV\)"), ("devour", "asks for more than 2 GB of memory")],
)
def test_a_reader_that_fails_is_told_and_the_next_log_is_read(tmp_path, reader, deed, words):
    with pytest.raises(DataError, match=words) as caught:
        read(reader, tmp_path, deed)
    assert caught.value.where == str(tmp_path / "log.toy")
    assert caught.value.remedy
    assert "here" in read(reader, tmp_path, "").arrays


def test_a_reader_that_hangs_is_ended(tmp_path, reader):
    read(reader, tmp_path, "")
    reader._limits = Limits(seconds=0.2)
    with pytest.raises(DataError, match="took longer than 0 s"):
        read(reader, tmp_path, "hang")
    reader._limits = Limits()
    assert "here" in read(reader, tmp_path, "").arrays


def test_a_relative_path_is_that_of_the_asking_process(tmp_path, reader, monkeypatch):
    read(reader, tmp_path, "")
    monkeypatch.chdir(tmp_path)
    assert "here" in reader.read((tmp_path / "log.toy").relative_to(tmp_path), "toy", None).arrays


def test_an_interrupt_ends_the_process(tmp_path, reader, monkeypatch):
    read(reader, tmp_path, "")

    def interrupt(*_):
        raise KeyboardInterrupt

    talk = apart._talk
    monkeypatch.setattr(apart, "_talk", interrupt)
    with pytest.raises(KeyboardInterrupt):
        read(reader, tmp_path, "")
    assert reader._process is None
    monkeypatch.setattr(apart, "_talk", talk)
    assert "here" in read(reader, tmp_path, "").arrays
