"""Reads a log's channels and checks each for itself."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robid.errors import DataError
from robid.logs.formats.known import tell_format
from robid.logs.formats.load import load_variables
from robid.logs.formats.variables import Variables, find_variable, series_of
from robid.logs.mapping import LogMapping
from robid.signals.log_channels import LogChannel
from robid.signals.record import Record

_SHOWN = 8
"""Fewest samples of a variable that is offered as a channel, and a quarter of the names that a message lists."""
_SMALL = 1 << 27
"""MAT files up to this size are read whole to suggest a name [bytes]."""
_ABSURD = 1e6
"""Ranges of all others by which a lone sample must lie beyond them to be refused; no sensor resolves as much."""


def read_columns(mapping: LogMapping) -> tuple[dict[str, NDArray[Any]], list[DataError]]:
    """Reads every column that the mapping names from its log, with every problem on the way.

    The values themselves are looked at by `check_values`.
    """
    columns: dict[str, NDArray[Any]] = {}
    problems: list[DataError] = []
    named: dict[Path, list[str]] = {}
    for path, variable in mapping.variables.values():
        named.setdefault(path, []).append(variable)
    logs = {path: load_variables(path, mapping.format, names, mapping.dialect) for path, names in named.items()}
    for name, (path, _) in mapping.variables.items():
        column, found = read_column(mapping, logs[path], name)
        problems += found
        if column is not None:
            columns[name] = column
    return columns, problems


def read_column(mapping: LogMapping, variables: Variables, name: str) -> tuple[NDArray[Any] | None, list[DataError]]:
    """Returns the variable of a column as real numbers, or why it is none."""
    where, variable = mapping.place(name), mapping.variables[name][1]
    try:
        raw = np.asarray(find_variable(variables, variable))
    except KeyError:
        sizes = _every_size(mapping, name, variables)
        close = difflib.get_close_matches(variable, sizes, n=3, cutoff=0.5)
        columns = [key for key, size in sizes.items() if size > _SHOWN]
        guess = f"Did you mean {' or '.join(f'`{key}`' for key in close)}?" if close else "Correct the name."
        remedy = f"{guess} The log holds {', '.join(columns[: 4 * _SHOWN])}."
        return None, [DataError("The log has no such variable.", where=where, remedy=remedy)]
    except DataError as error:
        return None, [DataError(error.what, where=where, remedy=error.remedy)]
    if raw.dtype.kind not in "fiu":
        remedy = "Save it as a real numeric column."
        return None, [DataError(f"It holds {raw.dtype} values, not real numbers.", where=where, remedy=remedy)]
    if raw.size != max(raw.shape, default=0) or raw.size < 2:
        what = f"It has shape {raw.shape}, not one column."
        return None, [DataError(what, where=where, remedy=_which_series(variable, raw))]
    return raw.ravel(), []


def _which_series(variable: str, matrix: NDArray[Any]) -> str:
    """Says how to name one column or row of a matrix."""
    series = series_of(matrix.shape) if matrix.size else []
    if matrix.ndim < 2 or len(series) < 2 or max(matrix.shape) <= _SHOWN:
        return "Save one column per channel."
    return f"Name one of them, `{variable}{series[0]}` to `{variable}{series[-1]}`."


def check_values(
    mapping: LogMapping, columns: Mapping[str, NDArray[Any]], first: int = 0, remedy: str = ""
) -> list[DataError]:
    """Finds columns with values that are none, and channels that never change.

    A channel that never changes cannot have been excited; in one shot its joint may have stood still, and of several
    commands one may be given after the other. Of the time its own checks tell.

    Args:
        mapping: The log mapping.
        columns: The samples of each column that are used.
        first: The sample of the log that is their first.
        remedy: What to do about missing values; to cut the log unless told.
    """
    problems = []
    time = None if mapping.time is None else mapping.time.variable
    for name, column in columns.items():
        where = mapping.place(name)
        bad = np.flatnonzero(~np.isfinite(column))
        if len(bad):
            at = first + bad[0]
            what = f"{len(bad)} of {len(column)} values are NaN or infinite, the first at sample {at}."
            cut = remedy or "Record again, or cut the log to whole periods without them."
            problems.append(DataError(what, where=f"{where}, sample {at}", remedy=cut))
        elif name != time and np.ptp(column) == 0 and not (mapping.one_shot or mapping.takes_turns):
            check = "Check that the channel was connected and that the variable is the right one."
            problems.append(DataError(f"It is constant ({column[0]:g}).", where=where, remedy=check))
        elif name != time and (lone := _absurd_sample(column)) is not None:
            what = f"It is {column[lone]:g} for one sample, more than {_ABSURD:g} times the range of all others away."
            read = f"{remedy or 'Record again'}, or copy the log again: it may be damaged."
            problems.append(DataError(what, where=f"{where}, sample {first + lone}", remedy=read))
    return problems


def _absurd_sample(column: NDArray[Any]) -> int | None:
    """The sample, not at an end, that lies beyond all others by so many times their range that nothing measures it.

    Where others do not change at all, the range tells nothing.
    """
    values = column.astype(float)
    for at in (int(np.argmax(values)), int(np.argmin(values))):
        others = np.delete(values, at)
        low, high = float(others.min()), float(others.max())
        beyond = max(float(values[at]) - high, low - float(values[at]))
        if 0 < at < len(values) - 1 and high > low and beyond / _ABSURD > high - low:
            return at
    return None


def _every_size(mapping: LogMapping, name: str, variables: Variables) -> Mapping[str, int]:
    """Sizes of all variables of a log; only small MAT files are read again for those inside other structures."""
    path, _ = mapping.variables[name]
    if (mapping.format or tell_format(path)) != "mat" or path.stat().st_size > _SMALL:
        return variables.sizes
    return load_variables(path, mapping.format).sizes


def check_motion(mapping: LogMapping, columns: Mapping[str, NDArray[Any]]) -> list[DataError]:
    """Refuses a log of commands given one after the other in which nothing moves: no input, or no output."""
    groups: tuple[tuple[str, Sequence[LogChannel]], ...] = (("input", mapping.inputs), ("output", mapping.outputs))
    remedy = "Check that the channels were connected and that their variables are the right ones."
    return [
        DataError(f"No {kind} changes.", where=str(mapping.file), remedy=remedy)
        for kind, channels in groups
        if all(one.column in columns and np.ptp(columns[one.column]) == 0 for one in channels)
    ]


def check_turns(record: Record, where: str) -> None:
    """Refuses the joined record of a block in which a channel moves in no experiment.

    Raises:
        DataError: If there is one.
    """
    sides = ((record.inputs, record.input_names), (record.outputs, record.output_names))
    still = [
        name
        for x, names in sides
        for name, size in zip(names, np.ptp(x, axis=(0, 1, 2, 3, 4)), strict=True)
        if not size
    ]
    if still:
        remedy = "Add an experiment that moves them, or leave these channels out."
        raise DataError(f"No experiment moves {', '.join(still)}.", where=where, remedy=remedy)


def check_lengths(mapping: LogMapping, columns: Mapping[str, NDArray[Any]]) -> list[DataError]:
    """Compares the channels' lengths; the most frequent one counts as right."""
    lengths = [len(column) for column in columns.values()]
    usual = max(lengths, key=lengths.count, default=0)
    return [
        DataError(
            f"It has {len(column)} samples, the other channels have {usual}.",
            where=mapping.place(name),
            remedy="Export all channels over the same time span and at the same rate.",
        )
        for name, column in columns.items()
        if len(column) != usual
    ]
