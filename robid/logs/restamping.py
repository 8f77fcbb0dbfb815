"""Samples in the order and at the times that stamps mean: rows out of order or twice, stamps of arrival."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robid.logs.arrival import find_arrivals
from robid.logs.mapping import LogMapping, Stream
from robid.logs.order import rows_in_order
from robid.logs.timing import since_first


def restamped(
    mapping: LogMapping, streams: Sequence[Stream], stamps: NDArray[Any]
) -> tuple[list[Stream], NDArray[Any], list[str]]:
    """Returns variables and the log's own time (n_sample,), in order and evened where they are to be.

    What was done is said, a sentence each.
    """
    placed, stamps, ordered = _in_order(mapping, streams, stamps)
    to_seconds = 1.0 if mapping.time is None else mapping.time.to_seconds
    placed, stamps, evened = _taken_evenly(mapping, placed, stamps, to_seconds)
    return placed, stamps, [*ordered, *evened]


def _sharing_stamps(streams: Sequence[Stream], stamps: NDArray[Any]) -> list[tuple[NDArray[Any], list[int]]]:
    """The different stamps of variables, and which of these have them."""
    groups: list[tuple[NDArray[Any], list[int]]] = []
    for index, one in enumerate(streams):
        own = stamps if one.stamps is None else one.stamps
        shared = next((members for other, members in groups if other is own or np.array_equal(other, own)), None)
        if len(own) == len(one.values) and shared is not None:
            shared.append(index)
        elif len(own) == len(one.values):
            groups.append((own, [index]))
    return groups


def _in_order(
    mapping: LogMapping, streams: Sequence[Stream], stamps: NDArray[Any]
) -> tuple[list[Stream], NDArray[Any], list[str]]:
    """Puts rows in the order of their time and leaves out repeated ones, where these are single ones."""
    placed, told = list(streams), []
    for own, members in _sharing_stamps(streams, stamps):
        rows = rows_in_order(own, [streams[index].values for index in members])
        if rows is None:
            continue
        for index in members:
            times = None if streams[index].stamps is None else own[rows]
            placed[index] = replace(streams[index], values=streams[index].values[rows], stamps=times)
        if np.array_equal(own, stamps):
            stamps = own[rows]
        told.append(
            f"{mapping.file.name}: of `{streams[members[0]].name}` {len(own) - len(rows)} samples are repeated and"
            f" {np.count_nonzero(np.diff(rows) < 0)} stand too late: each was put in its place once."
        )
    return placed, stamps, told


def _taken_evenly(
    mapping: LogMapping, streams: Sequence[Stream], stamps: NDArray[Any], to_seconds: float
) -> tuple[list[Stream], NDArray[Any], list[str]]:
    """Puts even times in the place of stamps that say when samples arrived, and what to say about it.

    Variables that share their stamps are judged together, so that none is moved against another.
    """
    groups = _sharing_stamps(streams, stamps)
    placed, told = list(streams), []
    judged = [(since_first(own), [streams[index].values for index in members]) for own, members in groups]
    arrivals = [find_arrivals(*one) for one in judged]
    if any(arrivals):  # what stamped some samples when they arrived did so with all
        arrivals = [found or find_arrivals(*one, suspected=True) for found, one in zip(arrivals, judged, strict=True)]
    for (own, members), found in zip(groups, arrivals, strict=True):
        if found is None:
            continue
        whole = own.dtype.kind in "iu"
        even = own[0] + np.round(found.times).astype(np.int64) if whole else own[0].astype(float) + found.times
        if np.array_equal(own, stamps):
            stamps = even
        for index in members:
            placed[index] = replace(streams[index], stamps=even if streams[index].stamps is not None else None)
        smoother = f"as `{streams[members[found.signal]].name}` is {found.smoother:.2g} times smoother at even steps"
        why = smoother if np.isfinite(found.smoother) else "as those of others do"
        told.append(
            f"{mapping.file.name}: time stamps of `{streams[members[0]].name}` say when samples arrived, up to"
            f" {found.late * to_seconds:.2g} s late, {why}; its samples are placed evenly."
        )
    return placed, stamps, told
