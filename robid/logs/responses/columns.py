"""Responses in columns of tables, or in plain variables: those that are named, ours, or one that is recognised."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.errors import DataError
from robid.logs.formats.unpacking import open_bytes
from robid.logs.formats.variables import Variables, find_variable
from robid.logs.responses.table import MEASURED, ResponseTable, check_pairs, complex_of, with_notes
from robid.signals.response_options import FREQUENCY_UNITS, ElementColumns, ResponseOptions

_WORDS = {
    "frequency": r"f|freq|frequency|frequencies|w|omega|frequenz",
    "real": r"re|real|realteil",
    "imaginary": r"im|imag|imaginary|imaginaerteil",
    "magnitude": r"mag|magnitude|gain|amplitude|amp|abs|betrag",
    "phase": r"ph|phase|arg|angle",
    "coherence": r"coh|coherence|kohaerenz|gamma2",
    "deviation": r"std|deviation|sigma",
}
_BRACKETS = re.compile(r"[\[(]\s*([^\[\]()]*?)\s*[\])]\s*$")
_UNITS = {"hz": "Hz", "khz": "kHz", "rad/s": "rad/s", "rad/sec": "rad/s"}


@dataclass(frozen=True)
class Layout:
    """Where a file has what, and in which units, as its names say."""

    frequency: str
    frequency_unit: str
    elements: tuple[ElementColumns, ...]
    db: bool
    deg: bool


def find_layout(names: Variables, options: ResponseOptions) -> Layout:
    """Finds the columns of a response: as stated, else those of our exports, else of one element by usual names.

    Raises:
        DataError: If the file has no such columns.
    """
    where = str(names.file)
    frequency = options.frequency.variable or _by_word(names, "frequency")
    if frequency is None:
        raise DataError(
            f"D617 no column is a frequency (there are {', '.join(list(names.sizes)[:8])})",
            where=where,
            remedy="name it: `frequency: {variable: ..., unit: Hz}`",
        )
    told = _BRACKETS.search(frequency)
    unit = options.frequency.unit or _UNITS.get(told[1].lower() if told else "", "Hz")
    elements = options.elements or _own_elements(names, options) or _usual_elements(names, options)
    magnitudes = [each.magnitude for each in elements if each.magnitude is not None]
    phases = [each.phase for each in elements if each.phase is not None]
    says_db = any(re.search(r"\bdb\b", name, re.IGNORECASE) for name in magnitudes)
    says_rad = any(re.search(r"\brad\b", name, re.IGNORECASE) for name in phases)
    return Layout(
        frequency, unit, tuple(elements), options.magnitude == "db" or says_db, options.phase == "deg" and not says_rad
    )


def _by_word(names: Variables, word: str) -> str | None:
    """The first variable whose name, without its unit, is a usual one."""
    pattern = re.compile(rf"(?:{_WORDS[word]})(?:[\s_/|].*)?", re.IGNORECASE)
    plain = {name: _BRACKETS.sub("", name).strip().strip('"|') for name in names.sizes}
    return next((name for name, bare in plain.items() if pattern.fullmatch(bare)), None)


def _own_elements(names: Variables, options: ResponseOptions) -> list[ElementColumns]:
    """Columns of our tables: `OUTPUT per INPUT real [unit]`, with `imaginary` and `deviation` beside it."""
    found = []
    for output in options.outputs:
        for one in options.inputs:
            start = f"{output.variable} per {one.variable} "
            real, imaginary, deviation = (
                next((name for name in names.sizes if name.startswith(f"{start}{part}")), None)
                for part in ("real", "imaginary", "deviation")
            )
            if real and imaginary:
                pair = ElementColumns(output=output.name, input=one.name, real=real, imaginary=imaginary)
                found.append(replace(pair, deviation=deviation))
    return found


def _usual_elements(names: Variables, options: ResponseOptions) -> list[ElementColumns]:
    if len(options.outputs) * len(options.inputs) != 1:
        return []
    parts = {word: _by_word(names, word) for word in _WORDS if word != "frequency"}
    if parts["real"] and parts["imaginary"]:
        parts |= {"magnitude": None, "phase": None}
    elif not (parts["magnitude"] and parts["phase"]):
        return []
    else:
        parts |= {"real": None, "imaginary": None}
    told: dict[str, Any] = {**parts, "output": options.outputs[0].name, "input": options.inputs[0].name}
    return [ElementColumns(**told)]


def column_table(variables: Mapping[str | None, Variables], options: ResponseOptions) -> ResponseTable:
    """The response in columns; files of elements by their names as written, the others under None.

    Raises:
        DataError: If pairs, columns or lines are missing or do not belong together.
    """
    main = next(iter(variables.values()))
    layout = find_layout(variables.get(None, main), options)
    rows = {channel.name: index for index, channel in enumerate(options.outputs)}
    columns = {channel.name: index for index, channel in enumerate(options.inputs)}
    places = {(rows[e.output], columns[e.input]): e for e in layout.elements if e.output in rows and e.input in columns}
    check_pairs(options, places, str(main.file), list(main.sizes))
    tables = {place: _one(variables[each.file], layout, each) for place, each in places.items()}
    frequency = next(iter(tables.values())).frequency_hz
    for place, table in tables.items():
        if table.frequency_hz.shape != frequency.shape or not np.allclose(table.frequency_hz, frequency, rtol=1e-9):
            what = f"D618 the lines of `{places[place].file}` are not those of the other elements"
            raise DataError(what, where=str(main.file), remedy="measure or export all elements at the same frequencies")
    shape = frequency.size, len(rows), len(columns)
    found = ResponseTable(
        frequency,
        _assembled(tables, "response", shape),
        _all(tables, "variance", shape),
        _all(tables, "coherence", shape),
    )
    return with_notes(found, _notes(main), options)


_NOTE = re.compile(rf"# (\S+) ({MEASURED})\r?$", re.MULTILINE)
_HEAD = 10_000  # Characters of a table in which its notes are


def _notes(variables: Variables) -> dict[str, str]:
    """What our tables note of each output, by its name."""
    with open_bytes(variables.file) as stream:
        head = stream.read(_HEAD).decode(errors="replace")
    return {found[0]: found[1] for found in _NOTE.findall(head)}


def _one(variables: Variables, layout: Layout, element: ElementColumns) -> ResponseTable:
    def column(name: str | None) -> FloatArray | None:
        return None if name is None else np.ravel(_found(variables, name)).astype(float)

    where = str(variables.file)
    frequency = FREQUENCY_UNITS[layout.frequency_unit] * np.ravel(_found(variables, layout.frequency)).astype(float)
    real, imaginary, magnitude, phase = (
        column(getattr(element, part)) for part in ("real", "imaginary", "magnitude", "phase")
    )
    if element.complex is not None:
        response = np.ravel(_found(variables, element.complex)).astype(complex)
    elif real is not None and imaginary is not None:
        response = real + 1j * imaginary
    elif magnitude is not None and phase is not None:
        response = complex_of(magnitude, phase, db=layout.db, deg=layout.deg, where=where)
    else:
        raise DataError(f"D619 an element has no columns: {element}", where=where, remedy="name them under `elements`")
    deviation, coherence = column(element.deviation), column(element.coherence)
    parts = (response, *(each for each in (deviation, coherence) if each is not None))
    if any(each.size != frequency.size for each in parts):
        what = f"D620 there are {frequency.size} frequencies, and {', '.join(str(each.size) for each in parts)} values"
        raise DataError(what, where=where, remedy="correct the names under `elements` and `frequency`")
    own = ResponseTable(frequency, response)
    return replace(own, variance=None if deviation is None else deviation**2, coherence=coherence)


def _found(variables: Variables, name: str) -> FloatArray | ComplexArray:
    try:
        return np.asarray(find_variable(variables, name))
    except KeyError:
        there = ", ".join(list(variables.sizes)[:8])
        what = f"D621 there is no column or variable `{name}` (there are {there})"
        raise DataError(what, where=str(variables.file), remedy="correct its name under `elements`") from None


def _assembled(tables: Mapping[tuple[int, int], ResponseTable], part: str, shape: tuple[int, ...]) -> ComplexArray:
    found: ComplexArray = np.zeros(shape, complex)
    for (row, column), table in tables.items():
        found[:, row, column] = getattr(table, part)
    return found


def _all(tables: Mapping[tuple[int, int], ResponseTable], part: str, shape: tuple[int, ...]) -> FloatArray | None:
    """A part of all elements; None where one lacks it."""
    if any(getattr(table, part) is None for table in tables.values()):
        return None
    return np.real(_assembled(tables, part, shape))
