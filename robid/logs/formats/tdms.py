"""Reads TDMS files: channels as `group/channel`, their time, where the file states a rate, as `group/channel.time`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from nptdms import TdmsFile

from robid.logs.formats.variables import Found, Reason, Wanted

_CUT = Reason("The log is cut short.", "Check that it was copied completely, or save it again.")


def read(file: Path, wanted: Wanted) -> Found:
    """Reads channels of a TDMS file, scaled as it says."""
    found = Found()
    with TdmsFile.open(file) as log:
        if log.file_status.incomplete_final_segment or not log.groups():
            found.damage = _CUT
        statuses = log.file_status.channel_statuses or {}
        starts = [channel.properties.get("wf_start_time") for group in log.groups() for channel in group.channels()]
        begun = min((start for start in starts if start is not None), default=None)
        for channel in (channel for group in log.groups() for channel in group.channels()):
            name = f"{channel.group_name}/{channel.name}"
            cut = statuses.get(channel.path)
            if cut is not None and cut.read_length != cut.expected_length:
                what = f"The log ends inside it: {cut.read_length} of {cut.expected_length} values are there."
                found.unreadable[name] = Reason(what, _CUT.remedy)
                continue
            unit = str(channel.properties.get("unit_string", ""))
            if name in wanted:
                try:
                    found.add(name, channel[:], unit)
                except MemoryError:
                    raise
                except Exception as e:  # noqa: BLE001 a damaged channel leaves the others readable
                    found.unreadable[name] = Reason(
                        f"It is damaged ({e}).", "Check that the log was copied completely."
                    )
            elif channel.dtype is not None and channel.dtype.kind in "fiubc":
                found.mention(name, len(channel), unit)
            step = channel.properties.get("wf_increment")
            if step and f"{name}.time" in wanted:
                first = _first_s(channel.properties, begun)
                found.add(f"{name}.time", first + float(step) * np.arange(len(channel)), "s")
            elif step:
                found.mention(f"{name}.time", len(channel), "s")
    return found


def _first_s(properties: Mapping[str, Any], begun: Any) -> float:  # noqa: ANN401
    """When the first sample of a channel was taken, since the first channel began [s]."""
    start = properties.get("wf_start_time")
    late = 0.0 if start is None or begun is None else float((start - begun) / np.timedelta64(1, "s"))
    return late + float(properties.get("wf_start_offset") or 0.0)
