"""An ordered map over independent tasks, and where it tells how far it is.

One BLAS thread per worker, so that results do not depend on the backend.
"""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Literal, Protocol, TypeVar

from threadpoolctl import threadpool_limits

from robid.backends.threads import ONE_THREAD, environment
from robid.errors import WorkerError
from robid.interrupts import deaf_children, stop_if_interrupted

_COLLECTED = 700, 10, 10
"""Thresholds of garbage collection while tasks run, as Python starts with.

Those of a start hardly ever look for cycles, which hold arrays: a worker grew by half a gigabyte with each elastic fit.
"""


class Progress(Protocol):
    """Where a stage tells how far it is."""

    def expect(self, total: int, unit: str, done: int = 0) -> None:
        """Says how many tasks there are, and how many of them an earlier run did; with 0, what is done uncounted."""

    def advance(self) -> None:
        """Says that one more is done."""

    def warn(self, text: str) -> None:
        """Tells what the user should know before using the result."""


Task = TypeVar("Task")
Result = TypeVar("Result")


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
            function: What to do with each task; for processes and Dask, a function of a module.
            tasks: Its arguments.
            on_done: Called here with index and result as each task finishes, in any order.

        Raises:
            BackendError: If a cluster is lost.
            WorkerError: If a worker process dies of a task.
            Exception: What the first failing task or `on_done` raised; tasks not begun are dropped.
        """


@contextmanager
def make_map(
    backend: Literal["serial", "processes", "dask"],
    workers: int,
    *,
    scheduler: str | None = None,
    folder: Path | None = None,
    inputs: Sequence[Path] = (),
) -> Iterator[Map]:
    """Yields a map; leaving the context by an exception, an interrupt included, kills the workers that it started.

    Args:
        backend: `serial` runs in this process, `processes` in spawned ones, which stay for further maps, `dask` on
            the workers of a scheduler or of a local cluster.
        workers: Number of processes; a scheduler has its own.
        scheduler: Address of a Dask scheduler.
        folder: The run folder, which Dask workers must see; large arrays of tasks pass through it.
        inputs: Further folders that Dask workers must see, as tasks read from them.

    Raises:
        ArtifactError: If that folder cannot be written.
        BackendError: If the scheduler does not answer, or its workers cannot be used.
        SettingsError: If the address is none.
    """
    gc.set_threshold(*_COLLECTED)
    if backend == "serial":
        yield _map_serially
    elif backend == "dask":
        from robid.backends.dask.cluster import dask_map

        with dask_map(workers, scheduler, folder, inputs) as mapped:
            yield mapped
    else:
        with _processes(workers) as mapped:
            yield mapped


@contextmanager
def _processes(workers: int) -> Iterator[Map]:
    executor, is_whole = ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), _start_worker), True
    try:
        yield partial(_map_in_processes, executor)
    except BaseException:
        is_whole = False
        for process in list((executor._processes or {}).values()):
            process.kill()
        raise
    finally:
        executor.shutdown(wait=True, cancel_futures=is_whole)


def _map_serially(
    function: Callable[[Task], Result], tasks: Sequence[Task], on_done: Callable[[int, Result], None] | None = None
) -> list[Result]:
    results = []
    with threadpool_limits(1):
        for index, task in enumerate(tasks):
            stop_if_interrupted()
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
        with environment(ONE_THREAD), deaf_children():
            for index, task in enumerate(tasks):
                indices[executor.submit(function, task)] = index
        for future in as_completed(indices):
            index = indices[future]
            results[index] = future.result()
            if on_done is not None:
                on_done(index, results[index])
    except BrokenProcessPool as error:
        what = "B010 A worker process ended before its task was done."
        remedy = "most often memory ran out: use fewer --workers or --backend serial; finished parts are kept"
        raise WorkerError(what, where=f"{len(results)} of {len(tasks)} tasks were done", remedy=remedy) from error
    except Exception:
        # Not after an interrupt: workers are killed, and the executor's thread fails over cancelled futures.
        for future in indices:
            future.cancel()
        raise
    return [results[index] for index in range(len(tasks))]


def _start_worker() -> None:
    """Leaves interrupts to the parent, ends with it, and limits libraries that ignored the environment."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    gc.set_threshold(*_COLLECTED)
    threadpool_limits(1)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
