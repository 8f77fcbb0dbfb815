import os
import socket
import threading
import tracemalloc
from pathlib import Path

import pytest

from robid.files import NotRegularError, TooLargeError, check_regular, open_regular, read_regular


def test_a_file_is_read_whole_up_to_its_limit(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"0123456789")
    check_regular(path)
    assert read_regular(path, 10) == b"0123456789"
    with pytest.raises(TooLargeError):
        read_regular(path, 9)
    (tmp_path / "link").symlink_to(path)
    assert read_regular(tmp_path / "link") == b"0123456789"


def test_what_has_no_content_of_its_own_is_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(tmp_path / "socket"))
        for path in (tmp_path / "pipe", tmp_path / "socket", Path("/dev/zero"), Path("/dev/tty")):
            for read in (check_regular, open_regular, read_regular):
                with pytest.raises(NotRegularError):
                    read(path)
    for read in (check_regular, open_regular, read_regular):
        with pytest.raises(IsADirectoryError):
            read(tmp_path)
        with pytest.raises(FileNotFoundError):
            read(tmp_path / "absent")


def test_a_pipe_with_a_writer_is_refused_too(tmp_path):
    path = tmp_path / "pipe"
    os.mkfifo(path)
    reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    writer = threading.Thread(target=path.write_bytes, args=(b"a: 1\n",))
    writer.start()
    with pytest.raises(NotRegularError):
        read_regular(path)
    writer.join()
    os.close(reader)


def test_a_file_that_goes_on_without_end_is_read_up_to_the_limit():
    # It says to have no bytes, as every file of this folder does.
    with pytest.raises(TooLargeError):
        read_regular(Path("/proc/self/maps"), 100)


def test_a_small_file_takes_little_memory(tmp_path):
    path = tmp_path / "small"
    path.write_bytes(b"1" * 1000)
    tracemalloc.start()
    assert read_regular(path) == b"1" * 1000
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1 << 20
