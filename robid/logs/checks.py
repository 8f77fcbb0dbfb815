"""Checks of a log against what was said about it; each returns its problems."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robid.arrays import IntArray
from robid.errors import DataError, SettingsError
from robid.logs.mapping import LogMapping
from robid.signals.log_channels import LogChannel, input_problems
from robid.signals.quantities import INJECTED, units_of

_STILL = "Constant in"


def check_mapping(mapping: LogMapping, samples_per_period: int, lines: IntArray, kind: str = "") -> None:
    """Checks units, signs, torque constants and lines before the file is read.

    Args:
        mapping: The log mapping.
        samples_per_period: The stated period.
        lines (n_freq,): Lines that were said to be excited.
        kind: Kind of the excitation that references are matched to.

    Raises:
        SettingsError: With every contradiction.
    """
    problems = _channels(mapping)
    known = units_of(INJECTED[kind], rotation=True) if kind else ()
    for channel in mapping.references:
        if kind and channel.unit not in known:
            problems.append(f"{channel.name}: {channel.unit} is no unit of a {kind} (known: {', '.join(known)})")
    names = [channel.name for channel in mapping.inputs]
    if mapping.references and [channel.name for channel in mapping.references] != names:
        problems.append(f"the references must be those of the inputs, in their order: {', '.join(names)}")
    if not len(lines) or lines.min() < 1 or 2 * lines.max() >= samples_per_period:
        problems.append(f"the excited lines are not all within 1 to {(samples_per_period - 1) // 2}, below Nyquist")
    _refuse(mapping, problems)


def check_shot(mapping: LogMapping) -> None:
    """Checks units, signs and torque constants of a log of one shot before the file is read.

    Raises:
        SettingsError: With every contradiction.
    """
    _refuse(mapping, _channels(mapping))


def _refuse(mapping: LogMapping, problems: list[str]) -> None:
    if problems:
        raise SettingsError(
            "; ".join(problems), where=f"log mapping of {mapping.file}", remedy="Correct the acquire section."
        )


def _channels(mapping: LogMapping) -> list[str]:
    """What contradicts itself among the channels, whatever was played."""
    problems = []
    if not mapping.outputs:
        problems.append("there is no output channel")
    if not mapping.inputs:
        problems.append("there is no input channel")
    channels: list[LogChannel] = [*mapping.inputs, *mapping.outputs, *mapping.references]
    problems += [f"{channel.name}: {problem}" for channel in channels for problem in channel.problems()]
    problems += input_problems(mapping.inputs)
    problems += [f"{key}: {problem}" for key, problem in mapping.pose_problems()]
    for group in (mapping.inputs, mapping.outputs, mapping.references):
        names = [channel.name for channel in group]
        problems += [f"{name}: the name occurs twice" for name in dict.fromkeys(names) if names.count(name) > 1]
    return problems


def still_note(mapping: LogMapping, columns: Mapping[str, NDArray[Any]]) -> tuple[str, ...]:
    """Names the channels of one shot that never change: their joints stood still, or they were not connected.

    Raises:
        DataError: If no output changes, so that nothing moved.
    """
    outputs: list[LogChannel] = [*mapping.outputs]
    still = [one for one in (*mapping.inputs, *outputs, *mapping.references) if np.ptp(columns[one.column]) == 0]
    if all(channel in still for channel in outputs):
        raise DataError(
            "No output changes: nothing moved.",
            where=str(mapping.file),
            remedy="Check that the channels were connected and that their variables are the right ones.",
        )
    told = ", ".join(f"`{channel.variable}` ({columns[channel.column][0]:g})" for channel in still)
    return (f"{_STILL} {mapping.file.name}: {told}; right only where these joints stood still.",) if still else ()


def is_still_note(note: str) -> bool:
    """Whether a note of a record names channels that never change."""
    return note.startswith(_STILL)
