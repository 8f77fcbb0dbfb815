"""Files are written whole, or not at all."""

import os
import signal
import subprocess
import sys

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


_IN_A_THREAD = """
import sys, threading
from pathlib import Path
from robid.artifacts.layout import create_file

def write():
    with create_file(Path(sys.argv[1])) as file:
        file["there"] = 1

thread = threading.Thread(target=write)
thread.start()
thread.join()
"""


def test_threads_write_too(tmp_path):
    # In a process of its own: an interrupt of another test may have left HDF5's lock with the main thread.
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", _IN_A_THREAD, str(tmp_path / "b.h5")]
    subprocess.run(command, check=True, env=environment, timeout=60)
    with h5py.File(tmp_path / "b.h5") as file:
        assert file["there"][()] == 1
