"""Reads TDMS files: channels as `group/channel`, their time, where the file states a rate, as `group/channel.time`."""

from __future__ import annotations

from pathlib import Path

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
                found.add(f"{name}.time", float(step) * np.arange(len(channel)), "s")
            elif step:
                found.mention(f"{name}.time", len(channel), "s")
    return found
