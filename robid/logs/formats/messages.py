"""Columns of streams of messages: MCAP files, and ROS 2 bags, which are folders of SQLite or MCAP files.

Every number of a message has a path: `position[0]`, or `effort[elbow]` where the message names its numbers.
"""

from __future__ import annotations

import json
import re
import sqlite3
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from mcap.reader import make_reader
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

from robid.logs.formats.unpacking import UnreadableLogError
from robid.logs.formats.variables import Found, Reason, Wanted

_LABELS = ("name", "names", "joint_names", "interface_names")
_LONGEST = 64  # lists of numbers that are longer, as of images and scans, have no columns


def field_of(value: Any, name: str) -> Any:  # noqa: ANN401
    """Returns a field of a message, None where there is none."""
    return value.get(name) if isinstance(value, Mapping) else getattr(value, name, None)


def labels_of(message: Any) -> Sequence[str]:  # noqa: ANN401
    """Returns the names, as of joints, that a message gives its lists of numbers."""
    return next((found for key in _LABELS if _is_text(found := field_of(message, key))), ())


def named_numbers(
    message: Any,  # noqa: ANN401
    keep: Callable[[str], bool],
    path: str = "",
    labels: Sequence[str] = (),
) -> Iterator[tuple[str, float]]:
    """Yields path and number of every number in a part of a message where `keep` says so; lists may have labels."""
    fields = _fields(message)
    if fields is not None:
        labels = labels_of(message) or labels
        for name, inner in fields.items():
            below = f"{path}.{name}" if path else name
            if keep(below):
                yield from named_numbers(inner, keep, below, labels)
    elif isinstance(message, bool | int | float | np.number):
        yield path, float(message)
    elif isinstance(message, list | tuple | np.ndarray) and len(message) <= _LONGEST and not _is_text(message):
        items = message.tolist() if isinstance(message, np.ndarray) else message
        marks = [range(len(items)), labels] if len(labels) == len(items) else [range(len(items))]
        for mark, inner in ((mark, inner) for row in marks for mark, inner in zip(row, items, strict=True)):
            if keep(below := f"{path}[{mark}]"):
                yield from named_numbers(inner, keep, below)


def _fields(value: Any) -> dict[str, Any] | None:  # noqa: ANN401
    if isinstance(value, Mapping):
        return {str(key): one for key, one in value.items()}
    names = getattr(value, "__dataclass_fields__", None)
    return None if names is None else {name: getattr(value, name) for name in names if name != "__msgtype__"}


def _is_text(value: Any) -> bool:  # noqa: ANN401
    return isinstance(value, list | tuple) and bool(value) and all(isinstance(one, str) for one in value)


Decode: TypeAlias = Callable[[bytes], Any]
_TIMES = ("log_time", "header.stamp")
_NEAR = 10**15  # stamps further from the log's beginning are of another clock, as of a simulation [ns]


@dataclass(frozen=True)
class Topic:
    """A stream of messages: how many, of which kind, and how they are packed, by `cdr` or `json`.

    Its definition is what the log says of that kind, and in which language: `ros2msg` or `ros2idl`.
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
    """Gathers the columns of messages that come one by one, with times since the log's start [ns].

    Of each topic the first message tells the names of the columns that are not wanted.
    """

    wanted: Wanted
    start: int
    found: Found = field(default_factory=Found)
    _columns: dict[str, list[float]] = field(default_factory=dict)
    _asked: dict[str, bool] = field(default_factory=dict)
    _below: dict[str, bool] = field(default_factory=dict)
    _decoders: dict[str, Decode] = field(default_factory=dict)
    _begun: set[str] = field(default_factory=set)
    _otherwise: set[str] = field(default_factory=set)  # Topics whose stamps are of another clock

    def prepare(self, topics: Sequence[Topic]) -> list[str]:
        """Notes topics that cannot be unpacked; returns those to be read: wanted ones, or not yet known."""
        for topic in topics:
            try:
                self._decoders[topic.name] = decoder(topic)
            except Exception as e:  # noqa: BLE001 definitions in logs may be anything
                remedy = "Convert the log with `ros2 bag convert`, or its topics to Parquet or CSV."
                self.found.unreadable[topic.name] = Reason(f"D071 It cannot be unpacked: {e}.", remedy)
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

        for path, value in (*self._times(topic, message, time, keep), *named_numbers(message, keep)):
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
            topic = next(one for one in self._begun if name.startswith(f"{one}."))
            path = name.removeprefix(f"{topic}.").partition("[")[0]
            if path == "log_time" or (path == "header.stamp" and topic not in self._otherwise):
                self.found.origins[name] = "1970", self.start
        return self.found

    def _times(
        self,
        topic: str,
        message: Any,  # noqa: ANN401
        time: int,
        keep: Callable[[str], bool],
    ) -> Iterator[tuple[str, float]]:
        """When a message was logged and what its header says, from the log's beginning [s].

        A header of another clock is left as it is. Where messages name joints, each of these has times of its own.
        """
        times = {"log_time": 1e-9 * (time - self.start)}
        stamp = field_of(field_of(message, "header"), "stamp")
        seconds, nanoseconds = field_of(stamp, "sec"), field_of(stamp, "nanosec")
        if seconds is not None and nanoseconds is not None:
            stamped = int(seconds) * 10**9 + int(nanoseconds)
            near = abs(stamped - self.start) < _NEAR
            times["header.stamp"] = 1e-9 * (stamped - self.start if near else stamped)
            self._otherwise |= set() if near else {topic}
        for path, value in times.items():
            yield path, value
            yield from ((one, value) for label in labels_of(message) if keep(one := f"{path}[{label}]"))


_REMEDY = "Repair it with `mcap recover LOG --output REPAIRED.mcap`."


def read_mcap(file: Path, wanted: Wanted) -> Found:
    """Reads columns of the messages of an MCAP file."""
    return read_all([file], wanted)


def read_all(files: Sequence[Path], wanted: Wanted) -> Found:
    """Reads columns of the messages of MCAP files that follow each other.

    Raises:
        UnreadableLogError: If one is damaged or was not closed.
    """
    streams: Streams | None = None
    for file in files:
        with file.open("rb") as stream:
            try:
                reader = make_reader(stream, validate_crcs=True)
                summary = reader.get_summary()
            except MemoryError:
                raise
            except Exception as e:
                raise UnreadableLogError(_said(e), _REMEDY) from e
            if summary is None or summary.statistics is None:
                raise UnreadableLogError("D072 it was not closed, so its end is missing", _REMEDY)
            streams = streams or Streams(wanted, summary.statistics.message_start_time)
            _read_messages(reader, summary, streams)
    return Found() if streams is None else streams.finish()


def _read_messages(reader: Any, summary: Any, streams: Streams) -> None:  # noqa: ANN401
    counts: dict[str, int] = {}
    topics: dict[str, Topic] = {}
    for number, channel in summary.channels.items():
        count = summary.statistics.channel_message_counts.get(number, 0)
        counts[channel.topic] = counts.get(channel.topic, 0) + count
        schema = summary.schemas.get(channel.schema_id)
        text = "" if schema is None else schema.data.decode(errors="replace")
        kind, language = ("", "") if schema is None else (schema.name, schema.encoding)
        told = kind, channel.message_encoding, (text, language)
        topics[channel.topic] = Topic(channel.topic, counts[channel.topic], *told)
    readable = [name for name in streams.prepare(list(topics.values())) if counts[name]]
    try:
        for name in [name for name in readable if not streams.is_wanted(name)]:
            _, channel, message = next(iter(reader.iter_messages(topics=[name])))
            streams.add(name, message.log_time, message.data, counts[name])
        wanted = [name for name in readable if streams.is_wanted(name)]
        for _, channel, message in reader.iter_messages(topics=wanted) if wanted else ():
            streams.add(channel.topic, message.log_time, message.data, counts[channel.topic])
    except MemoryError:
        raise
    except Exception as e:
        raise UnreadableLogError(_said(e), _REMEDY) from e


def _said(error: Exception) -> str:
    return f"D251 {type(error).__name__}: {error}".removesuffix(": ")


_COPIED = "Check that the bag was closed and copied completely; `ros2 bag reindex FOLDER` may repair it."


def read_bag(file: Path, wanted: Wanted) -> Found:
    """Reads columns of the messages of a bag, whose files follow each other by their numbers.

    Raises:
        UnreadableLogError: If it has no file that can be read.
    """

    def number(one: Path) -> tuple[int, str]:  # in a name such as `bag_12.db3`
        found = re.search(r"_(\d+)\.", one.name)
        return (int(found[1]) if found else 0, one.name)

    files = sorted(file.iterdir(), key=number) if file.is_dir() else [file]
    mcap = [one for one in files if one.suffix == ".mcap"]
    databases = [one for one in files if one.suffix == ".db3" or not file.is_dir()]
    if mcap:
        return read_all(mcap, wanted)
    if not databases:
        packed = any(one.suffix == ".zstd" for one in files)
        remedy = "Unpack it with `ros2 bag convert`." if packed else "Name the folder with `metadata.yaml`."
        raise UnreadableLogError("D073 the folder contains no .db3 or .mcap file", remedy)
    streams: Streams | None = None
    for database in databases:
        try:
            with closing(sqlite3.connect(f"{database.resolve().as_uri()}?mode=ro", uri=True)) as connection:
                streams = _read_database(connection, wanted, streams)
        except sqlite3.Error as e:
            raise UnreadableLogError(f"D252 {e}", _COPIED) from e
    return Found() if streams is None else streams.finish()


def _read_database(connection: sqlite3.Connection, wanted: Wanted, streams: Streams | None) -> Streams:
    (start,) = connection.execute("select min(timestamp) from messages").fetchone()
    streams = streams or Streams(wanted, start or 0)
    tables = {name for (name,) in connection.execute("select name from sqlite_master where type = 'table'")}
    definitions: dict[str, tuple[str, str]] = {}
    if "message_definitions" in tables:
        rows = connection.execute("select topic_type, encoded_message_definition, encoding from message_definitions")
        definitions = {kind: (text, language) for kind, text, language in rows}
    counts = dict(connection.execute("select topic_id, count(*) from messages group by topic_id"))
    listed = connection.execute("select id, name, type, serialization_format from topics")
    topics = {
        number: Topic(name, counts.get(number, 0), kind, encoding, definitions.get(kind, ("", "")))
        for number, name, kind, encoding in listed
    }
    readable = set(streams.prepare(list(topics.values())))
    asked = "select topic_id, timestamp, data from messages where topic_id = ? order by timestamp"
    for number, topic in topics.items():
        if topic.name not in readable:
            continue
        limit = "" if streams.is_wanted(topic.name) else " limit 1"
        for _, time, raw in connection.execute(asked + limit, (number,)):
            if not isinstance(raw, bytes):
                raise UnreadableLogError(f"D074 a message of {topic.name} is damaged", _COPIED)
            streams.add(topic.name, time, raw, topic.count)
    return streams
