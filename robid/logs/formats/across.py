"""Reads tables of text that lie across: a line for each channel, with its samples one after the other."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import islice

import numpy as np

from robid.arrays import FloatArray
from robid.logs.formats.cells import is_missing, is_number, is_row, number, split
from robid.logs.formats.telling import tell_marks, units_of
from robid.logs.formats.variables import Found, Reason, Wanted, number_repeated
from robid.signals.log_dialect import Dialect

_MOST = 64
"""Channels of such a table at most."""

_LONGER = 4
"""Samples per channel from which it lies across, in as many as there are channels."""

_LEAD = 2
"""Cells before the samples at most: a name and a unit."""


def read_across(text: Iterable[str], sample: Sequence[str], wanted: Wanted, dialect: Dialect) -> Found | None:
    """Reads channels of a table that lies across; None where it does not, or where its names are said to be in a line.

    Args:
        text: Its lines.
        sample: The first ones.
        wanted: Which channels were asked for.
        dialect: How it is written.
    """
    first = next((line for line in sample if is_row(line, dialect.comments)), "")
    if dialect.header_line is not None or len(first) < _MOST * _LONGER:
        return None
    separator, comma = tell_marks([first], dialect)
    lead = _lead(split(first, separator), comma)
    if lead is None:
        return None
    rows = [line for line in islice(text, 2 * _MOST) if is_row(line, dialect.comments)]
    cells = [split(line.rstrip("\r\n" + separator.strip()), separator) for line in rows]
    length = len(cells[0])
    if any(len(row) != length or _lead(row, comma) != lead for row in cells):
        return None
    if len(rows) > _MOST or length - lead < _LONGER * max(len(rows), _MOST):
        return None
    names, twice = number_repeated([row[0] if lead else str(index) for index, row in enumerate(cells, start=1)])
    found = Found()
    found.unreadable.update(twice)
    for name, row, unit in zip(names, cells, units_of(names), strict=True):
        stated = row[1] if lead == _LEAD else unit
        values = _numbers(row[lead:], comma) if name in wanted else None
        if isinstance(values, Reason):
            found.unreadable[name] = values
        elif values is not None:
            found.add(name, values, stated)
        else:
            found.mention(name, length - lead, stated)
    return found


def _lead(row: Sequence[str], comma: bool) -> int | None:
    """How many cells of words stand before numbers only; None where there are others."""
    samples = [is_number(cell, decimal_comma=comma) or is_missing(cell) for cell in row]
    lead = next((index for index, cell in enumerate(row) if is_number(cell, decimal_comma=comma)), len(row))
    return lead if lead <= _LEAD and all(samples[lead:]) and len(row) > lead else None


def _numbers(cells: Sequence[str], comma: bool) -> FloatArray | Reason:
    try:
        return np.array([number(cell, decimal_comma=comma) for cell in cells])
    except ValueError as e:
        return Reason(f"It holds what is no number ({e}).")
