"""Times that stand in two variables: whole seconds, and what is beyond them, as ROS 2 and POSIX have them."""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np

from robid.logs.formats.variables import Found, Reason

_SECONDS = re.compile(r"(?i)^(?:(.+)([._/]))?(?:sec|secs|seconds)$")
_BEYOND = (
    *((name, 10**9) for name in ("nanosec", "nanosecs", "nanoseconds", "nsec", "nsecs")),
    *((name, 10**6) for name in ("usec", "usecs", "microsec", "microseconds")),
)
_ALONE = "stamp"  # the name of such a time, where its parts have no name in common
_DATED = 10**8  # seconds from which a time counts from 1970


def split_stamps(names: Iterable[str]) -> dict[str, tuple[str, str, int]]:
    """Returns by the name of a time its variables of seconds and of what is beyond them, and of how many to a second.

    `header.stamp.sec` and `header.stamp.nanosec` make `header.stamp`; a time that is there already is left out.
    """
    known = {name.lower(): name for name in names}
    stamps = {}
    for name in known.values():
        if (match := _SECONDS.match(name)) is None:
            continue
        head, mark = match[1] or "", match[2] or ""
        made = head or _ALONE
        beyond = ((known.get(f"{head}{mark}{one}".lower()), per) for one, per in _BEYOND)
        part = next(((one, per) for one, per in beyond if one is not None), None)
        if part is not None and made.lower() not in known:
            stamps[made] = (name, *part)
    return stamps


def add_stamp(found: Found, made: str, parts: tuple[str, str, int]) -> None:
    """Adds a time since the first second of its two variables [s], where both were read."""
    first, second, per = parts
    if first in found.arrays and second in found.arrays:
        seconds, beyond = found.arrays[first], found.arrays[second]
        known = np.isfinite(seconds) & np.isfinite(beyond) if len(seconds) == len(beyond) else np.zeros(0, bool)
        whole = seconds[known] == np.round(seconds[known]) if known.any() else np.zeros(1, bool)
        if not whole.all() or not np.all((beyond[known] >= 0) & (beyond[known] < per)):
            what = f"D656 `{first}` and `{second}` are no whole seconds and what is beyond them, 0 to {per:.0e}."
            found.unreadable[made] = Reason(what, "Name a variable that is a time of its own.")
            return
        start = int(seconds[known][0])
        # Seconds since 1970 and nanoseconds together have more digits than a float.
        found.arrays[made] = np.where(known, (seconds - start) + beyond / per, np.nan)
        if start >= _DATED:
            found.origins[made] = "1970", start * 10**9
    found.mention(made, found.sizes[first], "s")
