"""Disks that fail: one message, nothing lost, and the same command then ends as on a good one."""

import pickle
import shutil
import subprocess
import sys

import pytest

import damage
import jobs
import poor_disks
from hard_summary import SCALE, note

pytest.importorskip("pyarrow")


def may_mount():
    command = ["unshare", "-rm", "mount", "-t", "tmpfs", "none", "/mnt"]
    return shutil.which("unshare") and not subprocess.run(command, check=False, capture_output=True).returncode


pytestmark = [pytest.mark.hard, pytest.mark.skipif(not may_mount(), reason="a disk of its own needs `unshare -rm`")]
COUNTS = {"small": 45, "read-only": 20, "gone": 20, "slow": 6}
CASES = [(how, seed) for how, count in COUNTS.items() for seed in range(max(1, round(SCALE * count)))]


@pytest.fixture(scope="module")
def truths(tmp_path_factory):
    """Files with what each job leaves, for processes of their own; a job is known by its name there."""
    found = {}
    for name in jobs.JOBS:
        folder = tmp_path_factory.mktemp(name)
        found[name] = folder / "truth.pickle"
        found[name].write_bytes(pickle.dumps(jobs.truth_of(name, folder / "truth")))
    return found


@pytest.mark.parametrize(("how", "seed"), CASES)
def test_a_poor_disk_loses_nothing(truths, how, seed, tmp_path):
    name = list(jobs.JOBS)[seed % 3]
    command = ["unshare", "-rm", sys.executable, "-m", "poor_disks", how, name, str(seed), tmp_path, truths[name]]
    done = subprocess.run(
        command, env=damage._environment(), capture_output=True, text=True, check=False, timeout=poor_disks.LONGEST_S
    )
    wrong = done.stdout or done.stderr
    note(f"disk {how}", seed, {seed: f"WRONG: {wrong}" if wrong else "same"})
