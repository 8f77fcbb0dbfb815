"""Which variables of a MAT file are times, and in which units others are, by the structures that tools save."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from robid.logs.formats.variables import Found, Wanted

_AXIS = re.compile(r"(.*?)\.X([({]\d+[)}])?\.Data")
_CHANNEL = re.compile(r"(.*?)\.Y([({]\d+[)}])?\.Data")
_CLOCK = re.compile(r"(.*?)\.Y([({]\d+[)}])?\.Data\.time")
_INDICES = ("", *(f"({i})" for i in range(1, 17)), *(f"{{{i}}}" for i in range(1, 17)))
_SIGNALS = re.compile(r"(.*?)\.signals([({]\d+[)}])?\.values")
_UNIT = re.compile(r"[\[(]\s*([^\[\]()]*?)\s*[\])]\s*$")
_SERIES = re.compile(r"(.*?)\.(Time|Data)")
_INFO = {"Time": "TimeInfo", "Data": "DataInfo"}


def note_units(found: Found) -> None:
    """Notes units that the structures of a MAT file say by what they are; those that it states stay.

    A recording of ControlDesk has channels `Y(2).Data` over times `X(1).Data`, Simulink's structure with time
    `signals(2).values` over `time`, its block To File a matrix whose first row is time, a time series `Data` over
    `Time`.
    """
    for name, unit in list(_units(found)):
        found.units.setdefault(name, unit)


def _units(found: Found) -> Iterator[tuple[str, str]]:
    for name in found.sizes:
        if (axis := _AXIS.fullmatch(name)) and _has_channels(found, axis[1]):
            if name not in found.arrays or np.all(np.diff(found.arrays[name].ravel()) > 0):
                yield name, "s"
        elif signals := _SIGNALS.fullmatch(name):
            yield f"{signals[1]}.time", "s"
            label = _UNIT.search(found.texts.get(f"{name.removesuffix('.values')}.label", ""))
            if label:
                yield name, label[1]
        elif series := _SERIES.fullmatch(name):
            info = f"{series[1]}.{_INFO[series[2]]}.Units"
            if info in found.texts:
                yield name, found.texts[info]
        elif name in found.arrays and _is_timed(found.arrays[name]):
            yield f"{name}(1,:)", "s"


def with_clocks(wanted: Wanted) -> Wanted:
    """Returns what was asked for, with what tells the times of channels of ControlDesk, as `Y(2).Data.time`."""
    asked = [found for name in wanted.names or () if (found := _CLOCK.fullmatch(name))]
    if not asked or wanted.names is None:
        return wanted
    axes = [f"{one[1]}.X{index}.Data" for one in asked for index in _INDICES]
    return Wanted([*wanted.names, *axes, *(f"{one[1]}.Y{one[2] or ''}.XIndex" for one in asked)])


def add_clocks(found: Found, wanted: Wanted) -> None:
    """Adds the times of channels that ControlDesk recorded in several rasters, each over one of several `X(1).Data`."""
    axes: dict[str, list[str]] = {}
    for name in found.sizes:
        if axis := _AXIS.fullmatch(name):
            axes.setdefault(axis[1], []).append(name)
    channels = {name: axes.get(one[1], []) for name in found.sizes if (one := _CHANNEL.fullmatch(name))}
    for name, times in channels.items():
        if len(times) < 2:
            continue
        index = found.arrays.get(f"{name.removesuffix('.Data')}.XIndex")
        place = int(index.ravel()[0]) - 1 if index is not None and index.size == 1 else -1
        if f"{name}.time" in wanted and 0 <= place < len(times) and times[place] in found.arrays:
            found.add(f"{name}.time", found.arrays[times[place]].ravel(), "s")
        else:
            found.mention(f"{name}.time", found.sizes[name], "s")


def _has_channels(found: Found, recording: str) -> bool:
    return any(name.startswith(f"{recording}.Y") and name.endswith(".Data") for name in found.sizes)


def _is_timed(matrix: NDArray[np.generic]) -> bool:
    """Whether the first row of a wide matrix is time, as Simulink writes it to a file: it alone rises all the way."""
    if matrix.ndim != 2 or not 1 < matrix.shape[0] < matrix.shape[1] or matrix.dtype.kind != "f":
        return False
    rises = np.all(np.diff(matrix, axis=1) > 0, axis=1)
    return bool(rises[0] and not rises[1:].any())
