"""The ordered map over a cluster: few tasks at the scheduler at a time, done again where a worker is lost."""

from __future__ import annotations

import queue
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

from distributed import KilledWorker

from robid.backends.dask.checks import refusal
from robid.backends.dask.exchange import Exchange, Packer
from robid.backends.dask.worker import Done, Failed, Refused, Terms, perform
from robid.errors import BackendError, WorkerError

if TYPE_CHECKING:
    from distributed import Client, Future

Task = TypeVar("Task")
Result = TypeVar("Result")

GONE_S = 300.0
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
    """An ordered map over the workers of a cluster, see `robid.backends.map.Map`.

    Args:
        client: The connection.
        address: The scheduler, for messages.
        terms: What a worker must fulfil.
        exchange: The folder that client and workers share.
        memory: What a worker may use, for messages; empty where others have set it.
    """

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
            self._drop(list(flying.values()))
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
                raise BackendError(f"{what}; {where}.", where=self._address, remedy=f"start workers; {_GO_ON}")
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
            named = f"Task {index + 1} of {len(tasks)}{_label(tasks[index])}"
        times = error.allowed_failures + 1
        return WorkerError(
            f"{named} ended its worker {times} times; {where}.",
            where=f"worker {error.last_worker.address}",
            remedy=f"most often memory ran out{self._memory}; {_GO_ON}",
        )

    def _lost(self, where: str) -> BackendError:
        return BackendError(
            f"The scheduler was lost; {where}.",
            where=self._address,
            remedy="what is finished is kept; the same command goes on once the scheduler is back",
        )

    def _drop(self, left: list[_InFlight]) -> None:
        for each in left:
            self._exchange.release(each.arrays)
        if left and self._client.status == "running":
            self._client.cancel([each.future for each in left], force=True)


def _opened(answer: Done | Failed | Refused) -> Any:  # noqa: ANN401
    if isinstance(answer, Failed):
        raise answer.error from OnWorkerError(f"\n{answer.trace}")
    if isinstance(answer, Refused):
        raise refusal(answer.address, answer.complaint)
    return answer.result


def _label(task: object) -> str:
    label = getattr(task, "label", "")
    return f" ({label})" if label else ""
