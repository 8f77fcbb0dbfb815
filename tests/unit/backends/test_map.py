"""Backends: the same results in the same order wherever tasks run, and no worker left behind."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

import backend_tasks
from robid.backends.map import make_map
from robid.errors import DataError, RobidError

BACKENDS = ["serial", "processes"]


@pytest.mark.parametrize("backend", BACKENDS)
def test_results_keep_the_order_of_the_tasks(backend: str) -> None:
    done: dict[int, int] = {}
    with make_map(backend, 2) as ordered:
        results = ordered(backend_tasks.slow_first, range(5), done.__setitem__)
        assert ordered(backend_tasks.slow_first, []) == []
    assert results == [0, 1, 4, 9, 16]
    assert done == {0: 0, 1: 1, 2: 4, 3: 9, 4: 16}


def test_on_done_is_called_as_tasks_finish(tmp_path: Path) -> None:
    order: list[int] = []
    signal_file = tmp_path / "second is done"

    def note(index: int, _: None) -> None:
        order.append(index)
        signal_file.touch()

    with make_map("processes", 2) as ordered:
        ordered(backend_tasks.wait_for_file, [str(signal_file), ""], note)
    assert order == [1, 0]


def test_processes_give_the_bytes_that_serial_gives_with_one_thread_each() -> None:
    before = dict(os.environ)
    with make_map("serial", 1) as serial, make_map("processes", 2) as processes:
        assert serial(backend_tasks.matrix_product, range(3)) == processes(backend_tasks.matrix_product, range(3))
        for ordered in (serial, processes):
            for threads in ordered(backend_tasks.blas_threads, range(2)):
                assert threads
                assert set(threads) == {1}
    assert dict(os.environ) == before


def test_processes_run_elsewhere_and_are_kept_for_the_next_map() -> None:
    with make_map("processes", 1) as ordered:
        first, second = ordered(backend_tasks.process_id, [0]), ordered(backend_tasks.process_id, [0])
    assert first == second != [os.getpid()]


@pytest.mark.parametrize("backend", BACKENDS)
def test_an_error_of_a_task_arrives_whole(backend: str) -> None:
    done: list[int] = []
    with make_map(backend, 1) as ordered:
        with pytest.raises(DataError) as caught:
            ordered(backend_tasks.fail_at_two, range(5), lambda index, _: done.append(index))
        assert ordered(backend_tasks.fail_at_two, [0, 1]) == [0, 1]
    assert (caught.value.what, caught.value.where) == ("Sample 7 is NaN.", "record.h5: torque")
    assert caught.value.remedy == "look at the log"
    assert set(done) <= {0, 1}


@pytest.mark.parametrize("backend", BACKENDS)
def test_after_an_error_the_rest_is_dropped(backend: str, tmp_path: Path) -> None:
    def refuse(_: int, __: None) -> None:
        raise DataError("The disk is full.")

    paths = [str(tmp_path / str(index)) for index in range(40)]
    with make_map(backend, 1) as ordered, pytest.raises(DataError, match="disk is full"):
        ordered(backend_tasks.touch_slowly, paths, refuse)
    assert 1 <= len(list(tmp_path.iterdir())) < 20


@pytest.mark.parametrize("backend", ["serial", "processes"])
def test_tasks_leave_no_cycles_behind_though_a_start_hardly_looks_for_any(backend: str, tmp_path: Path) -> None:
    """Workers begin as the program does that starts them."""
    script = tmp_path / "script.py"
    script.write_text(
        "import robid.__main__\n"
        "import backend_tasks\n"
        "from robid.backends.map import make_map\n"
        "if __name__ == '__main__':\n"
        f"    with make_map({backend!r}, 1) as mapped:\n"
        "        print(mapped(backend_tasks.cycles_left, [1000])[0])\n"
    )
    paths = os.pathsep.join(sys.path)
    done = subprocess.run(
        [sys.executable, script], capture_output=True, text=True, check=True, env={**os.environ, "PYTHONPATH": paths}
    )
    assert int(done.stdout) < 1000


def test_a_worker_that_dies_is_one_clear_error() -> None:
    with pytest.raises(RobidError, match="worker process ended") as caught, make_map("processes", 1) as ordered:
        ordered(backend_tasks.die, range(3))
    assert "--workers" in caught.value.remedy


_PARENT = """
import sys
import backend_tasks
from robid.backends.map import make_map
if __name__ == "__main__":
    with make_map("processes", 1) as ordered:
        ordered(backend_tasks.sleep_long, sys.argv[1:])
"""


@pytest.mark.parametrize(("sent", "code"), [(signal.SIGINT, -signal.SIGINT), (signal.SIGKILL, -signal.SIGKILL)])
def test_workers_end_with_an_interrupted_or_killed_parent(tmp_path: Path, sent: signal.Signals, code: int) -> None:
    script, note = tmp_path / "parent.py", tmp_path / "worker"
    script.write_text(_PARENT)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    parent = subprocess.Popen([sys.executable, str(script), str(note)], stderr=subprocess.PIPE, env=environment)
    try:
        _wait(lambda: note.exists() and note.read_text() != "")
        worker = int(note.read_text())
        assert _alive(worker)
        parent.send_signal(sent)
        parent.communicate(timeout=20)
        assert parent.returncode == code
        _wait(lambda: not _alive(worker))
    finally:
        parent.kill()
        parent.communicate()


def _wait(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < deadline, "waited 30 s in vain"
        time.sleep(0.02)


def _alive(process: int) -> bool:
    """Whether a process runs; one that has ended but was not collected does not."""
    status = Path(f"/proc/{process}/stat")
    try:
        return status.read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False
