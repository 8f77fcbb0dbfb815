"""Commands of seconds that attacks stop, starve and repeat: each with what it must leave, however it got there."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from uuid import uuid4

import damage
from damaged_folders import STAGES
from fleet_floor import MANIFEST, Floor
from robid.artifacts.store import read_header

DOCUMENTED = (0, 2, 3, 4, 5)
BACKENDS = ("serial", "processes", "dask")
_MARK = "ROBID_ATTACK"
_CHANGING = {"seconds", "finished_utc"}
_PATIENCE_S, _ORPHANS_S = 300.0, 20.0


class _Shop:
    def __init__(self, folder: Path) -> None:
        self.folder = folder


def _copy(*names: str) -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        for name in names:
            shutil.copy(STAGES / name, folder)

    return make


def _make_floor(folder: Path) -> None:
    Floor(_Shop(folder)).start({"soft": 0.9, "mean": 1.0, "hard": 1.1})


@dataclass(frozen=True)
class Job:
    """A command, what its folder needs, and where it works."""

    command: tuple[str, ...]
    make: Callable[[Path], None]
    runs: str

    def contents(self, folder: Path) -> dict[str, Any]:
        """What the command left, by content: nothing of it may depend on how it got there."""
        root = folder / self.runs
        found: dict[str, Any] = {
            str(path.relative_to(root)): read_header(path).content_sha256 for path in sorted(root.rglob("*.h5"))
        }
        if (root / "results.parquet").exists():
            import pyarrow.parquet as pq

            table = pq.read_table(root / "results.parquet")
            kept = [name for name in table.column_names if name not in _CHANGING]
            found["results.parquet"] = repr(table.select(kept).to_pylist())
        return found

    def names(self, folder: Path) -> set[str]:
        """The files that it left."""
        root = folder / self.runs
        return {str(path.relative_to(root)) for path in root.rglob("*") if path.is_file()}


JOBS = {
    "run": Job(("run", "small.yaml"), _copy("arm.yaml", "small.yaml"), "runs/small"),
    "reprocess": Job(("reprocess", MANIFEST, "fleet.yaml"), _make_floor, "runs/benches"),
    "study": Job(("study", "study.yaml"), _copy("arm.yaml", "study.yaml"), "runs/study"),
}


@dataclass(frozen=True)
class Truth:
    """What a job leaves where nothing disturbs it, and how long that takes."""

    name: str
    contents: dict[str, Any]
    names: set[str]
    seconds: float
    n_bytes: int

    @property
    def job(self) -> Job:
        return JOBS[self.name]

    def check(self, folder: Path) -> str:
        """Returns what is other in a folder than in that of the truth, or nothing."""
        found, names = self.job.contents(folder), self.job.names(folder)
        other = sorted(name for name in self.contents if found.get(name) != self.contents[name])
        if other or found.keys() != self.contents.keys():
            return f"other content in {other or sorted(found.keys() ^ self.contents.keys())}"
        return f"files {sorted(names ^ self.names)}" if names != self.names else ""


def truth_of(name: str, folder: Path) -> Truth:
    """Runs a job undisturbed."""
    job = JOBS[name]
    folder.mkdir(parents=True)
    job.make(folder)
    before = time.monotonic()
    code, text = run(job, folder)
    assert code in (0, 5), text
    n_bytes = sum(path.stat().st_size for path in (folder / job.runs).rglob("*") if path.is_file())
    return Truth(name, job.contents(folder), job.names(folder), time.monotonic() - before, n_bytes)


def command_of(job: Job, backend: str = "serial") -> list[str]:
    own = ["--backend", backend] if backend == "serial" else ["--backend", backend, "--workers", "2"]
    return [sys.executable, "-m", "robid", *job.command, *own]


def run(job: Job, folder: Path, backend: str = "serial", **environment: str) -> tuple[int, str]:
    """Runs a job to its end; returns the exit code and what it told."""
    with started(command_of(job, backend), folder, **environment) as process:
        _, err = process.communicate(timeout=_PATIENCE_S)
    return process.returncode, err


def inputs_of(folder: Path) -> dict[Path, bytes]:
    """The files that a job reads, which it may not change."""
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def ends_well(truth: Truth, folder: Path, inputs: dict[Path, bytes], backend: str = "serial") -> str:
    """Runs a job again after an attack; returns what is other than without one, or nothing."""
    code, err = run(truth.job, folder, backend)
    if code not in (0, 5):
        return f"the same command then ends with {code}: {err[-1500:]}"
    if any(path.read_bytes() != content for path, content in inputs.items()):
        return "an input was changed"
    return truth.check(folder)


@contextlib.contextmanager
def started(command: list[str], folder: Path, **environment: str) -> Iterator[subprocess.Popen[str]]:
    """A command in a session of its own; nothing of it stays."""
    own = {**damage._environment(), **environment, _MARK: environment.get(_MARK, uuid4().hex)}
    pipes: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, cwd=folder, env=own, start_new_session=True, **pipes) as process:
        try:
            yield process
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)


def is_fine(code: int, text: str, *allowed: int) -> bool:
    """Whether a command ended as it may: a documented code, one message where it refuses, and no traceback."""
    one = len(re.findall(r"^robid: ", text, re.MULTILINE)) == 1
    loose = re.search("Traceback|Exception ignored|Warning: |leaked", text)
    return code in (*DOCUMENTED, *allowed) and not loose and (one or code not in (2, 3, 4))


def orphans(mark: str) -> list[int]:
    """Processes of an attacked command that are alive some time after it ended."""
    deadline = time.monotonic() + _ORPHANS_S
    while (found := [pid for pid in _pids() if mark.encode() in _environ(pid)]) and time.monotonic() < deadline:
        time.sleep(0.1)
    for pid in found:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    return found


def _pids() -> list[int]:
    return [int(path.name) for path in Path("/proc").iterdir() if path.name.isdigit()]


def _environ(pid: int) -> bytes:
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/environ").read_bytes()
    return b""
