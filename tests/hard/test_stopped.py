"""Commands that are killed or interrupted at any moment go on from there and leave what an undisturbed one leaves."""

import os
import signal
import sys
import time
from uuid import uuid4

import numpy as np
import pytest

import jobs
from hard_summary import SCALE, note

pytest.importorskip("pyarrow")
pytest.importorskip("distributed")
pytestmark = [
    pytest.mark.hard,
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="orphans are looked for in /proc"),
]

STOPS = max(1, round(50 * SCALE))
CASES = [(number, seed) for number in (signal.SIGKILL, signal.SIGINT) for seed in range(STOPS)]


@pytest.fixture(scope="module")
def truths(tmp_path_factory):
    return {name: jobs.truth_of(name, tmp_path_factory.mktemp(name) / "truth") for name in jobs.JOBS}


def attacked(number, seed, truths, folder):
    """Stops a command once or twice, then lets it run to its end; returns what was wrong."""
    generator = np.random.default_rng([int(number), seed])
    name, backend = list(jobs.JOBS)[seed % 3], jobs.BACKENDS[seed // 3 % 3]
    truth = truths[name]
    truth.job.make(folder)
    inputs = jobs.inputs_of(folder)
    for _ in range(int(generator.integers(1, 3))):
        whole_group, mark = bool(generator.integers(2)), uuid4().hex
        after = float(generator.uniform(0, 1.1 if backend != "dask" else 2)) * truth.seconds
        told = f"{name}, {backend}, {'group' if whole_group else 'process'} after {after:.2f} s"
        with jobs.started(jobs.command_of(truth.job, backend), folder, ROBID_ATTACK=mark) as process:
            time.sleep(after)
            (os.killpg if whole_group else os.kill)(process.pid, number)
            _, err = process.communicate(timeout=60)
            if number == signal.SIGINT and not (
                jobs.is_fine(process.returncode, err, 130) or _too_early(process.returncode, err)
            ):
                return f"{told}: {process.returncode}: {err[-1500:]}"
            if left := jobs.orphans(mark):
                return f"{told}: {len(left)} processes go on"
    other = jobs.ends_well(truth, folder, inputs, backend)
    return f"{told}: {other}" if other else ""


def _too_early(code, err):
    """The interpreter itself was not up: it ends by the signal, before any of ours runs."""
    return (code == -signal.SIGINT and "robid" not in err) or (code == 1 and "init_import_site" in err)


@pytest.mark.parametrize(("number", "seed"), CASES, ids=lambda value: str(getattr(value, "name", value)))
def test_a_stopped_command_goes_on_to_the_same_content(truths, number, seed, tmp_path):
    wrong = attacked(number, seed, truths, tmp_path)
    note(f"stopped {number.name}", seed, {seed: f"WRONG: {wrong}" if wrong else "same"})
