"""Reads a log whose variables nobody has named: all of a small one, a part of a large one.

Of recordings side by side, told apart by a number in their names as `exp1.X` and `exp2.X`, the first one.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.logs.formats.load import load_variables
from robid.logs.formats.unpacking import open_bytes
from robid.logs.formats.variables import FORMATS, Variables, measurable, series_of, series_place, tell_format
from robid.signals.log_options import Dialect, LogFormat

_TABLE_BYTES = 1 << 27  # bytes of a table of text that are looked at
_VALUES = 1 << 26  # values of a large log that are looked at; whole variables, in their order
_WHOLE_BYTES = 1 << 27  # bytes of a binary log up to which all of it is read at once
_FEWEST = 8  # samples from which a variable is a signal
_COLUMNS = 64  # columns or rows of a matrix that are looked at
_TOLD = 20  # variables of which it is told why they are no signals
_REMEDIES = 3  # remedies that are told with them
_TEXT = "It contains text, not numbers."
_TITLES = {**dict.fromkeys(("Data", "Signal", "Value"), ("Name",)), "values": ("label", "title", "blockName")}
"""Fields of a structure that say what the numbers in another one are."""


@dataclass(frozen=True, eq=False)
class Column:
    """A signal of a log."""

    name: str  # Its name, as a mapping writes it
    values: FloatArray  # (n_sample,) Its samples
    unit: str = ""
    title: str = ""
    group: str = ""  # What it shares its samples with, as the topic of its messages
    file: Path | None = None  # The log that it is of; None for the first of several
    source: str = ""  # Name of its log without what follows the dot

    @property
    def key(self) -> str:
        """Its name among the signals of several logs."""
        return self.name if self.file is None else f"{self.name} of {self.file.name}"


@dataclass(frozen=True)
class Contents:
    """What was read of a log: signals, single numbers, names of texts, what cannot be read with the reason.

    Notes say what was not looked at, and damage.
    """

    file: Path
    format: LogFormat
    columns: tuple[Column, ...]
    scalars: Mapping[str, float]
    texts: tuple[str, ...]
    unreadable: Mapping[str, str]
    notes: tuple[str, ...]


def read_contents(file: Path, format_: LogFormat | None = None, dialect: Dialect | None = None) -> Contents:
    """Reads the signals of a log; format and dialect are told from it where they are None.

    Raises:
        DataError: If it cannot be read, or holds no numbers.
    """
    dialect = dialect or Dialect()
    variables, notes = _read(file, format_, dialect)
    columns, scalars, odd = _sort_out(variables)
    told = format_ or tell_format(file)
    if FORMATS[told].holds == "messages":
        columns = list(_labelled(columns))
    damage = variables.found.damage
    if not columns and damage is not None:
        raise DataError(damage.what, where=str(file), remedy=damage.remedy)
    if not columns:
        raise _without_signals(file, variables, scalars, odd)
    unreadable = {name: one.what for name, one in variables.unreadable.items() if name not in variables.texts}
    texts = [name for name, one in variables.unreadable.items() if name in variables.texts or one.what == _TEXT]
    unreadable = {name: what for name, what in unreadable.items() if what != _TEXT}
    notes += [] if damage is None else [f"{damage.what} {damage.remedy}"]
    columns, wild = _without_wild([replace(one, source=file.name.partition(".")[0]) for one in columns])
    notes += wild
    return Contents(file, told, tuple(columns), scalars, tuple(texts), {**unreadable, **odd}, tuple(notes))


def _without_wild(columns: Sequence[Column]) -> tuple[list[Column], list[str]]:
    """The signals without values that nothing measures and whose powers overflow; and what was left out."""
    kept, notes = [], []
    for one in columns:
        wild = np.isfinite(one.values) & ~measurable(one.values)
        kept.append(replace(one, values=np.where(wild, np.nan, one.values)) if wild.any() else one)
        if wild.any():
            first, count = int(np.argmax(wild)), int(wild.sum())
            notes.append(
                f"`{one.name}`: {count} value{'s' * (count > 1)} left out, {one.values[first]:.2g} at sample {first} "
                "first: no sensor gives that. Copy the log again: it may be damaged."
            )
    return kept, notes


def _without_signals(
    file: Path, variables: Variables, scalars: Mapping[str, float], odd: Mapping[str, str]
) -> DataError:
    found = [(name, one.what, one.remedy) for name, one in variables.unreadable.items()]
    found += [(name, why, "") for name, why in odd.items()]
    found += [(name, "It is a single number.", "") for name in scalars]
    if not found:
        remedy = "Check that it is the right file; state `--format` where it is recognized wrongly."
        return DataError("D091 The log contains no signals: it has no variables.", where=str(file), remedy=remedy)
    told = [f"\n  `{name}`: {what}" for name, what, _ in found[:_TOLD]]
    told += [f"\n  and {len(found) - _TOLD} more"] if len(found) > _TOLD else []
    remedies = dict.fromkeys(remedy for _, _, remedy in found if remedy)
    general = "Check that it is the right file; state `--format` or `--dialect` where it is recognized wrongly."
    what = f"D092 The log contains no signals, as none of its variables is one:{''.join(told)}"
    return DataError(what, where=str(file), remedy=" ".join([*list(remedies)[:_REMEDIES], general]))


def join_contents(read: Sequence[Contents]) -> Contents:
    """Joins what was read of several logs of one recording."""
    first, *others = read
    columns, texts = [*first.columns], [*first.texts]
    unreadable, notes = dict(first.unreadable), list(first.notes)
    for one in others:
        columns += [replace(column, file=one.file) for column in one.columns]
        texts += [f"{name} of {one.file.name}" for name in one.texts]
        unreadable |= {f"{name} of {one.file.name}": reason for name, reason in one.unreadable.items()}
        notes += [f"{one.file.name}: {note}" for note in one.notes]
    scalars = {name: value for one in reversed(read) for name, value in one.scalars.items()}
    return Contents(first.file, first.format, tuple(columns), scalars, tuple(texts), unreadable, tuple(notes))


def _read(file: Path, format_: LogFormat | None, dialect: Dialect) -> tuple[Variables, list[str]]:
    """Reads all of a log, or what of it there is room for."""
    if not file.is_file():
        return load_variables(file, format_, None, dialect), []
    size, told = file.stat().st_size, format_ or tell_format(file)
    if told == "csv":
        return _read_table(file, dialect)
    if size <= _WHOLE_BYTES:
        return load_variables(file, format_, None, dialect), []
    listed = load_variables(file, format_, (), dialect)
    chosen: list[str] = []
    room = _VALUES
    for name, count in listed.sizes.items():
        if count <= room:
            chosen.append(name)
            room -= count
    left = len(listed.sizes) - len(chosen)
    notes = [f"Only {len(chosen)} of {len(listed.sizes)} variables were looked at; the log is large."] if left else []
    return load_variables(file, format_, chosen, dialect), notes


def _read_table(file: Path, dialect: Dialect) -> tuple[Variables, list[str]]:
    """Reads a table of text, the beginning of a large one."""
    if file.stat().st_size <= _TABLE_BYTES // 8:  # packed ones become larger
        return load_variables(file, "csv", None, dialect), []
    with open_bytes(file) as stream:
        start = stream.read(_TABLE_BYTES)
        more = bool(stream.read(1))
    if not more:
        return load_variables(file, "csv", None, dialect), []
    with tempfile.TemporaryDirectory() as folder:
        part = Path(folder) / file.name.removesuffix(".gz")
        part.write_bytes(start[: start.rfind(b"\n") + 1])
        found = load_variables(part, "csv", None, dialect)
    found.found.damage = None  # what is missing was left out here
    return replace(found, file=file), [f"Only the first {len(start) >> 20} MB of the table were looked at."]


def _sort_out(variables: Variables) -> tuple[list[Column], dict[str, float], dict[str, str]]:
    columns: list[Column] = []
    scalars: dict[str, float] = {}
    odd: dict[str, str] = {}
    for name, array in variables.items():
        if array.dtype.kind not in "fiub":
            odd[name] = f"It contains {array.dtype} values, not real numbers."
        elif array.size == 1:
            scalars[name] = float(array.ravel()[0])
        elif array.size == max(array.shape, default=0):
            if array.size >= _FEWEST:
                columns.append(_column(variables, name, array.ravel()))
            else:
                odd[name] = f"It has {array.size} values, and a signal has {_FEWEST} at least."
        elif (length := max(array.shape, default=0)) >= _FEWEST and array.size <= _COLUMNS * length:
            for index in series_of(array.shape):
                place = series_place(index, array.shape)
                columns.append(_column(variables, f"{name}{index}", array[place], name))
        else:
            told = f"more than {_COLUMNS} series of {length}" if length >= _FEWEST else f"fewer than {_FEWEST}"
            odd[name] = f"It has shape {array.shape}, {told} samples."
    return columns, scalars, odd


def _column(variables: Variables, name: str, values: NDArray[Any], matrix: str = "") -> Column:
    parent, _, last = (matrix or name).rpartition(".")
    fields = _TITLES.get(last, ())
    title = next((text for field in fields if (text := variables.texts.get(f"{parent}.{field}", ""))), "")
    unit = variables.units.get(name, "") or variables.units.get(matrix, "")
    return Column(name, np.asarray(values, float), unit, title)


def _labelled(columns: list[Column]) -> Iterator[Column]:
    """Signals of messages, each once: by its label where it has one, `effort[elbow]` in place of `effort[0]`."""
    labelled = {one.name.partition("[")[0] for one in columns if _label(one.name) and not _label(one.name).isdigit()}
    for one in columns:
        stem, label = one.name.partition("[")[0], _label(one.name)
        if label.isdigit() and stem in labelled:
            continue
        yield replace(one, group=one.name.partition(".")[0])


def _label(name: str) -> str:
    """What stands in the brackets at the end of a name."""
    return name.rpartition("[")[2].rstrip("]") if name.endswith("]") else ""


Place: TypeAlias = Literal["configuration", "realization", "experiment"]

_WORDS: dict[str, Place | Literal[""]] = {
    **dict.fromkeys(("exp", "experiment", "experiments", "versuch"), "experiment"),
    **dict.fromkeys(("real", "realization", "realisation", "repetition", "rep"), "realization"),
    **dict.fromkeys(("conf", "config", "configuration"), "configuration"),
    **dict.fromkeys(("run", "trial", "test", "rec", "record", "recording", "measurement", "messung", "shot"), ""),
}
"""Words before such a number, and what each tells: nothing of those that are used for any recording."""

_NUMBER = re.compile(rf"(?<![A-Za-z])(({'|'.join(_WORDS)})[_-]?[({{]?)(\d+)(?=[^0-9A-Za-z].*[A-Za-z])", re.IGNORECASE)


@dataclass(frozen=True)
class Numbered:
    """Recordings that are told apart by a number."""

    stem: str  # What stands before the number
    numbers: tuple[str, ...]  # The numbers as they are written, ascending
    place: Place | Literal[""]  # What the word before it tells that they are; empty where it does not
    alike: bool  # Whether all have the same variables

    @property
    def count(self) -> int:
        """Recordings that one mapping reads: they count from 1 and have the same variables; else the first alone."""
        width = len(self.numbers[0])
        counted = all(one == f"{index:0{width}d}" for index, one in enumerate(self.numbers, 1))
        return len(self.numbers) if counted and self.alike else 1

    @property
    def told(self) -> str:
        """Which they are, in words."""
        first, last = (f"`{self.stem}{one}`" for one in (self.numbers[0], self.numbers[-1]))
        return f"{len(self.numbers)} recordings side by side, {first} to {last}"

    def write(self, name: str, place: str) -> str:
        """Returns a variable's name with the name of a place where its number was."""
        width = len(self.numbers[0])
        number = f"{{{place}:0{width}d}}" if width > 1 else f"{{{place}}}"
        return _NUMBER.sub(lambda found: f"{found[1]}{number}" if found[1] == self.stem else found[0], name, count=1)

    def place_among(self, n_input: int) -> tuple[Place, str]:
        """Returns what they are taken for where so many signals drive, and what to check about that."""
        if self.count == 1:
            reason = "do not count from 1" if self.alike else "have other variables"
            return "experiment", f"{self.told}: the first one alone is read, as the numbers {reason}"
        if self.place == "configuration":
            return "configuration", f"{self.told}: needs a robot file and {self.count} configurations"
        if self.place == "experiment" and self.count > n_input:
            why = f"{n_input} input{'s' if n_input > 1 else ''} take{'' if n_input > 1 else 's'} no more experiments"
            return "realization", f"{self.told}, taken for realizations, as {why}"
        if self.place:
            return self.place, f"{self.told}, {self.place}s by their name"
        fits = self.count == n_input > 1
        taken, other = ("experiment", "realization") if fits else ("realization", "experiment")
        return ("experiment" if fits else "realization"), f"{self.told}, taken for {taken}s; they may be {other}s"


def part_numbered(columns: Sequence[Column]) -> tuple[Numbered | None, list[Column]]:
    """Parts recordings beside each other in one log: these, or None, and the signals of the first one and of none."""
    members: dict[str, dict[str, dict[str, Column]]] = {}
    for one in columns:
        found = _NUMBER.search(one.name)
        if found is not None:
            rest = f"{one.name[: found.start()]}{one.name[found.end() :]} {one.file}"
            members.setdefault(found[1], {}).setdefault(found[3], {})[rest] = one
    several = {stem: own for stem, own in members.items() if len(own) > 1}
    if not several:
        return None, list(columns)
    stem = max(several, key=lambda one: sum(map(len, several[one].values())))
    numbers = sorted(several[stem], key=int)
    first = several[stem][numbers[0]]
    alike = all(own.keys() == first.keys() for own in several[stem].values())
    place = _WORDS[re.sub("[^a-z]", "", stem.lower())]
    left = {id(one) for number in numbers[1:] for one in several[stem][number].values()}
    return Numbered(stem, tuple(numbers), place, alike), [one for one in columns if id(one) not in left]
