"""Reads MDF files, version 4 mostly: channels by their names, the time of each as `channel.time`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from asammdf import MDF

from robid.logs.formats.variables import Found, Reason, Wanted, number_repeated


def read(file: Path, wanted: Wanted) -> Found:
    """Reads channels of an MDF file, converted as it says."""
    found = Found()
    log: Any
    with MDF(file) as log:
        places = [
            (channel.name, group, index)
            for group, content in enumerate(log.groups)
            for index, channel in enumerate(content.channels)
            if index != log.masters_db.get(group)
        ]
        names, twice = number_repeated([name for name, _, _ in places])
        found.unreadable.update(twice)
        for name, (plain, group, index) in zip(names, places, strict=True):
            if name in wanted or plain in wanted or f"{name}.time" in wanted:
                _take(log, name, (group, index), wanted, found)
            else:
                size = int(log.groups[group].channel_group.cycles_nr)
                found.mention(name, size, str(log.groups[group].channels[index].unit or ""))
                found.mention(f"{name}.time", size, "s")
    return found


def _take(log: Any, name: str, place: tuple[int, int], wanted: Wanted, found: Found) -> None:  # noqa: ANN401
    """Adds a channel and its time."""
    try:
        signal = log.get(group=place[0], index=place[1])
    except MemoryError:
        raise
    except Exception as e:  # noqa: BLE001 a damaged channel leaves the others readable
        found.unreadable[name] = Reason(f"It cannot be decoded ({e}).", "Check that the log was copied completely.")
        return
    found.add(name, signal.samples, signal.unit or "")
    if f"{name}.time" in wanted:
        found.add(f"{name}.time", signal.timestamps, "s")
