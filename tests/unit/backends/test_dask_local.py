"""The map on a local cluster keeps the contract of the others."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

import backend_tasks
from dask_cluster import wait_for
from robid.backends.dask import cluster
from robid.backends.map import Map, make_map
from robid.errors import DataError, RobidError


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("run")


@pytest.fixture(scope="module")
def ordered(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Map]:
    before, elsewhere = dict(os.environ), tmp_path_factory.mktemp("elsewhere")
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(tempfile, "tempdir", str(elsewhere))
        with make_map("dask", 2, folder=folder) as made:
            yield made
    assert list(folder.iterdir()) == []
    assert list(elsewhere.glob("*dask*")) == []
    assert {name: os.environ.get(name) for name in before if name != "PYTEST_CURRENT_TEST"} == {
        name: value for name, value in before.items() if name != "PYTEST_CURRENT_TEST"
    }


def test_results_keep_the_order_of_the_tasks(ordered: Map) -> None:
    done: dict[int, int] = {}
    assert ordered(backend_tasks.slow_first, range(5), done.__setitem__) == [0, 1, 4, 9, 16]
    assert ordered(backend_tasks.slow_first, []) == []
    assert done == {0: 0, 1: 1, 2: 4, 3: 9, 4: 16}


def test_workers_give_the_bytes_that_serial_gives_with_one_thread_each(ordered: Map) -> None:
    with make_map("serial", 1) as serial:
        assert serial(backend_tasks.matrix_product, range(3)) == ordered(backend_tasks.matrix_product, range(3))
    for threads in ordered(backend_tasks.blas_threads, range(2)):
        assert threads
        assert set(threads) == {1}
    workers = set(ordered(backend_tasks.process_id, range(8)))
    assert len(workers) <= 2
    assert os.getpid() not in workers


def test_an_error_of_a_task_arrives_whole(ordered: Map) -> None:
    with pytest.raises(DataError) as caught:
        ordered(backend_tasks.fail_at_two, range(5))
    assert (caught.value.what, caught.value.where) == ("Sample 7 is NaN.", "record.h5: torque")
    assert caught.value.remedy == "look at the log"
    assert "in fail_at_two" in str(caught.value.__cause__)
    assert ordered(backend_tasks.fail_at_two, [0, 1]) == [0, 1]


def test_an_error_that_cannot_travel_is_told_by_name(ordered: Map) -> None:
    with pytest.raises(RuntimeError, match="StrangeError: one and two"):
        ordered(backend_tasks.fail_strangely, [0])


def test_after_an_error_the_rest_is_dropped(ordered: Map, tmp_path: Path) -> None:
    def refuse(_: int, __: None) -> None:
        raise DataError("The disk is full.")

    with pytest.raises(DataError, match="disk is full"):
        ordered(backend_tasks.touch_slowly, [str(tmp_path / str(index)) for index in range(40)], refuse)
    assert ordered(backend_tasks.slow_first, [1]) == [1]
    assert 1 <= len(list(tmp_path.iterdir())) < 20


class Counted(Sequence[int]):
    """Tasks that are made when they are asked for; notes how many were."""

    def __init__(self, count: int) -> None:
        self.count, self.asked = count, 0

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, index: int) -> int:  # type: ignore[override]
        self.asked = max(self.asked, index + 1)
        return index


def test_few_tasks_are_at_the_scheduler_at_a_time(ordered: Map) -> None:
    tasks, ahead = Counted(60), []
    done: list[int] = []

    def note(index: int, _: int) -> None:
        ahead.append(tasks.asked - len(done))
        done.append(index)

    assert ordered(backend_tasks.slow_first, tasks, note)[-1] == 59 * 59
    assert sorted(done) == list(range(60))
    assert max(ahead) <= 6


def test_large_arrays_pass_through_the_folder_and_belong_to_the_task(ordered: Map, folder: Path) -> None:
    values, files = np.arange(50_000.0), []

    def note(_: int, __: float) -> None:
        files.append(len(list(folder.glob(".dask-*/*.npy"))))

    found = ordered(backend_tasks.sum_and_spoil, [(values, factor) for factor in range(8)], note)
    assert found == [values.sum() * factor for factor in range(8)]
    assert max(files) == 1
    assert list(folder.glob(".dask-*/*.npy")) == []


def test_interrupts_are_left_to_the_client(ordered: Map) -> None:
    workers = set(ordered(backend_tasks.slow_process_id, range(8)))
    for process in workers:
        os.kill(process, signal.SIGINT)
    assert set(ordered(backend_tasks.slow_process_id, range(8))) == workers


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="what a process blocks is read in /proc")
def test_workers_are_deaf_from_their_first_line_on_and_the_client_is_not(ordered: Map) -> None:
    def blocked(process: int) -> int:
        lines = Path(f"/proc/{process}/status").read_text().splitlines()
        return int(next(line.split()[1] for line in lines if line.startswith("SigBlk")), 16)

    interrupt = 1 << (signal.SIGINT - 1)
    for process in set(ordered(backend_tasks.process_id, range(8))):
        assert blocked(process) & interrupt
    assert not blocked(os.getpid()) & interrupt


def test_a_task_whose_worker_ends_is_done_again_on_another_one(ordered: Map, tmp_path: Path) -> None:
    notes = [str(tmp_path / str(index)) for index in range(2)]
    first, second = ordered(backend_tasks.die_once, notes)
    assert os.getpid() not in {first, second}


def test_a_task_that_ends_its_worker_again_and_again_is_named(ordered: Map) -> None:
    with pytest.raises(RobidError, match=r"Task 2 of 9 ended its worker 3 times; \d of 9") as caught:
        ordered(backend_tasks.die_at_one, range(9))
    assert caught.value.exit_code == 3
    assert "memory ran out: a worker has" in caught.value.remedy
    assert ordered(backend_tasks.slow_first, [3]) == [9]


def test_a_worker_that_takes_more_than_its_share_of_memory_is_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "MEMORY_LIMIT", 2**30)
    with make_map("dask", 1, folder=tmp_path) as small:
        assert small(backend_tasks.slow_first, [2]) == [4]
        with pytest.raises(RobidError, match="Task 1 of 1 ended its worker 3 times") as caught:
            small(backend_tasks.take_memory, [2**29])
    assert "memory ran out: a worker has 0.5 GiB, use fewer --workers" in caught.value.remedy


_PARENT = """
import sys
from pathlib import Path
import backend_tasks
from robid.backends.map import make_map
if __name__ == "__main__":
    with make_map("dask", 1, folder=Path(sys.argv[2])) as ordered:
        ordered(backend_tasks.sleep_long, sys.argv[1:2])
"""


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGKILL])
def test_workers_end_with_an_interrupted_or_killed_parent(tmp_path: Path, sent: signal.Signals) -> None:
    script, note, run = tmp_path / "parent.py", tmp_path / "worker", tmp_path / "run"
    script.write_text(_PARENT)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    parent = subprocess.Popen(
        [sys.executable, str(script), str(note), str(run)],
        stderr=subprocess.PIPE,
        env=environment,
        start_new_session=True,
    )
    try:
        wait_for(lambda: note.exists() and note.read_text() != "")
        worker = Path(f"/proc/{note.read_text()}")
        assert worker.exists()
        began = time.monotonic()
        if sent == signal.SIGINT:
            # As a terminal does: the workers get it, too.
            os.killpg(parent.pid, sent)
        else:
            parent.send_signal(sent)
        _, said = parent.communicate(timeout=30)
        assert parent.returncode == -sent
        wait_for(lambda: not worker.exists() or "Z" in worker.joinpath("stat").read_text().rpartition(")")[2][:3])
        assert time.monotonic() - began < 20
        if sent == signal.SIGINT:
            assert said.count(b"Traceback") == 1
            assert list(run.iterdir()) == []
        else:
            assert b"Traceback" not in said
    finally:
        parent.kill()
        parent.communicate()


_STARTING = """
import atexit, os, signal, sys, threading, time
from multiprocessing import util
from pathlib import Path
import backend_tasks
from distributed import Nanny
from robid.backends.map import make_map

async def before(nanny):
    Nanny.start_unsafe = start
    os.kill(os.getpid(), signal.SIGINT)
    return await start(nanny)

def within(*arguments):
    # As on a busy machine: a worker's process is there and waits for what it is to do.
    pid = begin(*arguments)
    if "AsyncProcess" in threading.current_thread().name:
        if sys.argv[1] == "within" and not interrupted:
            interrupted.append(pid)
            os.kill(os.getpid(), signal.SIGINT)
        time.sleep(2)
    return pid

if __name__ == "__main__":
    interrupted = []
    start, begin, util.spawnv_passfds = Nanny.start_unsafe, util.spawnv_passfds, within
    if sys.argv[1] == "before":
        atexit.register(time.sleep, 1) # time for a worker to begin, which none may take
        Nanny.start_unsafe = before
    with make_map("dask", 2, folder=Path()) as ordered:
        ordered(backend_tasks.process_id, [1])
"""


@pytest.mark.parametrize("when", ["before", "within"])
def test_a_cluster_that_is_interrupted_while_it_starts_ends_without_a_word_of_its_own(
    tmp_path: Path, when: str
) -> None:
    (tmp_path / "parent.py").write_text(_STARTING)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "parent.py", when]
    ended = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, env=environment, check=False, timeout=60
    )
    assert ended.returncode == -signal.SIGINT
    assert ended.stderr.count("Traceback") == 1
    assert "ignored" not in ended.stderr
