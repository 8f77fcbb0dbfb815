"""Reads JSON: one value, or a record in every line; numbers by their path, the fields of records as columns."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robid.logs.formats.moments import Moments, origin_of
from robid.logs.formats.unpacking import UnreadableLogError, room_for
from robid.logs.formats.variables import Found, Reason, Wanted

_MOST_TEXTS = 100  # texts of a list that are told one by one, as the names of channels


def read_json(file: Path, wanted: Wanted) -> Found:
    """Reads arrays of numbers by their path, as `a.b`; null is NaN; moments as times; texts beside them.

    A list of records, or a file with one record in every line, has a column for each of their fields, `field.inner`,
    with NaN where a record lacks it. Lists of one length in all records are matrices.

    Raises:
        UnreadableLogError: If it is no JSON.
    """
    found = Found(room=room_for(file))
    try:
        text = file.read_text(encoding="utf-8-sig")
        content = _content(text)
    except (ValueError, RecursionError) as error:
        remedy = "Correct it there, or delete the line if the log was cut off in it, or write the file again."
        raise UnreadableLogError(f"D612 The file is no JSON ({error}).", remedy) from error
    _take("", content, wanted, found)
    return found


def _content(text: str) -> Any:  # noqa: ANN401
    """One value, or the records of all lines."""
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        lines = [(number, line) for number, line in enumerate(text.split("\n"), start=1) if line.strip()]
        if len(lines) < 2 or not lines[0][1].rstrip().endswith(("}", "]")):
            raise
    records = []
    for number, line in lines:
        try:
            records.append(json.loads(line))
        except json.JSONDecodeError as error:
            raise ValueError(f"line {number}: {error}") from error
    return records


def _take(name: str, value: Any, wanted: Wanted, found: Found) -> None:  # noqa: ANN401
    """Adds what a value holds, by the path below its name."""
    found.look()
    if isinstance(value, dict):
        columns = _split(value)
        for key, inside in (value if columns is None else columns).items():
            _take(f"{name}.{key}" if name else str(key), inside, wanted, found)
    elif isinstance(value, str):
        found.note_text(name, value)
    elif isinstance(value, list) and value and all(isinstance(one, dict) for one in value):
        for path, column in _columns(value).items():
            _take(f"{name}.{path}" if name else path, column, wanted, found)
    elif isinstance(value, list) and any(isinstance(one, str) for one in value):
        _take_texts(name, value, wanted, found)
    elif isinstance(value, list | int | float):
        with found.guarded(name or "the list", "It is no array of numbers", "Save it as a list of numbers."):
            found.take(name or "1", _numbers(value), wanted)


def _split(value: dict[str, Any]) -> dict[str, list[Any]] | None:
    """Columns of a table that states its names and rows apart, as pandas writes it; None where it is none."""
    names, rows = value.get("columns"), value.get("data")
    if not (isinstance(names, list) and isinstance(rows, list) and names and rows):
        return None
    if not all(isinstance(row, list) and len(row) == len(names) for row in rows):
        return None
    return dict(zip(map(str, names), map(list, zip(*rows, strict=True)), strict=True))


def _columns(records: Sequence[dict[str, Any]]) -> dict[str, list[Any]]:
    """The columns of records by the path of their fields, None where a record lacks one."""
    columns: dict[str, list[Any]] = {}
    for place, record in enumerate(records):
        for path, value in _leaves(record, ""):
            column = columns.setdefault(path, [])
            column.extend([None] * (place - len(column)))
            column.append(value)
    for column in columns.values():
        column.extend([None] * (len(records) - len(column)))
        if (row := next((one for one in column if isinstance(one, list)), None)) is not None:
            column[:] = [[None] * len(row) if one is None else one for one in column]
    return columns


def _leaves(record: dict[str, Any], path: str) -> Iterator[tuple[str, Any]]:
    for key, value in record.items():
        below = f"{path}.{key}" if path else key
        if isinstance(value, dict):
            yield from _leaves(value, below)
        else:
            yield below, value


def _take_texts(name: str, texts: list[Any], wanted: Wanted, found: Found) -> None:
    """Adds a list of texts: as numbers or moments where all of them are such, else each as a text."""
    cells = ["" if one is None else str(one).strip() for one in texts]
    if all(one == "" or _is_number(one) for one in cells):
        found.take(name, np.array([float(one) if one else np.nan for one in cells]), wanted)
        return
    moments, start = _moments(cells), None
    if moments is not None and (start := moments.start()) is not None:
        found.take(name, moments.seconds(start), wanted, "s")
        found.origins[name] = origin_of(start, dated=moments.kind in ("date", "numbers"))
        return
    example = next(one for one in texts if isinstance(one, str))
    found.unreadable[name] = Reason(f"D658 It contains text (`{example[:40]}`), not numbers.")
    for index, one in enumerate(texts[:_MOST_TEXTS], start=1):
        if isinstance(one, str):
            found.note_text(f"{name}{{{index}}}", one)


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _moments(cells: Sequence[str]) -> Moments | None:
    moments = Moments()
    return moments if moments.add(cells) is None and moments.first_wrong() is None else None


def _numbers(value: Any) -> NDArray[Any]:  # noqa: ANN401
    """A value as an array: whole numbers keep their digits where none is missing."""
    array = np.array(value)
    return array if array.dtype.kind in "iufb" else np.array(value, dtype=float)
