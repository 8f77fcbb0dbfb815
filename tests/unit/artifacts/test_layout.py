"""Files are written whole, or not at all."""

import os
import signal
import threading

import h5py
import numpy as np
import pytest

from robid.artifacts.layout import create_file


def test_an_interrupt_waits_until_a_file_is_whole(tmp_path):
    path, before = tmp_path / "a.h5", signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt), create_file(path) as file:  # noqa: PT012
        os.kill(os.getpid(), signal.SIGINT)
        file["later"] = np.arange(5)
    with h5py.File(path) as file:
        np.testing.assert_array_equal(file["later"][:], np.arange(5))
    assert signal.getsignal(signal.SIGINT) is before


def test_threads_write_too(tmp_path):
    def write():
        with create_file(tmp_path / "b.h5") as file:
            file["there"] = 1

    thread = threading.Thread(target=write)
    thread.start()
    thread.join()
    with h5py.File(tmp_path / "b.h5") as file:
        assert file["there"][()] == 1
