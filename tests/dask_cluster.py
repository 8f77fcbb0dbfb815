"""A Dask scheduler and workers as their users start them, on this machine."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

_START_S = 90.0


def wait_for(condition: Callable[[], bool], seconds: float = _START_S) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, f"waited {seconds:g} s in vain"
        time.sleep(0.05)


class Cluster:
    """Starts `dask scheduler` and `dask worker`, and ends what it started."""

    def __init__(self, folder: Path) -> None:
        self.folder, self._started = folder, list[subprocess.Popen[bytes]]()
        self._file = folder / "scheduler.json"
        self.scheduler = self._dask("scheduler", "--host", "127.0.0.1", "--port", "0", "--dashboard-address", ":0")
        wait_for(lambda: self._file.exists() and "tcp://" in self._file.read_text())
        found = self._file.read_text().partition('"address": "')[2]
        self.address = found.partition('"')[0]

    def worker(self, *options: str, **environment: str) -> subprocess.Popen[bytes]:
        options = options or ("--nthreads", "1")
        return self._dask("worker", "--no-dashboard", "--local-directory", str(self.folder), *options, **environment)

    def close(self) -> None:
        for process in reversed(self._started):
            # A worker ends with the nanny above it.
            process.kill()
            process.wait()

    def _dask(self, what: str, *options: str, **environment: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "dask", what, "--scheduler-file", str(self._file), *options]
        paths = os.pathsep.join([*environment.pop("first", "").split(), *sys.path])
        with (self.folder / f"{what}.log").open("ab") as log:
            process = subprocess.Popen(
                command,
                cwd=self.folder,
                env={**os.environ, "PYTHONPATH": paths, **environment},
                stdout=log,
                stderr=log,
            )
        self._started.append(process)
        return process


@contextmanager
def cluster(folder: Path) -> Iterator[Cluster]:
    made = Cluster(folder)
    try:
        yield made
    finally:
        made.close()
