"""Tasks for worker processes, which can only run functions of importable modules."""

import os
import time

import numpy as np
from threadpoolctl import threadpool_info

from robid.errors import DataError


def slow_first(task: int) -> int:
    """The earlier the task, the later it ends."""
    time.sleep(0.1 if task == 0 else 0.0)
    return task * task


def matrix_product(seed: int) -> bytes:
    matrix = np.random.default_rng(seed).standard_normal((300, 300))
    return (matrix @ matrix.T).tobytes()


def blas_threads(_: int) -> list[int]:
    np.linalg.norm(np.ones((4, 4)) @ np.ones((4, 4)))
    return [library["num_threads"] for library in threadpool_info()]


def fail_at_two(task: int) -> int:
    if task == 2:
        raise DataError("Sample 7 is NaN.", where="record.h5: torque", remedy="look at the log")
    return task


def wait_for_file(path: str) -> None:
    """Ends when the file is there; an empty path is no file to wait for."""
    deadline = time.monotonic() + 30
    while path and not os.path.exists(path):  # noqa: PTH110
        if time.monotonic() > deadline:
            raise TimeoutError(path)
        time.sleep(0.02)


def touch_slowly(path: str) -> None:
    time.sleep(0.1)
    with open(path, "w", encoding="utf-8"):  # noqa: PTH123
        pass


def die(_: int) -> None:
    os._exit(3)


def process_id(_: int) -> int:
    return os.getpid()


def slow_process_id(_: int) -> int:
    """So slow that all workers get some."""
    time.sleep(0.1)
    return os.getpid()


def sleep_long(path: str) -> None:
    with open(path, "w", encoding="utf-8") as file:  # noqa: PTH123
        file.write(str(os.getpid()))
    time.sleep(600)


def sum_and_spoil(task: tuple[np.ndarray, int]) -> float:
    """Its argument is its own: what it writes there reaches nobody."""
    values, factor = task
    total = float(values.sum()) * factor
    values[:] = 0
    return total


def describe(values: np.ndarray) -> tuple[str, tuple[int, ...], bool, bytes]:
    return values.dtype.str, values.shape, values.flags.f_contiguous, values.tobytes()


def die_once(note: str) -> int:
    """Ends its process the first time, having said so."""
    if not os.path.exists(note):  # noqa: PTH110
        touch_slowly(note)
        os._exit(3)
    return os.getpid()


def die_at_one(task: int) -> int:
    """Task 1 ends its process; the others are still at work then, or wait."""
    if task == 1:
        os._exit(3)
    time.sleep(0.3)
    return task


def fail_strangely(_: int) -> None:
    raise StrangeError("one", "two")


def read_and_wait(path: str) -> str:
    time.sleep(0.3)
    with open(path, encoding="utf-8") as file:  # noqa: PTH123
        return file.read()


def take_memory(n_bytes: int) -> None:
    held = np.ones(n_bytes, np.uint8)
    time.sleep(30)
    del held


class StrangeError(Exception):
    """Cannot be rebuilt from its arguments, so that pickle cannot carry it."""

    def __init__(self, first: str, second: str) -> None:
        super().__init__(f"{first} and {second}")


class _Cycle:
    """Something large that refers to itself: only a search for cycles frees it."""

    alive = 0

    def __init__(self) -> None:
        self.own = self
        _Cycle.alive += 1

    def __del__(self) -> None:
        _Cycle.alive -= 1


def cycles_left(count: int) -> int:
    """How many of some cycles are still there after as many objects as a fit leaves."""
    for _ in range(count):
        _Cycle()
    kept: list[list[int]] = [[] for _ in range(50_000)]
    return _Cycle.alive if kept else 0
