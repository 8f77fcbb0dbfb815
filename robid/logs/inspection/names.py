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

DRIVING: tuple[Role, ...] = ("torque", "current", "force", "voltage")
MOVING: tuple[Role, ...] = ("angle", "position", "speed", "acceleration")

_WORDS: dict[Role, str] = {
    "torque": "torque torques tau trq tq tor moment mom moments drehmoment effort efforts mdrive",
    "current": "current currents cur curr iq isq amp amps ampere strom",
    "force": "force forces thrust kraft",
    "voltage": "voltage volt volts uq ud vq vd spannung",
    "angle": "angle angles ang theta phi rotation winkel",
    "position": "position positions pos posn enc encoder lage displacement disp travel slide axis qpos",
    "speed": "speed speeds vel velocity velocities omega omegam qd dq qdot dqdt rpm drehzahl geschwindigkeit qvel rate",
    "acceleration": "acceleration accelerations acc accel qdd ddq qddot alpha beschleunigung gyro imu qacc",
    "other": "temperature temp status state flag mode counter count index seq error err warning vdc bus dclink id secs nanosecs"
    " sec nanosec digital din dout msr mask valid quality humidity frame",
}
_ROLE = {word: role for role, words in _WORDS.items() for word in words.split()}
_WEAK: dict[str, Role] = {
    "q": "angle",
    "i": "current",
    "m": "torque",
    "v": "speed",
    "w": "speed",
    "n": "speed",
    "u": "voltage",
}
_WEAK |= {"f": "force", "a": "acceleration", "x": "position", "y": "position", "z": "position", "c": "current"}
_COMMANDED = set(
    "ref reference refs cmd command commanded comm set setpoint sp soll sollwert des desired target tgt demand dem dmd"
    " input told goal plan planned".split()
)
_MEASURED = set("act actual meas measured ist istwert fb feedback ad adx sensor sensed real read".split())
_SIDES: dict[str, Literal["motor", "arm", "tool"]] = {
    **dict.fromkeys("motor mot mtr rotor servo".split(), "motor"),
    **dict.fromkeys("load link arm output joint secondary second table last sek abtrieb".split(), "arm"),
    **dict.fromkeys("tcp tool flange tip tracker ee".split(), "tool"),
}
_BRACKET = re.compile(r"[\[(]\s*([^\[\]()]*?)\s*[\])]\s*$")
_LABEL = re.compile(r"\[([A-Za-z][\w-]*)\]")
_COLUMN = re.compile(r"\(:,\s*(\d+)\)$")
_AXES = re.compile(r"(^|\.)[XY](\(\d+\))?\.Data$")
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
        by: What says so: `unit`, `name`, `short` for single letters, `file` for the log's name, or nothing.
        commanded: Whether it was commanded; None where nothing says so.
        side: Its side, where the name says so.
        joint: What tells its joint from others, as a number or a label.
        unit: Its unit as settings write it; empty where it is not stated, or they know none such.
    """

    role: Role
    by: Literal["unit", "name", "short", "file", ""]
    commanded: bool | None
    side: Literal["motor", "arm", "tool", ""]
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


_ENDINGS = {"nm", "rad", "deg", "rpm", "mm", "ms", "us", "ns", "amps", "counts"}
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
    text = f"{_BRACKET.sub('', column.name) if column.unit or unit else column.name}"
    label = _LABEL.search(column.name)
    own = tokens(_plain(_LABEL.sub("", text)))
    words = own + tokens(column.title)
    role, by = _role(unit, words, own)
    side = next((_SIDES[word] for word in words if word in _SIDES), "")
    joint = label[1] if label else _joint(column.name)
    return Hint(role, by, _commanded(words), side, joint, unit)


def _plain(name: str) -> str:
    """A name without what only says where it lies: the topic of messages, the index of a column, a recorder's axes."""
    name = _AXES.sub("", _COLUMN.sub("", name))
    return name.rpartition(".")[2] if name.startswith("/") else name


def _role(
    unit: str, words: tuple[str, ...], own: tuple[str, ...] = ()
) -> tuple[Role, Literal["unit", "name", "short", ""]]:
    if unit in UNITS:
        return _QUANTITIES[UNITS[unit].si], "unit"
    if unit in ("V", "degC"):
        return ("voltage", "unit") if unit == "V" else ("other", "unit")
    found = [_ROLE[word] for word in words if word in _ROLE]
    # `motor speed of axis 2`: what is most special says what it is.
    strong = [role for role in found if role != "position"] or found
    if strong:
        return strong[-1] if strong[0] != "other" else "other", "name"
    short = next((_WEAK[word] for word in own if word in _WEAK), "")
    if not short:
        short = next((_WEAK[word[0]] for word in own if len(word) == 2 and word[0] in "qi"), "")
    return (short, "short") if short else ("", "")


def _commanded(words: tuple[str, ...]) -> bool | None:
    if any(word in _COMMANDED or re.fullmatch("(ref|cmd|soll|des)[a-z]?", word) for word in words):
        return True
    return False if any(word in _MEASURED for word in words) else None


def _joint(name: str) -> str:
    """The number that tells a joint: the last one of the name that is no index of a structure."""
    column = _COLUMN.search(name)
    if column:
        return column[1]
    numbers = [word for word in tokens(_plain(_BRACKET.sub("", name))) if word.isdigit()]
    return numbers[-1] if numbers else ""
