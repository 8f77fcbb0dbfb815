"""What the name and the unit of a variable say: its quantity, whether it was commanded, its side, its joint."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

from robid.logs.inspection.contents import Column
from robid.signals.quantities import UNITS

Role: TypeAlias = Literal[
    "torque", "current", "force", "voltage", "angle", "position", "speed", "acceleration", "other", ""
]
"""What a signal is; `other` is none of a drive's, an empty one is unknown."""

By: TypeAlias = Literal["unit", "name", "short", "file", ""]
"""What says so: its unit, its name, single letters of it, the log's name, or nothing."""

DRIVING: tuple[Role, ...] = ("torque", "current", "force", "voltage")
MOVING: tuple[Role, ...] = ("angle", "position", "speed", "acceleration")

_WORDS: dict[Role, str] = {
    "torque": "torque torques tau trq tq tor moment mom moments drehmoment effort efforts",
    "current": "current currents cur curr iq isq amp amps ampere strom",
    "force": "force forces thrust kraft",
    "voltage": "voltage volt volts uq ud vq vd spannung",
    "angle": "angle angles ang theta phi rotation winkel",
    "position": "position positions pos posn enc encoder lage displacement disp travel slide qpos",
    "speed": "speed speeds vel velocity velocities omega qd dq qdot dqdt rpm drehzahl geschwindigkeit qvel tacho"
    " tachometer",
    "acceleration": "acceleration accelerations acc accel qdd ddq qddot beschleunigung qacc",
    "other": "temperature temp status state flag mode counter count index seq error err warning vdc bus dclink id sec"
    " secs nanosec nanosecs digital din dout msr mask valid quality humidity frame",
}
_ROLE = {word: role for role, words in _WORDS.items() for word in words.split()}
_WEAK: dict[str, Role] = {
    **{"q": "angle", "x": "position", "y": "position", "z": "position", "v": "speed", "w": "speed", "n": "speed"},
    **{"a": "acceleration", "m": "torque", "f": "force", "i": "current", "c": "current", "u": "voltage"},
}
_COMMANDED = frozenset(
    (
        *("ref", "reference", "refs", "cmd", "command", "commanded", "set", "setpoint", "sp", "soll", "sollwert"),
        *("des", "desired", "target", "tgt", "demand", "dem", "dmd", "input", "goal", "planned"),
    )
)
_MEASURED = frozenset(("act", "actual", "meas", "measured", "ist", "istwert", "fb", "feedback", "ad", "adx", "sensor"))
Side: TypeAlias = Literal["motor", "arm", "tool", ""]
_SIDES: dict[str, Side] = {
    **dict.fromkeys(("motor", "mot", "mtr", "rotor", "servo"), "motor"),
    **dict.fromkeys(("load", "link", "arm", "output", "secondary", "second", "table", "last", "abtrieb"), "arm"),
    **dict.fromkeys(("tcp", "tool", "flange", "tip", "tracker", "ee"), "tool"),
}
_BRACKET = re.compile(r"[\[(]\s*([^\[\]()]*?)\s*[\])]\s*$")
_LABEL = re.compile(r"\[([A-Za-z][\w-]*)\]")
_COLUMN = re.compile(r"\((?::,|(?=\d+,.*:))(\d+)[^)]*\)$")
_AXES = re.compile(r"(^|\.)[XY]([({]\d+[)}])?\.Data$")
_LABELLED = re.compile(r"(^|\.)signals([({]\d+[)}])?\.values$")
_SHORT = re.compile("[qi][a-z]")
_TOKEN = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
_SPELLINGS = {
    **{name.replace(" ", "").lower(): name for name in UNITS},
    **dict.fromkeys(("n*m", "n·m", "newtonmeter", "newtonmetre"), "N m"),
    **dict.fromkeys(("°", "degree", "degrees", "grad"), "deg"),
    **dict.fromkeys(("°/s", "deg/sec", "degrees/s", "dps"), "deg/s"),
    **dict.fromkeys(("1/min", "u/min", "r/min", "rev/min", "min^-1", "min-1"), "rpm"),
    **dict.fromkeys(("rad/s²", "rad/s2", "rad/s/s"), "rad/s^2"),
    **dict.fromkeys(("m/s²", "m/s2"), "m/s^2"),
    **dict.fromkeys(("°/s²", "deg/s²", "deg/s2"), "deg/s^2"),
    **dict.fromkeys(("amp", "amps", "ampere", "arms", "apk"), "A"),
    **dict.fromkeys(("rev", "turns", "revolutions", "u", "r"), "turn"),
    **dict.fromkeys(("radian", "radians"), "rad"),
    **dict.fromkeys(("rad/sec", "radians/s"), "rad/s"),
    **dict.fromkeys(("count", "counts", "inc", "incr", "increments", "ticks"), "counts"),
    **dict.fromkeys(("µm", "μm"), "um"),
    **dict.fromkeys(("µs", "μs", "usec"), "us"),
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), "s"),
    **dict.fromkeys(("ms", "msec"), "ms"),
    **dict.fromkeys(("ns", "nsec"), "ns"),
    **dict.fromkeys(("v", "volt", "volts"), "V"),
    **dict.fromkeys(("°c", "degc", "k"), "degC"),
}
_QUANTITIES: dict[str, Role] = {"N m": "torque", "A": "current", "N": "force", "rad": "angle", "m": "position"}
_QUANTITIES |= {"rad/s": "speed", "m/s": "speed", "rad/s^2": "acceleration", "m/s^2": "acceleration"}


@dataclass(frozen=True)
class Hint:
    """What a name and a unit say of a signal.

    Attributes:
        role: What it is.
        by: What says so.
        commanded: Whether it was commanded; None where nothing says so.
        side: Its side, where the name says so.
        joint: What tells its joint from others, as a number or a label.
        unit: Its unit as settings write it; empty where it is not stated, or they know none such.
    """

    role: Role
    by: By
    commanded: bool | None
    side: Side
    joint: str
    unit: str


def tokens(name: str) -> tuple[str, ...]:
    """Returns the words and numbers of a name, in lower case."""
    return tuple(one.lower() for one in _TOKEN.findall(name))


def unit_of_name(column: Column) -> str:
    """Returns the unit that a signal states, or that its name ends with, as settings write it; else nothing."""
    stated = column.unit
    if not stated and not _COLUMN.search(column.name):
        found = _BRACKET.search(column.name)
        stated = found[1] if found else ""
    known = _SPELLINGS.get(stated.lower().replace(" ", "").strip("[]()"), "")
    if known or stated:
        return known
    last = re.split(r"[_.]", column.name)[-1].lower()
    return _SPELLINGS.get(last, "") if last in _ENDINGS and "_" in column.name else ""


_ENDINGS = {"nm", "mnm", "knm", "kn", "rad", "mrad", "urad", "deg", "rpm", "mm", "ms", "us", "ns", "amps", "counts"}
"""Last words of names, as in `torque_nm`, that are units."""


def read_names(columns: Sequence[Column]) -> list[Hint]:
    """Reads what names, titles and units of the signals of a recording say.

    Where the names of a log say nothing, as those of joints in a table, the log's own name may.
    """
    hints = [read_name(one) for one in columns]
    for file in dict.fromkeys(one.file for one in columns):
        own = [place for place, one in enumerate(columns) if one.file == file]
        if len(own) < 2 or any(hints[place].role for place in own):
            continue
        role, _ = _role("", tokens(columns[own[0]].source))
        for place in own if role else ():
            hints[place] = replace(hints[place], role=role, by="file")
    return hints


def read_name(column: Column) -> Hint:
    """Reads what name, title and unit of a signal say."""
    unit = unit_of_name(column)
    name = column.name
    if _LABELLED.search(_COLUMN.sub("", name)) and column.title:  # a name that says only where it lies
        name = f"{column.title}{found[0]}" if (found := _COLUMN.search(name)) else column.title
    text = f"{_BRACKET.sub('', name) if column.unit or unit else name}"
    label = _LABEL.search(text)
    own = tokens(_plain(_LABEL.sub("", text)))
    words = own + tokens(column.title)
    role, by = _role(unit, words, own)
    side: Side = next((_SIDES[word] for word in words if word in _SIDES), "")
    joint = label[1] if label else _joint(name)
    return Hint(role, by, _commanded(words), side, joint, unit)


def _plain(name: str) -> str:
    """A name without what only says where it lies: the topic of messages, the index of a column, a recorder's axes."""
    name = _AXES.sub("", _COLUMN.sub("", name))
    return name.rpartition(".")[2] if name.startswith("/") else name


def _role(unit: str, words: tuple[str, ...], own: tuple[str, ...] = ()) -> tuple[Role, By]:
    """What a unit says, else words, else single letters of the signal's own name."""
    if unit in UNITS:
        return _QUANTITIES[UNITS[unit].si], "unit"
    if unit == "degC":
        return "other", "unit"
    found = [_ROLE[word] for word in words if word in _ROLE]
    if unit == "V" and not found:  # recorders state volts, whatever was measured
        return "voltage", "unit"
    if "other" in found:
        return "other", "name"
    # In `position controller torque` what is more special says what it is.
    for role in [one for one in found if one != "position"][-1:] or found[-1:]:
        return role, "name"
    letters = [word if len(word) == 1 else word[:1] for word in own if len(word) == 1 or _SHORT.fullmatch(word)]
    for role in [_WEAK[one] for one in letters if one in _WEAK][:1]:
        return role, "short"
    return "", ""


def _commanded(words: tuple[str, ...]) -> bool | None:
    if any(word in _COMMANDED or re.fullmatch("(ref|cmd|soll|des)[a-z]?", word) for word in words):
        return True
    return False if any(word in _MEASURED for word in words) else None


def _joint(name: str) -> str:
    """The number that tells a joint: the last one of the name that is no index of a structure."""
    column = _COLUMN.search(name)
    if column:
        return column[1]
    index = _BRACKET.search(name)
    if index and index[1].isdigit():
        return index[1]
    numbers = [word for word in tokens(_plain(_BRACKET.sub("", name))) if word.isdigit()]
    return numbers[-1] if numbers else ""
