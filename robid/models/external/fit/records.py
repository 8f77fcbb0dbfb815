"""Records of an external fit: those of some configurations, where they rest, and whether they go together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.models.external.fit.data import commands_of
from robid.models.external.fit.options import ExternalOptions
from robid.models.external.fit.solution import Ports
from robid.signals.quantities import Channel, channel_names, describe
from robid.signals.record import Record

_SAME_HOME = 1e-6  # rad, or m
_ALIKE = "validate on a record of the same channels and units, with the same hold"


def selected(records: Sequence[Record], configurations: Sequence[int]) -> tuple[Record | None, ...]:
    """Returns the records of some configurations, all where none is named; None where a record has none of them."""
    found: list[Record | None] = []
    first = 0
    for record in records:
        count = len(record.inputs)
        rows = [index - first for index in configurations if first <= index < first + count]
        found.append(record if not configurations else _rows(record, rows) if rows else None)
        first += count
    return tuple(found)


def homes_of(records: Sequence[Record | None]) -> FloatArray:
    """Returns the configurations (n_home, n_joint) of records, each once; none where they are unknown."""
    known = [one.configurations for one in records if one is not None and one.configurations is not None]
    return np.unique(np.concatenate(known), axis=0) if known else np.zeros((0, 0))


def at_homes(record: Record, homes: FloatArray) -> Record:
    """Returns a record in those of its configurations that are homes; all of it where none is."""
    if record.configurations is None or homes.shape[1] != record.configurations.shape[1]:
        return record
    apart = np.abs(record.configurations[:, None] - homes).max(axis=2, initial=0.0).min(axis=1, initial=np.inf)
    rows = np.flatnonzero(apart < _SAME_HOME).tolist()
    return _rows(record, rows) if rows else record


def _rows(record: Record, rows: Sequence[int]) -> Record:
    chosen = list(rows)
    return replace(
        record,
        inputs=record.inputs[chosen],
        outputs=record.outputs[chosen],
        output_offset=record.output_offset[chosen],
        configurations=None if record.configurations is None else record.configurations[chosen],
        reference=None if record.reference is None else record.reference[chosen],
    )


def refuse_other_ports(ports: Ports, record: Record, options: ExternalOptions) -> None:
    """Refuses a record of other channels than those of a fit.

    Raises:
        DataError: If it has such.
    """
    told = commands_of(record, options)
    found = _ports(told.channels), _ports(record.output_channels), told.hold
    own = (ports.inputs, ports.input_units), (ports.outputs, ports.output_units), ports.hold
    if found != own:
        message = (
            f"D157 the validation has {describe(told.channels)} ({told.hold}) and "
            f"{describe(record.output_channels)}, the "
            f"fit {', '.join(ports.inputs)} ({ports.hold}) and {', '.join(ports.outputs)}, or in other units"
        )
        raise DataError(message, where="validation", remedy=_ALIKE)


def _ports(channels: Sequence[Channel]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    return channel_names(channels), tuple(channel.unit for channel in channels)


def refuse_other_channels(records: Sequence[Record], campaigns: Sequence[str], options: ExternalOptions) -> None:
    """Refuses records of other channels than the first.

    Raises:
        DataError: If there are such.
    """
    first = commands_of(records[0], options)
    for name, record in zip(campaigns[1:], records[1:], strict=True):
        told = commands_of(record, options)
        same = told.channels == first.channels and record.output_channels == records[0].output_channels
        if not same or told.hold != first.hold:
            message = f"D158 campaign `{name}` has other channels, or another hold, than `{campaigns[0]}`"
            raise DataError(message, where="record", remedy="fit the two on their own")
