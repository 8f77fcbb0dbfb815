"""Clusters that lose workers or their scheduler at any moment, or have another version: told once, nothing lost."""

import contextlib
import os
import signal
import threading

import numpy as np
import pytest

pytest.importorskip("pyarrow")
pytest.importorskip("distributed")

import jobs
from dask_cluster import cluster
from hard_summary import SCALE, note

pytestmark = pytest.mark.hard
LOSSES = ("a worker", "a process of a worker", "the scheduler", "all workers", "a worker is frozen")
CASES = [(how, seed) for how in LOSSES for seed in range(max(1, round(6 * SCALE)))]
_OTHER_VERSION = """
import sys
class Older:
    def find_spec(self, name, *_):
        if name == "robid.versions":
            import importlib.util, robid
            spec = importlib.util.spec_from_file_location(name, robid.__path__[0] + "/versions.py")
            found = spec.loader.exec_module
            def changed(module):
                found(module)
                module.__version__ = "0.0.1"
            spec.loader.exec_module = changed
            return spec
sys.meta_path.insert(0, Older())
"""


@pytest.fixture(scope="module")
def truths(tmp_path_factory):
    return {name: jobs.truth_of(name, tmp_path_factory.mktemp(name) / "truth") for name in jobs.JOBS}


def on_cluster(job, address):
    return [*jobs.command_of(job), "--backend", "dask", "--scheduler", address]


def lose(how, made, workers):
    """Takes from a cluster what it loses."""
    if how == "the scheduler":
        made.scheduler.kill()
    elif how == "a process of a worker":  # which its nanny starts again
        kill_children(workers[0].pid)
    elif how == "a worker is frozen":
        for pid in (workers[0].pid, *children(workers[0].pid)):
            os.kill(pid, signal.SIGSTOP)
        threading.Timer(3, kill, [workers[0]]).start()
    else:
        for worker in workers if how == "all workers" else workers[:1]:
            kill(worker)


def kill(worker):
    kill_children(worker.pid)
    worker.kill()
    worker.wait()


def children(pid):
    with contextlib.suppress(OSError), open(f"/proc/{pid}/task/{pid}/children") as file:  # noqa: PTH123
        return [int(child) for child in file.read().split()]
    return []


def kill_children(pid):
    for child in children(pid):
        with contextlib.suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)


def attacked(how, seed, truths, folder):
    generator = np.random.default_rng([LOSSES.index(how), seed])
    truth = truths[list(jobs.JOBS)[seed % 3]]
    truth.job.make(folder)
    inputs = jobs.inputs_of(folder)
    (folder / "cluster").mkdir()
    after = float(generator.uniform(0.2, 2)) * truth.seconds
    told = f"{how}, {truth.name}, after {after:.2f} s"
    with cluster(folder / "cluster") as made:
        workers = [made.worker(), made.worker()]
        with jobs.started(on_cluster(truth.job, made.address), folder) as process:
            timer = threading.Timer(after, lose, [how, made, workers])
            timer.start()
            if how == "all workers":
                # The cluster is there as long as its scheduler: it waits for workers, as a queue may bring them.
                later = threading.Timer(after + 5, made.worker)
                later.start()
            _, err = process.communicate(timeout=240)
            timer.cancel()
            if how == "all workers":
                later.cancel()
                later.join()
        if not jobs.is_fine(process.returncode, err):
            return f"{told}: {process.returncode}: {err[-1500:]}"
        if how.startswith("a ") and process.returncode not in (0, 5):
            return f"{told}: the other worker does not go on: {process.returncode}: {err[-1500:]}"
    other = jobs.ends_well(truth, folder, inputs)
    return f"{told}: {other}" if other else ""


@pytest.mark.parametrize(("how", "seed"), CASES)
def test_a_cluster_that_loses_something_loses_nothing_finished(truths, how, seed, tmp_path):
    wrong = attacked(how, seed, truths, tmp_path)
    note(f"cluster {how}", seed, {seed: f"WRONG: {wrong}" if wrong else "same"})


def test_a_worker_of_another_version_is_refused_by_name(truths, tmp_path):
    job = truths["run"].job
    job.make(tmp_path)
    (tmp_path / "older").mkdir()
    (tmp_path / "older/sitecustomize.py").write_text(_OTHER_VERSION, encoding="utf-8")
    with cluster(tmp_path / "older") as made:
        made.worker(first=str(tmp_path / "older"))
        with jobs.started(on_cluster(job, made.address), tmp_path) as process:
            _, err = process.communicate(timeout=120)
    assert process.returncode == 3
    assert jobs.is_fine(process.returncode, err)
    assert "robid 0.0.1 instead of" in err
    note("cluster version", 0, {0: "refused"})
