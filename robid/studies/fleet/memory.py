"""What a worker of its own has in memory after each task."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from robid.backends.map import Map, make_map

_STATM = Path("/proc/self/statm")


@contextmanager
def watched_worker(series: list[float]) -> Iterator[Map]:
    """Yields a map with a single worker process, as `robid reprocess --backend processes --workers 1` has it.

    Args:
        series: Gets the worker's memory after each task [MiB]; nothing where the system does not tell it.
    """

    def mapped(
        function: Callable[[Any], Any], tasks: Sequence[Any], on_done: Callable[[int, Any], None] | None = None
    ) -> list[Any]:
        def done(index: int, pair: tuple[Any, float | None]) -> None:
            if pair[1] is not None:
                series.append(pair[1])
            if on_done is not None:
                on_done(index, pair[0])

        return [result for result, _ in one_worker(partial(_measured, function), tasks, done)]

    with make_map("processes", 1) as one_worker:
        yield mapped


def _measured(function: Callable[[Any], Any], task: Any) -> tuple[Any, float | None]:  # noqa: ANN401
    return function(task), resident_mib()


def resident_mib() -> float | None:
    """Returns the resident memory of this process [MiB]; None where there is no /proc."""
    if not _STATM.exists():
        return None
    return int(_STATM.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20
