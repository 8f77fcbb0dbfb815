"""Columns of streams of messages: every number of a message by its path, `/topic.field.inner[0]`."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

from robid.logs.formats.variables import Found, Reason, Wanted

Decode: TypeAlias = Callable[[bytes], Any]
_LABELS = ("name", "names", "joint_names", "interface_names")
_LONGEST = 64
"""Lists of numbers that are longer, as of images and scans, have no columns."""
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

    def is_wanted(self, topic: str) -> bool:
        """Whether something of a topic was asked for."""
        if topic not in self._below:
            self._below[topic] = self.wanted.below(topic)
        return self._below[topic]

    def add(self, topic: str, time: int, raw: bytes, count: int = 0) -> None:
        """Adds a message, `count` of which the log has."""
        first = topic not in self._begun
        self._begun.add(topic)
        if not first and not self.is_wanted(topic):
            return
        message = self._decoders[topic](raw)
        values: list[tuple[str, float]] = [("log_time", 1e-9 * (time - self.start))]
        values += self._stamps(message)
        labels: list[str] = []
        values += _numbers("", message, (), labels)
        values += [(f"{path}[{label}]", value) for path, value in values if path in _TIMES for label in labels]
        for path, value in values:
            name = f"{topic}.{path}"
            if first and name not in self.found.sizes:
                self.found.mention(name, count, "s" if path.partition("[")[0] in _TIMES else "")
            if name in self.wanted:
                self._columns.setdefault(name, []).append(value)

    def finish(self) -> Found:
        """Returns the columns."""
        for name, values in self._columns.items():
            self.found.add(name, np.array(values), self.found.units.get(name, ""))
        return self.found

    def _stamps(self, message: Any) -> list[tuple[str, float]]:  # noqa: ANN401
        """The time in a message's header, from the log's beginning, or as it is where it is of another clock [s]."""
        stamp = _get(_get(message, "header"), "stamp")
        seconds, nanoseconds = _get(stamp, "sec"), _get(stamp, "nanosec")
        if seconds is None or nanoseconds is None:
            return []
        time = int(seconds) * 10**9 + int(nanoseconds)
        return [("header.stamp", 1e-9 * (time - self.start if abs(time - self.start) < _NEAR else time))]


_TIMES = ("log_time", "header.stamp")


def _get(value: Any, name: str) -> Any:  # noqa: ANN401
    return value.get(name) if isinstance(value, Mapping) else getattr(value, name, None)


def _fields(value: Any) -> dict[str, Any] | None:  # noqa: ANN401
    """The fields of a message, or None where it is none."""
    if isinstance(value, Mapping):
        return {str(key): one for key, one in value.items()}
    names = getattr(value, "__dataclass_fields__", None)
    return None if names is None else {name: getattr(value, name) for name in names if name != "__msgtype__"}


def _numbers(path: str, value: Any, labels: Sequence[str], all_labels: list[str]) -> Iterator[tuple[str, float]]:  # noqa: ANN401
    """Names every number in a message; lists beside a list of names are named by these too, as `effort[elbow]`."""
    fields = _fields(value)
    if fields is not None:
        own = next((fields[key] for key in _LABELS if _is_text(fields.get(key))), None)
        if own is not None:
            labels = own
            all_labels += [label for label in own if label not in all_labels] if not path else []
        for name, inner in fields.items():
            yield from _numbers(f"{path}.{name}" if path else name, inner, labels, all_labels)
    elif isinstance(value, bool | int | float | np.number):
        yield path, float(value)
    elif isinstance(value, list | tuple | np.ndarray) and len(value) <= _LONGEST and not _is_text(value):
        named = labels if len(labels) == len(value) else ()
        for index, inner in enumerate(value):
            yield from _numbers(f"{path}[{index}]", inner, (), all_labels)
            if named:
                yield from _numbers(f"{path}[{named[index]}]", inner, (), all_labels)


def _is_text(value: Any) -> bool:  # noqa: ANN401
    return isinstance(value, list | tuple) and bool(value) and all(isinstance(one, str) for one in value)
