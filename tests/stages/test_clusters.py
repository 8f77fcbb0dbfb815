"""The jobs of the page on clusters, run with stand-ins for what a queue does: each starts its part on this machine."""

import contextlib
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import h5py
import pytest

pytest.importorskip("distributed")

STAGES = Path(__file__).parent
PAGE = STAGES.parents[1] / "docs/how-to/clusters.md"
STAND_INS = {
    "srun": 'shift\n"$@" &\n"$@" &\nwait',
    "hostname": "echo 127.0.0.1",
    "sbatch": 'setsid bash -c "$(cat "$1")" > /dev/null 2>&1 &\necho "Submitted batch job $!"',
    "scancel": 'for job in "$@"; do kill -- -"$job"; done',
}


FENCE = re.compile(r"^```\w*\n(.*?)^```", re.MULTILINE | re.DOTALL)


def block(mark):
    """The page's code that has a mark."""
    return next(text for text in FENCE.findall(PAGE.read_text(encoding="utf-8")) if mark in text)


def free_port():
    with socket.socket() as held:
        held.bind(("127.0.0.1", 0))
        return str(held.getsockname()[1])


@pytest.fixture
def machine(tmp_path, monkeypatch):
    """A folder with an experiment, and a queue that is this machine."""
    commands = tmp_path / "commands"
    commands.mkdir()
    for name, script in STAND_INS.items():
        (commands / name).write_text(f"#!/bin/bash\n{script}\n", encoding="utf-8")
        (commands / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{commands}:{Path(sys.executable).parent}:{os.environ['PATH']}")
    for name in ("arm.yaml", "small.yaml"):
        shutil.copy(STAGES / name, tmp_path)
    (tmp_path / ".venv" / "bin").mkdir(parents=True)
    (tmp_path / ".venv" / "bin" / "activate").touch()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def is_made(folder):
    with h5py.File(folder / "runs/small/fits/elastic/model.h5") as held:
        return "content_sha256" in held.attrs


def test_the_slurm_job_runs_scheduler_workers_and_command(machine):
    job = block("#SBATCH").replace("8786", free_port()).replace("EXPERIMENT.yaml", "small.yaml")
    with started("bash", "-c", job) as holder:
        assert holder.wait(300) == 0
    assert is_made(machine)


@pytest.mark.skipif(find_spec("dask_jobqueue") is None, reason="dask-jobqueue is not installed")
def test_jobs_of_a_queue_are_workers(machine):
    script, changed = re.subn(r"jobs=\d+", "jobs=2", block("SLURMCluster"))
    assert changed == 1
    with started(sys.executable, "-c", script) as holder:
        address = holder.stdout.readline().strip()
        command = ["robid", "run", "small.yaml", "--backend", "dask", "--scheduler", address]
        done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
        assert done.returncode == 0, done.stderr
        holder.communicate("\n", timeout=60)
        assert holder.returncode == 0
    assert is_made(machine)


@contextlib.contextmanager
def started(*command):
    """A process whose children end with it."""
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        try:
            yield process
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
