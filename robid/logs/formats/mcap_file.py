"""Reads MCAP files: messages of ROS 2 and messages in JSON."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mcap.reader import make_reader

from robid.logs.formats.messages import Streams, Topic
from robid.logs.formats.variables import Found, UnreadableLogError, Wanted

_REMEDY = "Repair it with `mcap recover LOG --output REPAIRED.mcap`."


def read(file: Path, wanted: Wanted) -> Found:
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
                raise UnreadableLogError("it was not closed, so its end is missing", _REMEDY)
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
        topics[channel.topic] = Topic(
            channel.topic, counts[channel.topic], kind, channel.message_encoding, (text, language)
        )
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
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
