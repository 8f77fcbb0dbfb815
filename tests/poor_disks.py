"""Disks that are full after so many bytes, turn read-only, answer slowly or go: what a command in them says and keeps.

Run with root's rights in a mount namespace of its own, so that nothing but the command sees the disk:
`unshare -rm python -m poor_disks HOW JOB SEED FOLDER TRUTH`.
"""

from __future__ import annotations

import pickle
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np

import jobs

LONGEST_S = 600
_ROOMY = "1g"
_SLOW = """
import os, time
def slowed(call):
    def answer(*given, **named):
        time.sleep(0.02)
        return call(*given, **named)
    return answer
for name in ("open", "replace", "fsync", "scandir", "stat", "link", "unlink", "mkdir", "rename"):
    setattr(os, name, slowed(getattr(os, name)))
"""


def mount(folder: Path, options: str) -> None:
    subprocess.run(["mount", "-t", "tmpfs", "-o", options, "none", str(folder)], check=True)


def remount(folder: Path, options: str) -> bool:
    """Changes a disk; it cannot turn read-only while a file is open for writing."""
    command = ["mount", "-o", f"remount,{options}", str(folder)]
    return subprocess.run(command, check=False, capture_output=True).returncode == 0


def small(truth: jobs.Truth, folder: Path, generator: np.random.Generator) -> tuple[int, str, str]:
    """A disk that is full after N bytes."""
    size = int(generator.uniform(0, 1.6) * truth.n_bytes) // 4096 * 4096 + 4096
    remount(folder / "runs", f"size={size}")
    code, text = jobs.run(truth.job, folder, _backend(generator))
    remount(folder / "runs", f"size={_ROOMY}")
    return code, text, f"{size} of {truth.n_bytes} bytes"


def read_only(truth: jobs.Truth, folder: Path, generator: np.random.Generator) -> tuple[int, str, str]:
    """A disk that turns read-only at some moment."""

    def turn() -> None:
        while not remount(folder / "runs", "ro"):
            time.sleep(0.002)

    found = _meanwhile(truth, folder, generator, turn)
    remount(folder / "runs", "rw")
    return found


def gone(truth: jobs.Truth, folder: Path, generator: np.random.Generator) -> tuple[int, str, str]:
    """A run folder that goes while a command works in it, or is moved away."""
    moved = bool(generator.integers(2))

    def go() -> None:
        if moved and (folder / truth.job.runs).exists():
            (folder / truth.job.runs).rename(folder / "runs/away")
        else:
            shutil.rmtree(folder / truth.job.runs, ignore_errors=True)

    return _meanwhile(truth, folder, generator, go)


def slow(truth: jobs.Truth, folder: Path, generator: np.random.Generator) -> tuple[int, str, str]:
    """A disk on which opening, looking and renaming take 20 ms."""
    late = folder / "late"
    late.mkdir()
    (late / "sitecustomize.py").write_text(_SLOW, encoding="utf-8")
    paths = f"{late}:{jobs.damage._environment()['PYTHONPATH']}"
    code, text = jobs.run(truth.job, folder, _backend(generator), PYTHONPATH=paths)
    return code, text if code in (0, 5) else f"robid: WRONG: {text}", "slow"


def _backend(generator: np.random.Generator) -> str:
    return str(generator.choice(["serial", "processes"]))


def _meanwhile(truth, folder, generator, act) -> tuple[int, str, str]:  # type: ignore[no-untyped-def]
    after, backend = float(generator.uniform(0.1, 1.1)) * truth.seconds, _backend(generator)
    timer = threading.Timer(after, act)
    timer.start()
    code, text = jobs.run(truth.job, folder, backend)
    timer.cancel()
    timer.join()
    return code, text, f"{backend}, after {after:.2f} s"


DISKS = {"small": small, "read-only": read_only, "gone": gone, "slow": slow}


def attacked(how: str, name: str, seed: int, folder: Path, truth: jobs.Truth) -> str:
    """Runs a job on a poor disk, then on a good one; returns what was wrong."""
    generator = np.random.default_rng([list(DISKS).index(how), seed])
    truth.job.make(folder)
    (folder / "runs").mkdir()
    mount(folder / "runs", f"size={_ROOMY}")
    inputs = jobs.inputs_of(folder)
    code, text, told = DISKS[how](truth, folder, generator)
    told = f"{how}, {name}, {told}"
    if not jobs.is_fine(code, text):
        return f"{told}: {code}: {text[-1500:]}"
    other = jobs.ends_well(truth, folder, inputs)
    return f"{told}: {other}" if other else ""


if __name__ == "__main__":
    how, name, seed, folder, truth = sys.argv[1:]
    sys.stdout.write(attacked(how, name, int(seed), Path(folder), pickle.loads(Path(truth).read_bytes())))
