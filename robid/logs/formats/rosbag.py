"""Reads ROS 2 bags: folders of SQLite or MCAP files, or one SQLite file."""

from __future__ import annotations

import re
import sqlite3
from contextlib import closing
from pathlib import Path

from robid.logs.formats.mcap_file import read_all
from robid.logs.formats.messages import Streams, Topic
from robid.logs.formats.variables import Found, UnreadableLogError, Wanted

_COPIED = "Check that the bag was closed and copied completely; `ros2 bag reindex FOLDER` may repair it."


def read(file: Path, wanted: Wanted) -> Found:
    """Reads columns of the messages of a bag, whose files follow each other by their numbers.

    Raises:
        UnreadableLogError: If it has no file that can be read.
    """
    files = sorted(file.iterdir(), key=_number) if file.is_dir() else [file]
    mcap = [one for one in files if one.suffix == ".mcap"]
    databases = [one for one in files if one.suffix == ".db3" or not file.is_dir()]
    if mcap:
        return read_all(mcap, wanted)
    if not databases:
        packed = any(one.suffix == ".zstd" for one in files)
        remedy = "Unpack it with `ros2 bag convert`." if packed else "Name the folder that holds `metadata.yaml`."
        raise UnreadableLogError("the folder holds no .db3 or .mcap file", remedy)
    streams: Streams | None = None
    for database in databases:
        try:
            with closing(sqlite3.connect(f"{database.resolve().as_uri()}?mode=ro", uri=True)) as connection:
                streams = _read_database(connection, wanted, streams)
        except sqlite3.Error as e:
            raise UnreadableLogError(str(e), _COPIED) from e
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
    topics = {
        number: Topic(name, counts.get(number, 0), kind, encoding, definitions.get(kind, ("", "")))
        for number, name, kind, encoding in connection.execute(
            "select id, name, type, serialization_format from topics"
        )
    }
    readable = set(streams.prepare(list(topics.values())))
    asked = "select topic_id, timestamp, data from messages where topic_id = ? order by timestamp"
    for number, topic in topics.items():
        if topic.name not in readable:
            continue
        limit = "" if streams.is_wanted(topic.name) else " limit 1"
        for _, time, raw in connection.execute(asked + limit, (number,)):
            if not isinstance(raw, bytes):
                raise UnreadableLogError(f"a message of {topic.name} is damaged", _COPIED)
            streams.add(topic.name, time, raw, topic.count)
    return streams


def _number(file: Path) -> tuple[int, str]:
    """The number in a name such as `bag_12.db3`."""
    found = re.search(r"_(\d+)\.", file.name)
    return (int(found[1]) if found else 0, file.name)
