"""How far something is: the line that says so, and how long the rest takes as far as anybody can know."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import pairwise

_FEWEST_ROUNDS = 3  # rounds of all workers before which nothing is said of the rest
_UNSURE = 0.3  # relative deviation of the rest above which nothing is said of it
_BAR, _SHORTEST_BAR = 24, 4  # columns
_SHORTEST_LABEL = 12  # columns that a label keeps
_USUAL_LEFT = len(", ~40 s left")
_GAP = "  "
_TURNING = "-\\|/"


@dataclass
class Pace:
    """When tasks ended that run several at a time, and when the last one will."""

    workers: int  # how many run at a time
    begun: float  # when the first ones did [s]
    ends: list[float] = field(default_factory=list)  # when each was done, those of an earlier run apart [s]

    def left_s(self, remaining: int, now: float) -> float | None:
        """Returns how long the tasks take that remain [s]; None where the tasks so far do not tell.

        Workers end a task each in rounds, and begin the next ones at once. A round took `mean` so far, give or take
        `scatter`, which is itself hardly known after few of them.
        """
        marks = [self.begun, *self.ends[self.workers - 1 :: self.workers]]
        rounds = [end - begin for begin, end in pairwise(marks)]
        if remaining < 1 or len(rounds) < _FEWEST_ROUNDS:
            return None
        count, mean = len(rounds), sum(rounds) / len(rounds)
        scatter = math.sqrt(sum((each - mean) ** 2 for each in rounds) / (count - 1)) * (1 + 2 / (count - 1))
        more, last = divmod(remaining - 1, self.workers)
        if scatter * math.sqrt(1 / count + 1 / (more + 1)) > _UNSURE * mean:
            return None
        begun = [*([self.begun] * self.workers), *self.ends][-self.workers :]
        # One that takes longer than the others may end at any time.
        end = max(begun[last] + mean, now) + more * mean
        return end - now if end > now else None


def roughly(seconds: float) -> str:
    """Writes a time span that nobody knows more closely, as in `2 min 40 s`."""
    step = next((step for step, end in ((5, 57.5), (10, 595), (60, 3570)) if seconds < end), 600)
    minutes, second = divmod(max(step * round(seconds / step), step), 60)
    hours, minute = divmod(minutes, 60)
    counted = ((hours, "h"), (minute, "min"), (second, "s"))
    return " ".join(f"{number} {unit}" for number, unit in counted if number)


def clock(seconds: float) -> str:
    """Writes a time that runs, as in `4:20`, whole seconds."""
    minutes, second = divmod(int(seconds), 60)
    hours, minute = divmod(minutes, 60)
    return f"{hours}:{minute:02d}:{second:02d}" if hours else f"{minute}:{second:02d}"


@dataclass(frozen=True)
class Standing:
    """How far something is at a moment."""

    label: str  # what is made
    place: str  # which of how many such things it is; empty for the only one
    elapsed_s: float  # since it began [s]
    left_s: float | None = None  # until it ends, or None where nobody knows [s]
    done: int = 0  # how many tasks are done
    total: int = 0  # how many there are; a single one tells nothing
    unit: str = ""  # what they are; what is done where nothing is counted

    def line(self, width: int, *, plain: bool = False) -> list[tuple[str, str]]:
        """Returns the parts of a line, each with its style, that is no longer than a terminal is wide.

        The bar gives way first, then the label in its middle; numbers are shown whole or not at all. What is left is
        that of the tasks: something may come after the last one.
        """
        counts = f"{self.done} of {self.total} {self.unit}" if self.total > 1 else "" if self.total else self.unit
        left = f", ~{roughly(self.left_s)} left" if counts and self.left_s is not None else ""
        sign = _TURNING[int(4 * self.elapsed_s) % len(_TURNING)] if self.total < 2 or self.done == self.total else ""
        whole, short = counts + left, counts.removesuffix(f" {self.unit}")
        for place, told, needed in (
            (self.place, whole, _SHORTEST_LABEL),
            ("", whole, _SHORTEST_LABEL),
            ("", counts, 0),
            ("", short, 0),
        ):
            room = width - 1 - _length([place, sign, told, clock(self.elapsed_s)]) - len(_GAP)
            if room >= needed:
                break
        label = shortened(self.label, room) if room > 1 else ""
        # The bar is no longer before anything is known of the rest.
        reserved = max(_USUAL_LEFT - len(left), 0)
        bar = sign or self._bar(min(room - len(label) - len(_GAP) - reserved, _BAR), plain=plain)
        spoken = [(place, "dim"), (label, "bold"), (bar, "green"), (told, ""), (clock(self.elapsed_s), "")]
        shown = [(text, style) for text, style in spoken if text]
        return [part for text, style in shown for part in ((_GAP, ""), (text, style))][1:]

    def _bar(self, length: int, *, plain: bool) -> str:
        if length < _SHORTEST_BAR:
            return ""
        full, empty = "#." if plain else "━─"
        reached = length * self.done // self.total
        return full * reached + empty * (length - reached)


def _length(parts: Iterable[str]) -> int:
    shown = [part for part in parts if part]
    return sum(map(len, shown)) + len(_GAP) * (len(shown) - 1)


def shortened(text: str, width: int) -> str:
    """Leaves out the middle of a text that is too long, which says less than its ends."""
    if len(text) <= width:
        return text
    front = (width - 1) // 2
    return f"{text[:front]}…{text[len(text) - (width - 1 - front) :]}"
