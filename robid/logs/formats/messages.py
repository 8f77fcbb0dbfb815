"""Columns of streams of messages, from the topics of a log and their messages, one by one."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

from robid.logs.formats.message_paths import field_of, labels_of, named_numbers
from robid.logs.formats.variables import Found, Reason, Wanted

Decode: TypeAlias = Callable[[bytes], Any]
_TIMES = ("log_time", "header.stamp")
_NEAR = 10**15
"""Stamps further from the log's beginning are of another clock, as of a simulation [ns]."""


@dataclass(frozen=True)
class Topic:
    """A stream of messages.

    Attributes:
        name: Its name.
        count: Number of its messages.
        kind: What they are.
        encoding: How they are packed: `cdr` or `json`.
        definition: What the log says of `kind`, and in which language: `ros2msg` or `ros2idl`.
    """

    name: str
    count: int
    kind: str
    encoding: str
    definition: tuple[str, str] = ("", "")


def decoder(topic: Topic) -> Decode:
    """Returns what unpacks the messages of a topic.

    Raises:
        ValueError: If nothing here does.
    """
    if topic.encoding == "json":
        return json.loads
    if topic.encoding != "cdr":
        raise ValueError(f"its messages are packed as {topic.encoding or 'unknown'}")
    text, language = topic.definition
    store = get_typestore(Stores.EMPTY if text else Stores.ROS2_HUMBLE)
    if text:
        types = get_types_from_idl(text) if language == "ros2idl" else get_types_from_msg(text, topic.kind)
        store.register({kind: one for kind, one in types.items() if kind not in store.fielddefs})
    if topic.kind not in store.fielddefs:
        raise ValueError(f"the log does not define its type {topic.kind}")

    def decode(raw: bytes) -> Any:  # noqa: ANN401
        return store.deserialize_cdr(raw, topic.kind)

    return decode


@dataclass
class Streams:
    """Gathers the columns of messages that come one by one.

    Attributes:
        wanted: Which columns are kept; of each topic the first message tells the names of the others.
        start: When the log begins, from when its times are counted [ns].
    """

    wanted: Wanted
    start: int
    found: Found = field(default_factory=Found)
    _columns: dict[str, list[float]] = field(default_factory=dict)
    _asked: dict[str, bool] = field(default_factory=dict)
    _below: dict[str, bool] = field(default_factory=dict)
    _decoders: dict[str, Decode] = field(default_factory=dict)
    _begun: set[str] = field(default_factory=set)

    def prepare(self, topics: Sequence[Topic]) -> list[str]:
        """Notes topics that cannot be unpacked; returns those to be read: wanted ones, or not yet known."""
        for topic in topics:
            try:
                self._decoders[topic.name] = decoder(topic)
            except Exception as e:  # noqa: BLE001 definitions in logs may be anything
                remedy = "Convert the log with `ros2 bag convert`, or its topics to Parquet or CSV."
                self.found.unreadable[topic.name] = Reason(f"It cannot be unpacked: {e}.", remedy)
        return list(self._decoders)

    def is_wanted(self, name: str) -> bool:
        """Whether a topic or field, or something in it, was asked for."""
        if name not in self._below:
            self._below[name] = self.wanted.below(name)
        return self._below[name]

    def add(self, topic: str, time: int, raw: bytes, count: int) -> None:
        """Adds a message, one of `count` in the log, at a time [ns]."""
        first = topic not in self._begun
        self._begun.add(topic)
        if not first and not self.is_wanted(topic):
            return
        message = self._decoders[topic](raw)

        def keep(path: str) -> bool:
            return first or self.is_wanted(f"{topic}.{path}")

        for path, value in (*self._times(message, time, keep), *named_numbers(message, keep)):
            name = f"{topic}.{path}"
            if first:
                self.found.mention(name, count, "s" if path.partition("[")[0] in _TIMES else "")
            if name not in self._asked:
                self._asked[name] = name in self.wanted
            if self._asked[name]:
                self._columns.setdefault(name, []).append(value)

    def finish(self) -> Found:
        """Returns the columns."""
        for name, values in self._columns.items():
            self.found.add(name, np.array(values), self.found.units.get(name, ""))
        return self.found

    def _times(self, message: Any, time: int, keep: Callable[[str], bool]) -> Iterator[tuple[str, float]]:  # noqa: ANN401
        """When a message was logged and what its header says, from the log's beginning [s].

        A header of another clock is left as it is. Where messages name joints, each of these has times of its own.
        """
        times = {"log_time": 1e-9 * (time - self.start)}
        stamp = field_of(field_of(message, "header"), "stamp")
        seconds, nanoseconds = field_of(stamp, "sec"), field_of(stamp, "nanosec")
        if seconds is not None and nanoseconds is not None:
            stamped = int(seconds) * 10**9 + int(nanoseconds)
            times["header.stamp"] = 1e-9 * (stamped - self.start if abs(stamped - self.start) < _NEAR else stamped)
        for path, value in times.items():
            yield path, value
            yield from ((one, value) for label in labels_of(message) if keep(one := f"{path}[{label}]"))
