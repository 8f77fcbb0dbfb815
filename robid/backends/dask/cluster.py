"""Where a cluster comes from, our own on this machine or a scheduler that others have started, and the map over it."""

from __future__ import annotations

import logging
import os
import queue
import signal
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import dask
from distributed import Client, KilledWorker, LocalCluster
from distributed.deploy.spec import SpecCluster
from distributed.system import MEMORY_LIMIT
from distributed.utils import LoopRunner
from distributed.versions import VersionMismatchWarning

from robid.backends.dask.exchange import Exchange, Packer, remove_left, shared_folder
from robid.backends.dask.worker import (
    DATA,
    GUIDE,
    Done,
    Failed,
    Refused,
    Terms,
    check_cluster,
    perform,
    refusal,
    versions_here,
)
from robid.backends.threads import ONE_THREAD, environment
from robid.errors import BackendError, SettingsError, WorkerError
from robid.interrupts import deaf_children

if TYPE_CHECKING:
    from distributed import Client, Future
    from tornado.ioloop import IOLoop


SILENT = logging.CRITICAL + 1
_ROOTS = ("asyncio", "distributed", "tornado")


@contextmanager
def quiet() -> Iterator[None]:
    """Silences the libraries beneath; levels and filters are as before afterwards."""
    names = [*_ROOTS, *(name for name in logging.root.manager.loggerDict if name.startswith(_ROOTS))]
    levels = {name: logging.getLogger(name).level for name in names}
    for name in names:
        logging.getLogger(name).setLevel(SILENT)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", VersionMismatchWarning)
            warnings.filterwarnings("ignore", module=r"distributed\.")
            yield
    finally:
        for name, level in levels.items():
            logging.getLogger(name).setLevel(level)


Task = TypeVar("Task")
Result = TypeVar("Result")

GONE_S = 300.0
_START_S = 10.0
_IN_FLIGHT_PER_WORKER = 3
_LOOK_S = 2.0
_GO_ON = "what is finished is kept; the same command goes on"


class OnWorkerError(Exception):
    """Where on a worker an error arose: its traceback there."""


@dataclass(frozen=True)
class _InFlight:
    index: int
    future: Future
    arrays: set[str]


class DaskMap:
    """An ordered map over the workers of a cluster, see `robid.backends.map.Map`."""

    def __init__(self, client: Client, address: str, terms: Terms, exchange: Exchange, memory: str) -> None:
        self._client = client
        self._address = address
        self._terms = terms
        self._exchange = exchange
        self._memory = memory
        self._looked = self._seen = -float("inf")
        self._workers = 0

    def __call__(
        self,
        function: Callable[[Task], Result],
        tasks: Sequence[Task],
        on_done: Callable[[int, Result], None] | None = None,
    ) -> list[Result]:
        """Runs the tasks.

        Raises:
            BackendError: If the scheduler or all workers are lost, or a worker that joined may not take part.
            WorkerError: If a task ended its workers again and again.
            Exception: What the first failing task or `on_done` raised; tasks not begun are dropped.
        """
        packer = self._exchange.packer()
        ended: queue.SimpleQueue[Future] = queue.SimpleQueue()
        flying: dict[str, _InFlight] = {}
        results: dict[int, Any] = {}
        self._seen = time.monotonic()
        begun = 0
        try:
            while len(results) < len(tasks):
                room = self._room(f"{len(results)} of {len(tasks)} tasks were done")
                while begun < len(tasks) and len(flying) < room:
                    each = self._submit(packer, function, begun, tasks[begun])
                    flying[each.future.key] = each
                    each.future.add_done_callback(ended.put)
                    begun += 1
                for each, answer in self._answers(ended, flying, tasks, len(results)):
                    results[each.index] = result = _opened(answer)
                    self._exchange.release(flying.pop(each.future.key).arrays)
                    if on_done is not None:
                        on_done(each.index, result)
        finally:
            for each in flying.values():
                self._exchange.release(each.arrays)
            if flying and self._client.status == "running":
                self._client.cancel([each.future for each in flying.values()], force=True)
        return [results[index] for index in range(len(tasks))]

    def _submit(self, packer: Packer, function: Callable[[Task], Result], index: int, task: Task) -> _InFlight:
        packed, arrays = packer.pack(function, task)
        future = self._client.submit(perform, self._terms, index, packed, pure=False)
        return _InFlight(index, future, arrays)

    def _room(self, where: str) -> int:
        """How many tasks may be at the scheduler; looks again every now and then, as workers come and go."""
        if self._client.status != "running":
            raise self._lost(where)
        now = time.monotonic()
        if now - self._looked > _LOOK_S:
            try:
                self._workers = len(self._client.nthreads())
            except Exception as error:
                raise self._lost(where) from error
            self._looked = now
            if self._workers:
                self._seen = now
            elif now - self._seen > GONE_S:
                what = f"The scheduler has had no workers for {GONE_S:.0f} s"
                raise BackendError(f"B001 {what}; {where}.", where=self._address, remedy=f"start workers; {_GO_ON}")
        return _IN_FLIGHT_PER_WORKER * max(1, self._workers)

    def _answers(
        self, ended: queue.SimpleQueue[Future], flying: dict[str, _InFlight], tasks: Sequence[object], done: int
    ) -> Iterator[tuple[_InFlight, Done | Failed | Refused]]:
        """Yields what has ended meanwhile; nothing if that takes long."""
        try:
            futures = [ended.get(timeout=_LOOK_S)]
            while not ended.empty():
                futures.append(ended.get_nowait())
        except queue.Empty:
            return
        where = f"{done} of {len(tasks)} tasks were done"
        try:
            answers = self._client.gather(futures)
        except KilledWorker as error:
            raise self._killed(error, flying, tasks, where) from error
        except (CancelledError, OSError) as error:
            raise self._lost(where) from error
        yield from zip((flying[future.key] for future in futures), answers, strict=True)

    def _killed(
        self, error: KilledWorker, flying: dict[str, _InFlight], tasks: Sequence[object], where: str
    ) -> WorkerError:
        """The task that was at work when the worker ended; those that waited beside it are not to blame."""
        index = self._exchange.last_on(error.last_worker.address)
        if index is None and str(error.task) in flying:
            index = flying[str(error.task)].index
        named = "A task"
        if index is not None and index < len(tasks):
            label = getattr(tasks[index], "label", "")
            named = f"Task {index + 1} of {len(tasks)}{f' ({label})' if label else ''}"
        times = error.allowed_failures + 1
        what = f"B002 {named} ended its worker {times} times; {where}."
        remedy = f"most often memory ran out{self._memory}; {_GO_ON}"
        return WorkerError(what, where=f"worker {error.last_worker.address}", remedy=remedy)

    def _lost(self, where: str) -> BackendError:
        what = f"B003 The scheduler was lost; {where}."
        remedy = "what is finished is kept; the same command goes on once the scheduler is back"
        return BackendError(what, where=self._address, remedy=remedy)


def _opened(answer: Done | Failed | Refused) -> Any:  # noqa: ANN401
    if isinstance(answer, Failed):
        raise answer.error from OnWorkerError(f"\n{answer.trace}")
    if isinstance(answer, Refused):
        raise refusal(answer.address, answer.complaint)
    return answer.result


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

        if folder is not None:
            # A run in which nothing is left to do starts no cluster.
            remove_left(folder)
        if scheduler is not None:
            started()
        yield mapped


@contextmanager
def _remote(address: str) -> Iterator[Client]:
    found = _connected(address)
    if isinstance(found, ValueError):
        remedy = "write it as in tcp://10.0.0.1:8786"
        raise SettingsError(f"S001 `{address}` is no address of a scheduler: {found}", where="scheduler", remedy=remedy)
    if isinstance(found, Exception):
        what = f"B004 The scheduler does not answer within {_CONNECT_S} s."
        remedy = f"check the address, and that `dask scheduler` runs there in the same versions; {GUIDE}"
        raise BackendError(what, where=address, remedy=remedy) from found
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
                loop=stack.enter_context(_loop()),
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
        except BaseException as error:
            _abandon()
            if not isinstance(error, OSError | RuntimeError):
                raise
            message = f"B005 The local Dask cluster did not start: {str(error).rstrip('.')}."
            raise BackendError(message, remedy="use --backend processes") from error
        try:
            yield client, memory
        except BaseException:
            _kill(cluster)
            raise


@contextmanager
def _loop() -> Iterator[IOLoop]:
    """Dask's loop in a thread that hears no interrupts: workers inherit that, from before their first line on."""
    runner = LoopRunner()
    with deaf_children():
        runner.start()
    loop = runner.loop
    try:
        yield loop
    finally:
        # What a cluster that did not get up leaves in it ends in errors that nobody waits for.
        loop.asyncio_loop.set_exception_handler(lambda *_: None)
        runner.stop()
        for cluster in [each for each in SpecCluster._instances if not each.shutdown_on_close]:
            _finish_starts(cluster)
            _kill(cluster)


def _abandon() -> None:
    """Ends what a cluster has started that did not get up: at exit, Dask would wait for it and print what it missed."""
    for cluster in list(SpecCluster._instances):
        cluster.shutdown_on_close = False
        _kill(cluster)
        # Dask stops a loop that all who use it have stopped; till then, more workers begin.
        cluster._loop_runner.stop()


def _finish_starts(cluster: SpecCluster) -> None:
    """Waits for workers' processes that are being started: left alone, they would end in a traceback of their own.

    A thread for each starts it; until that is done, nobody knows its number.
    """
    for nanny in list(cluster._created):
        started = getattr(nanny.process, "process", None)
        if started is not None:
            started._watch_q.put_nowait({"op": "stop"})
            started._watch_message_thread.join(timeout=_START_S)


def _kill(cluster: SpecCluster) -> None:
    for nanny in list(cluster._created):
        nanny.auto_restart = False
        if nanny.pid:
            with suppress(ProcessLookupError):
                os.kill(nanny.pid, signal.SIGKILL)
