"""What the name and the unit of a variable say: its quantity, whether it was commanded, its side, its joint."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, TypeAlias

from robid.logs.inspection.contents import Column
from robid.logs.inspection.vocabulary import (
    COMMANDED,
    CONVERTED,
    LETTERS,
    MEASURED,
    ROLES,
    SIDES,
    Role,
    Side,
    Stated,
    is_known,
    read_unit,
    tokens,
)
from robid.signals.quantities import UNITS

By: TypeAlias = Literal["unit", "name", "short", "file", ""]
"""What says so: its unit, its name, single letters of it, the log's name, or nothing."""

DRIVING: tuple[Role, ...] = ("torque", "current", "force", "voltage")
MOVING: tuple[Role, ...] = ("angle", "position", "speed", "acceleration")

_LABEL = re.compile(r"\[([A-Za-z][\w-]*)\]")
_BRACKET = re.compile(r"[\[(]\s*([^\[\]()]*?)\s*[\])]\s*$")
_COLUMN = re.compile(r"\((?::,\s*(\d+)|(\d+)\s*,:)\)$")
_AXES = re.compile(r"(^|\.)[XY]([({]\d+[)}])?\.Data$")
_SIGNALS = re.compile(r"(^|\.)signals([({]\d+[)}])?\.values$")
# A name that ends in the letter of a joint or a phase, as `J1_A`
_LETTERED = re.compile(r"^(.*[A-Za-z]\d+)[\s_.]?[A-Z]$")
_SHORT = re.compile("[qi][a-z]")
_DESIRED = re.compile(r"_d(?=(_?\d+|[\[(]\d+[\])])?$)")
_QUANTITIES: dict[str, Role] = {"N m": "torque", "A": "current", "N": "force", "rad": "angle", "m": "position"}
_QUANTITIES |= {"rad/s": "speed", "m/s": "speed", "rad/s^2": "acceleration", "m/s^2": "acceleration"}


@dataclass(frozen=True)
class Hint:
    """What a name and a unit say of a signal."""

    role: Role
    by: By
    commanded: bool | None  # Whether it was commanded; None where nothing says so
    side: Side
    joint: str  # What tells its joint from others, as a number or a label
    unit: str  # Its unit as settings or `CONVERTED` have it; empty where it is not stated, or is none such
    stated: str = ""  # Its unit as the log writes it; empty where it states none
    by_letter: bool = False  # Whether a single letter says so


def unit_of_name(column: Column) -> str:
    """Returns the unit that a signal's name or its log states, as settings write it; else nothing."""
    return _stated(column).unit


_LONG_TIMES = {
    **dict.fromkeys(("min", "mins", "minute", "minutes", "minuten"), "min"),
    **dict.fromkeys(("h", "hr", "hrs", "hour", "hours", "std", "stunden", "heures"), "h"),
}
"""What is a unit of time beside a signal that goes on as one; `min` of another is its least value."""


def time_unit(column: Column) -> tuple[str, str]:
    """Returns the unit that a time's name or its log states, as settings write it, and as stated; else nothing."""
    stated = _stated(column)
    return stated.unit or _LONG_TIMES.get(stated.raw.lower(), ""), stated.raw


def _stated(column: Column) -> Stated:
    """Unit by the title in place of a name that says only where it lies, as Simulink's `out.signals(2).values`."""
    index = _COLUMN.search(column.name)
    lies = column.title and _SIGNALS.search(_COLUMN.sub("", column.name))
    called = f"{column.title}{index[0] if index else ''}" if lies else column.name
    return read_unit(called, column.unit, is_message=column.name.startswith("/"))


def read_names(columns: Sequence[Column]) -> list[Hint]:
    """Reads what names, titles and units of the signals of a recording say.

    Where the names of a log say nothing, as those of joints in a table, the log's own name may. A letter is no unit
    where the same name has other letters, too: they are joints.
    """
    stated = [_stated(one) for one in columns]
    letters: dict[tuple[str, Path | None], set[str]] = {}
    for column in columns:
        stem, letter = _last_letter(column.name)
        letters.setdefault((stem, column.file), set()).add(letter)
    for place, (column, one) in enumerate(zip(columns, stated, strict=True)):
        stem, _ = _last_letter(column.name)
        if one.by_letter and not column.unit and len(letters[stem, column.file] - {""}) > 1:
            stated[place] = Stated("", "", column.name)
    hints = [_hint(column, one) for column, one in zip(columns, stated, strict=True)]
    names = {one.name for one in columns}
    for place, column in enumerate(columns):
        if hints[place].role in DRIVING and _DESIRED.sub("", column.name) in names - {column.name}:
            hints[place] = replace(hints[place], commanded=True)
    for file in dict.fromkeys(one.file for one in columns):
        own = [place for place, one in enumerate(columns) if one.file == file]
        if len(own) < 2 or any(hints[place].role for place in own):
            continue
        role, _ = _role("", tokens(columns[own[0]].source))
        for place in own if role else ():
            hints[place] = replace(hints[place], role=role, by="file")
    return _with_labels(columns, hints)


def of_turning(role: Role) -> Role:
    """What stands for a role where a joint turns: a force of one that slides is the torque of another."""
    turning: dict[Role, Role] = {"force": "torque", "position": "angle"}
    return turning.get(role, role)


def is_desired(name: str, other: str) -> bool:
    """Whether a name is another one's with a `d` for desired, as in `tau_J_d[0]`; of motions it may be a derivative."""
    return _DESIRED.sub("", name) == other != name


def _last_letter(name: str) -> tuple[str, str]:
    """A name without the single letter at its end, and the letter; an empty one where there is none."""
    found = re.search(r"[\s_./(\[]+([A-Za-z])[\])]?$", name)
    return (name[: found.start()], found[1]) if found else (name, "")


def _with_labels(columns: Sequence[Column], hints: list[Hint]) -> list[Hint]:
    """Joints by the words that differ among signals of a kind and recur among kinds, where no number tells them."""
    if any(one.joint for one in hints if one.role in (*DRIVING, *MOVING)):
        return hints
    left = [_left_over(column, hint) for column, hint in zip(columns, hints, strict=True)]
    kinds: dict[tuple[Role, bool | None], list[str]] = {}
    for rest, hint in zip(left, hints, strict=True):
        if hint.role in (*DRIVING, *MOVING):
            kinds.setdefault((of_turning(hint.role), hint.commanded), []).append(rest)
    several = [set(one) for one in kinds.values() if len(one) > 1 and len(set(one)) == len(one) and "" not in one]
    known = {rest for one in several for rest in one if sum(rest in other for other in several) > 1}
    if len(known) < 2:
        return hints
    pairs = zip(left, hints, strict=True)
    return [replace(hint, joint=rest) if hint.role and rest in known else hint for rest, hint in pairs]


def _left_over(column: Column, hint: Hint) -> str:
    """The words of a name that say neither quantity, unit, side nor command."""
    name = _stated(column).rest if hint.stated else column.name
    words = [word for word in tokens(_plain(name)) if not word.isdigit()]
    told = [word for word in words if word in ROLES or word in SIDES or word in COMMANDED or word in MEASURED]
    if not any(word in ROLES for word in told):
        told += [word for word in words if word in LETTERS or _SHORT.fullmatch(word)][:1]
    for word in told:
        words.remove(word)
    return "_".join(words)


def read_name(column: Column) -> Hint:
    """Reads what name, title and unit of a signal say."""
    return _hint(column, _stated(column))


def _hint(column: Column, stated: Stated) -> Hint:
    label = _LABEL.search(stated.rest)
    label = None if label and any(map(is_known, tokens(label[1]))) else label
    own = tokens(_plain(_LETTERED.sub(r"\1", _LABEL.sub("", stated.rest) if label else stated.rest)))
    words = own + tokens(column.title)
    role, by = _role(stated.unit, words, own)
    if by in ("name", "short"):
        role = _derived(role, words.count("dot") + 2 * words.count("ddot"))
    side: Side = next((SIDES[word] for word in words if word in SIDES), "")
    joint = label[1] if label else _joint(stated.rest)
    return Hint(role, by, _commanded(words), side, joint, stated.unit, stated.raw, stated.by_letter)


def _plain(name: str) -> str:
    """A name without what only says where it lies: the topic of messages, the index of a column, a recorder's axes."""
    name = _AXES.sub("", _COLUMN.sub("", name))
    return name.rpartition(".")[2] if name.startswith("/") else name


def _role(unit: str, words: tuple[str, ...], own: tuple[str, ...] = ()) -> tuple[Role, By]:
    """What a unit says, else words, else single letters of the signal's own name."""
    unit = CONVERTED.get(unit, (unit,))[0]
    if unit in UNITS:
        return _QUANTITIES[UNITS[unit].si], "unit"
    if unit == "degC":
        return "other", "unit"
    found = [ROLES[word] for word in words if word in ROLES]
    if unit == "counts/s" and not found:
        return "speed", "unit"
    if unit == "V" and not found:  # recorders state volts, whatever was measured
        return "voltage", "unit"
    if "other" in found:
        return "other", "name"
    # In `position controller torque` what is more special says what it is.
    for role in [one for one in found if one != "position"][-1:] or found[-1:]:
        return role, "name"
    letters = [word if len(word) == 1 else word[:1] for word in own if len(word) == 1 or _SHORT.fullmatch(word)]
    for role in [LETTERS[one] for one in letters if one in LETTERS][:1]:
        return role, "short"
    return "", ""


def _derived(role: Role, order: int) -> Role:
    """The role of a derivative of a signal, as `theta_dot` is one of an angle."""
    motions: tuple[Role, ...] = ("angle", "speed", "acceleration")
    place = 0 if role == "position" else motions.index(role) if role in motions else len(motions)
    if not order or not role:
        return role
    return motions[place + order] if place + order < len(motions) else "other"


def _commanded(words: tuple[str, ...]) -> bool | None:
    if any(word in COMMANDED or re.fullmatch("(ref|cmd|soll|des)[a-z]?", word) for word in words):
        return True
    return False if any(word in MEASURED for word in words) else None


def _joint(name: str) -> str:
    """The number that tells a joint: the last one of the name that is no index of a structure."""
    column = _COLUMN.search(name)
    if column:
        return column[1] or column[2]
    index = _BRACKET.search(name)
    if index and index[1].isdigit():
        return index[1]
    numbers = [word for word in tokens(_plain(_BRACKET.sub("", name))) if word.isdigit()]
    return numbers[-1] if numbers else ""
