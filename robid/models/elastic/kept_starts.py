"""Starts of a fit that have ended, kept beside the model until it is written: a killed fit goes on from them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, cast

import numpy as np

from robid.artifacts.artifact import Artifact, Dataset, Provenance
from robid.artifacts.parts import Parts
from robid.artifacts.results import START
from robid.models.elastic.fit.fitting import descend
from robid.models.family import Work
from robid.results.levenberg import Minimum, Status


def resuming_map(work: Work, kept: Parts | None) -> Callable[[Callable[[Any], Any], Sequence[Any]], list[Any]]:
    """Returns the map of a fit: descents that an earlier run has finished are read, others kept as they end."""
    begun = 0

    def mapped(function: Callable[[Any], Any], tasks: Sequence[Any]) -> list[Any]:
        nonlocal begun
        if kept is None or function is not descend:
            return work.map(function, tasks, lambda _index, _result: work.progress.advance())
        # Starts come in rounds; each is kept by its place among all of them.
        places, begun = range(begun, begun + len(tasks)), begun + len(tasks)
        ended = {place: _minimum(kept.read(place)) for place in places if kept.has(place)}
        left = [place for place in places if place not in ended]

        def keep(index: int, end: Minimum) -> None:
            kept.write(left[index], _part(end))
            work.progress.advance()

        found = work.map(function, [tasks[place - places.start] for place in left], keep)
        every = ended | dict(zip(left, found, strict=True))
        return [every[place] for place in places]

    return mapped


def count_ended(kept: Parts | None, starts: int) -> int:
    """How many of the starts an earlier run has finished."""
    return 0 if kept is None else sum(kept.has(index) for index in range(starts))


def _part(end: Minimum) -> Artifact:
    point = {"parameters": Dataset(end.parameters, "1", ("parameter",), "Internal parameters where the descent ended")}
    ended = {"cost": end.cost, "iterations": end.iterations, "status": end.status, "evaluations": end.evaluations}
    return Artifact(START, point, ended, Provenance(stage="fit"))


def _minimum(part: Artifact) -> Minimum:
    said = part.attributes
    return Minimum(
        parameters=np.asarray(part.datasets["parameters"].values, float),
        cost=float(cast("float", said["cost"])),
        iterations=int(cast("int", said["iterations"])),
        status=cast("Status", said["status"]),
        evaluations=int(cast("int", said["evaluations"])),
    )
