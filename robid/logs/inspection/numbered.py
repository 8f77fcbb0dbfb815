"""Recordings that lie beside each other in one log, told apart by a number in their names, as `exp1.X`, `exp2.X`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from robid.logs.inspection.contents import Column

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
    """Recordings that are told apart by a number.

    Attributes:
        stem: What stands before the number.
        numbers: The numbers as they are written, ascending.
        place: What the word before it tells that they are; empty where it does not.
        alike: Whether all have the same variables.
    """

    stem: str
    numbers: tuple[str, ...]
    place: Place | Literal[""]
    alike: bool

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
    """Parts recordings that lie beside each other in one log.

    Args:
        columns: The signals of the log.

    Returns:
        The recordings, None where there is one only; and the signals of the first one, with those of none.
    """
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
