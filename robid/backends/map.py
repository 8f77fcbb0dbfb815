"""An ordered map over independent tasks; one BLAS thread per worker, so that results do not depend on the backend."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from typing import Literal, Protocol, TypeVar

from threadpoolctl import threadpool_limits

from robid.errors import RobidError

Task = TypeVar("Task")
Result = TypeVar("Result")

_THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)


class Map(Protocol):
    """Applies a function to tasks and returns the results in the order of the tasks."""

    def __call__(
        self,
        function: Callable[[Task], Result],
        tasks: Sequence[Task],
        on_done: Callable[[int, Result], None] | None = None,
    ) -> list[Result]:
        """Runs the tasks.

        Args:
            function: What to do with each task; for processes, a function of a module.
            tasks: Its arguments.
            on_done: Called here with index and result as each task finishes, in any order.

        Raises:
            RobidError: If a worker process dies.
            Exception: What the first failing task or `on_done` raised; tasks not begun are dropped.
        """


@contextmanager
def make_map(backend: Literal["serial", "processes"], workers: int) -> Iterator[Map]:
    """Yields a map; leaving the context by an exception, an interrupt included, kills the workers.

    Args:
        backend: `serial` runs in this process, `processes` in spawned ones, which stay for further maps.
        workers: Number of processes.
    """
    if backend == "serial":
        yield _map_serially
        return
    executor = ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), _start_worker)
    try:
        yield partial(_map_in_processes, executor)
    except BaseException:
        for process in list((executor._processes or {}).values()):
            process.kill()
        raise
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def _map_serially(
    function: Callable[[Task], Result], tasks: Sequence[Task], on_done: Callable[[int, Result], None] | None = None
) -> list[Result]:
    results = []
    with threadpool_limits(1):
        for index, task in enumerate(tasks):
            results.append(function(task))
            if on_done is not None:
                on_done(index, results[-1])
    return results


def _map_in_processes(
    executor: ProcessPoolExecutor,
    function: Callable[[Task], Result],
    tasks: Sequence[Task],
    on_done: Callable[[int, Result], None] | None = None,
) -> list[Result]:
    indices = {}
    results: dict[int, Result] = {}
    try:
        with _one_thread_each():
            for index, task in enumerate(tasks):
                indices[executor.submit(function, task)] = index
        for future in as_completed(indices):
            index = indices[future]
            results[index] = future.result()
            if on_done is not None:
                on_done(index, results[index])
    except BrokenProcessPool as error:
        raise RobidError(
            "A worker process ended before its task was done.",
            where=f"{len(results)} of {len(tasks)} tasks were done",
            remedy="most often memory ran out: use fewer --workers or --backend serial; finished parts are kept",
        ) from error
    finally:
        for future in indices:
            future.cancel()
    return [results[index] for index in range(len(tasks))]


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Lets processes that are started meanwhile load BLAS with one thread."""
    before = {name: os.environ.get(name) for name in _THREAD_VARIABLES}
    os.environ.update(dict.fromkeys(_THREAD_VARIABLES, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _start_worker() -> None:
    """Leaves interrupts to the parent, ends with it, and limits libraries that ignored the environment."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    threadpool_limits(1)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
