"""What was said of the logs of one recording, and what in that contradicts itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from robid.arrays import FloatArray, IntArray
from robid.errors import DataError, SettingsError
from robid.signals.log_channels import input_problems
from robid.signals.log_options import LogOptions
from robid.signals.quantities import INJECTED, units_of

Columns: TypeAlias = Mapping[str, NDArray[Any]]
"""The columns of a log by their names."""


@dataclass(frozen=True, kw_only=True)
class LogMapping(LogOptions):
    """The logs of one recording and their channels."""

    file: Path
    files: Mapping[str, Path] = field(default_factory=dict)  # Further logs, by what their channels call them
    differs: bool = False  # Whether other logs that are read by the same settings have other clocks

    @property
    def variables(self) -> dict[str, tuple[Path, str]]:
        """Log and variable of each column, the time's last."""
        found = {
            one.column: (self.file if one.file is None else self.files[one.file], one.variable) for one in self.channels
        }
        return found if self.time is None else {**found, self.time.variable: (self.file, self.time.variable)}

    def place(self, column: str) -> str:
        """Says where a column comes from."""
        file, variable = self.variables[column]
        return f"{file}: variable `{variable}`"


@dataclass(frozen=True, eq=False)
class Stream:
    """The samples of a variable."""

    column: str  # The column that it is, or is a part of
    name: str
    weight: float  # Its weight in the column
    values: NDArray[Any]  # (n_sample,) Its samples
    # (n_sample,) Its own time stamps, in the unit of the log's time; None where it has none
    stamps: NDArray[Any] | None = None
    clock: str = ""  # The variable that holds them
    held: bool = False  # Whether its numbers stay from one sample to the next, as a command does


@dataclass(frozen=True)
class Stated:
    """What was said of the period."""

    sampling_period_s: float  # Sampling period of the log [s]
    samples: int  # Samples of one period
    periods: int  # Periods that are used
    dropped: int  # Periods that are dropped before
    lines: IntArray  # (n_freq,) Lines that are excited
    find: bool = False  # Whether they are only those among which the excited ones are looked for
    listed: bool = False  # Whether the lines were listed one by one, so that neither a count nor a band says them
    differs: bool = False  # Whether other logs that are read by the same settings have other clocks

    @property
    def period_s(self) -> float:
        """The period [s]."""
        return self.samples * self.sampling_period_s


def set_all(settings: Mapping[str, str]) -> str:
    """Writes settings as a sentence: `Set a to 1, b to 2 and c to 3.`."""
    texts = [f"{name} to {value}" for name, value in settings.items()]
    return f"Set {', '.join(texts[:-1])} and {texts[-1]}." if len(texts) > 1 else f"Set {texts[0]}."


_STILL = "Constant in"
_FEWEST = 16  # samples by which a range is told after which numbers begin again
_BITS = (8, 10, 12, 13, 14, 15, 16, 17, 18, 19, 20, 22, 23, 24, 32)  # bits of counters
_ROUNDING = 1e-3  # part of a range by which rounding may move a jump
_WIDE = 4.0  # usual steps that signed numbers span at least: what switches between two levels is none
_SLOW = 0.1  # part of a range that a sample moves at most, from which jumps by nearly all of it are told
_USUAL = 4.0  # usual steps by which a jump may be beside the range


def check_mapping(mapping: LogMapping, samples_per_period: int, lines: IntArray, kind: str = "") -> None:
    """Checks units, signs, torque constants, lines (n_freq,) and references to a kind of excitation before reading.

    Raises:
        SettingsError: With every contradiction.
    """
    problems = _channels(mapping)
    known = units_of(INJECTED[kind], rotation=True) if kind else ()
    for channel in mapping.references:
        if kind and channel.unit not in known:
            problems.append(f"S346 {channel.name}: {channel.unit} is no unit of a {kind} (known: {', '.join(known)})")
    names = [channel.name for channel in mapping.inputs]
    if mapping.references and [channel.name for channel in mapping.references] != names:
        problems.append(f"S347 the references must be those of the inputs, in their order: {', '.join(names)}")
    if not len(lines) or lines.min() < 1 or 2 * lines.max() >= samples_per_period:
        most = (samples_per_period - 1) // 2
        problems.append(f"S348 the excited lines are not all within 1 to {most}, below Nyquist")
    _refuse(mapping, problems)


def check_shot(mapping: LogMapping) -> None:
    """Checks units, signs and torque constants of a log of one shot before the file is read.

    Raises:
        SettingsError: With every contradiction.
    """
    _refuse(mapping, _channels(mapping))


def _refuse(mapping: LogMapping, problems: list[str]) -> None:
    if problems:
        where = f"log mapping of {mapping.file}"
        raise SettingsError("; ".join(problems), where=where, remedy="Correct the acquire section.")


def _channels(mapping: LogMapping) -> list[str]:
    """What contradicts itself among the channels, whatever was played."""
    problems = []
    if not mapping.outputs:
        problems.append("S349 there is no output channel")
    if not mapping.inputs:
        problems.append("S350 there is no input channel")
    problems += [f"{channel.name}: {problem}" for channel in mapping.channels for problem in channel.problems()]
    problems += input_problems(mapping.inputs)
    problems += [f"{key}: {problem}" for key, problem in mapping.pose_problems()]
    for group in mapping.groups.values():
        names = [channel.name for channel in group]
        problems += [f"S351 {name}: the name occurs twice" for name in dict.fromkeys(names) if names.count(name) > 1]
    return problems


def check_wraps(mapping: LogMapping, streams: Sequence[Stream], part: slice) -> dict[str, DataError]:
    """Finds by column measured angles and counters that begin again, and numbers without their signs, if not stated.

    Their numbers stay within one range, and all that moves them further in a sample is a jump by nearly all of it.

    All samples count but where `part` says which of them are used.
    """
    unsaid = [one for one in mapping.channels if one.unwrap is None and not one.unwraps and not one.problems()]
    measured = {one.column: one for one in unsaid if one in mapping.outputs or not one.goes_on}
    problems: dict[str, DataError] = {}
    for one in streams:
        channel = measured.get(one.column)
        if channel is None:
            continue
        turn = 2 * np.pi / abs(channel.factor)
        turns = [turn, turn * channel.scale] if channel.si_unit == "rad" else []
        values = one.values[part].astype(float)
        found = _wrap_of(values, turns) if channel.goes_on else unsigned_range(values)
        if found is None:
            continue
        size, count = found
        stated = "true" if size in turns else f"{size:.0f}"
        told = "a turn" if size in turns else f"{size:.0f}, a counter's range,"
        what = f"D094 It jumps by {told} {count} times, and stays within: its numbers begin again."
        if not channel.goes_on:
            told = f"{size:.0f} {count} times, and is never negative"
            what = f"D657 It jumps by {told}: numbers with signs were logged without them."
        where = f"{mapping.variables[one.column][0]}: variable `{one.name}`"
        problems[one.column] = DataError(what, where=where, remedy=f"State `unwrap: {stated}` for it.")
    return problems


def unsigned_range(values: FloatArray) -> tuple[float, int] | None:
    """Returns the range of whole numbers (n_sample,) that lost their signs, and how often they jump by it; else None.

    With signs they move smoothly about zero, and by many of their steps.
    """
    known = values[np.isfinite(values)]
    found = None if np.any(known < 0) else _wrap_of(known, ())
    if found is None:
        return None
    signed = np.where(known >= found[0] / 2, known - found[0], known)
    usual = float(np.median(np.abs(np.diff(signed))))
    return found if np.ptp(signed) > _WIDE * usual > 0 else None


def _wrap_of(values: FloatArray, turns: Sequence[float]) -> tuple[float, int] | None:
    """The range, a turn's or a counter's, after which numbers (n_sample,) begin again, and how often; else None."""
    values = values[np.isfinite(values)]
    if len(values) < _FEWEST:
        return None
    steps, span = np.abs(np.diff(values)), float(np.ptp(values))
    ranges = [*turns]
    if np.array_equal(values, np.round(values)):
        ranges += [2.0**bits for bits in _BITS]
    for size in ranges:
        jumps = steps > size / 2
        count = int(np.count_nonzero(jumps))
        if not 0 < count < len(steps) / 2 or span > size * (1 + _ROUNDING):
            continue
        usual = float(np.quantile(steps[~jumps], 0.99))
        if 0 < usual < _SLOW * size and np.all(np.abs(steps[jumps] - size) <= _USUAL * usual + _ROUNDING * size):
            return size, count
    return None


def still_note(mapping: LogMapping, columns: Columns) -> tuple[str, ...]:
    """Names the channels of one shot that never change: their joints stood still, or they were not connected.

    Raises:
        DataError: If no output changes, so that nothing moved.
    """
    still = [one for one in mapping.channels if np.ptp(columns[one.column]) == 0]
    if all(channel in still for channel in mapping.outputs):
        remedy = "Check that the channels were connected and that their variables are the right ones."
        raise DataError("D095 No output changes: nothing moved.", where=str(mapping.file), remedy=remedy)
    told = ", ".join(f"`{channel.variable}` ({columns[channel.column][0]:g})" for channel in still)
    return (f"{_STILL} {mapping.file.name}: {told}; right only where these joints stood still.",) if still else ()


def is_still_note(note: str) -> bool:
    """Whether a note of a record names channels that never change."""
    return note.startswith(_STILL)
