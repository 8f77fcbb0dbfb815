"""Where a cluster comes from: one of our own on this machine, or a scheduler that others have started."""

from __future__ import annotations

import os
import queue
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

import dask
from distributed import Client, LocalCluster
from distributed.system import MEMORY_LIMIT

from robid.backends.dask.checks import GUIDE, check_cluster
from robid.backends.dask.exchange import Exchange, shared_folder
from robid.backends.dask.mapping import DaskMap
from robid.backends.dask.quiet import SILENT, quiet
from robid.backends.dask.worker import DATA, Terms, versions_here
from robid.backends.threads import ONE_THREAD, environment
from robid.errors import BackendError, SettingsError

_CONNECT_S = 10
_LOCAL = {
    # A worker that is short of memory is ended, never paused for good; our results are small and need no spilling.
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": 0.95,
    "distributed.worker.profile.enabled": False,
    "distributed.scheduler.allowed-failures": 2,
    # Neither threads, which are ours to set, nor MALLOC_TRIM_THRESHOLD_, which makes large arrays slow.
    "distributed.nanny.pre-spawn-environ": {},
}
_QUIET = {"DASK_LOGGING__DISTRIBUTED": "critical"}


@contextmanager
def dask_map(
    workers: int, scheduler: str | None, folder: Path | None, inputs: Sequence[Path] = ()
) -> Iterator[Callable[..., list[Any]]]:
    """Yields a map over the workers of a scheduler, or of a local cluster that starts with the first task.

    Args:
        workers: Number of processes of a local cluster.
        scheduler: Address of a scheduler; a local cluster when None.
        folder: The run folder, which all workers must see.
        inputs: Further folders that all workers must see.

    Raises:
        BackendError: If the scheduler does not answer or its workers cannot be used.
        SettingsError: If the address is none.
    """
    with ExitStack() as stack:

        @cache
        def started() -> DaskMap:
            stack.enter_context(quiet())
            exchange = stack.enter_context(shared_folder(folder))
            seen = tuple(dict.fromkeys(str(path.absolute()) for path in inputs))
            data = os.environ.get(DATA)
            terms = Terms(versions_here(), str(Path.cwd()), str(exchange.folder), exchange.token, data, seen)
            if scheduler is None:
                client, memory = stack.enter_context(_local(workers, exchange))
                return DaskMap(client, "the local cluster", terms, exchange, memory)
            client = stack.enter_context(_remote(scheduler))
            check_cluster(client, scheduler, terms)
            return DaskMap(client, scheduler, terms, exchange, ": give each worker more")

        def mapped(
            function: Callable[[Any], Any], tasks: Sequence[Any], on_done: Callable[[int, Any], None] | None = None
        ) -> list[Any]:
            return started()(function, tasks, on_done) if tasks else []

        if scheduler is not None:
            started()
        yield mapped


@contextmanager
def _remote(address: str) -> Iterator[Client]:
    found = _connected(address)
    if isinstance(found, ValueError):
        remedy = "write it as in tcp://10.0.0.1:8786"
        raise SettingsError(f"`{address}` is no address of a scheduler: {found}", where="scheduler", remedy=remedy)
    if isinstance(found, Exception):
        raise BackendError(
            f"The scheduler does not answer within {_CONNECT_S} s.",
            where=address,
            remedy=f"check the address, and that `dask scheduler` runs there in the same versions; {GUIDE}",
        ) from found
    try:
        yield found
    finally:
        with suppress(Exception):
            found.close(timeout=2)


class _Closing(Client):  # type: ignore[misc]  # distributed has no types
    """A client that is closed where it cannot start.

    `Client` leaves some to the garbage collector, which may run while the next one starts: both wait for one lock.
    """

    async def _start(self, timeout: float) -> Client:
        try:
            return await super()._start(timeout)
        except BaseException:
            await self._close()
            raise


def _connected(address: str) -> Client | Exception:
    """Connects in a thread: towards a server that accepts and says nothing, `Client` waits for ever."""
    answer: queue.SimpleQueue[Client | Exception] = queue.SimpleQueue()

    def connect() -> None:
        try:
            answer.put(_Closing(address, timeout=_CONNECT_S, set_as_default=False))
        except Exception as error:  # noqa: BLE001  raised by the one that waits
            answer.put(error)

    threading.Thread(target=connect, daemon=True).start()
    try:
        return answer.get(timeout=_CONNECT_S + 1)
    except queue.Empty:
        return TimeoutError(address)


@contextmanager
def _local(workers: int, exchange: Exchange) -> Iterator[tuple[Client, str]]:
    """A cluster on the loopback interface; what it may use of memory is said in words."""
    limit = MEMORY_LIMIT // (workers + 1)
    memory = f": a worker has {limit / 2**30:.1f} GiB, use fewer --workers"
    scratch = {"temporary-directory": str(exchange.scratch)}
    with environment({**ONE_THREAD, **_QUIET}), dask.config.set({**_LOCAL, **scratch}), ExitStack() as stack:
        try:
            cluster = LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",
                memory_limit=limit,
                silence_logs=SILENT,
                preload=["robid.backends.dask.worker"],
            )
            stack.callback(cluster.close, timeout=10)
            client = stack.enter_context(Client(cluster, set_as_default=False))
        except (OSError, RuntimeError) as error:
            message = f"The local Dask cluster did not start: {str(error).rstrip('.')}."
            raise BackendError(message, remedy="use --backend processes") from error
        try:
            yield client, memory
        except BaseException:
            _kill(cluster)
            raise


def _kill(cluster: LocalCluster) -> None:
    """Ends the workers at once, whatever they are doing."""
    for nanny in cluster.workers.values():
        nanny.auto_restart = False
        if nanny.pid:
            with suppress(ProcessLookupError):
                os.kill(nanny.pid, signal.SIGKILL)
