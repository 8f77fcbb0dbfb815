"""Reads log files: every number array of a MAT file (version 5) or of a CSV table, by name."""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.io.matlab import MatReadError

from robid.errors import DataError

_COLUMN = re.compile(r"^(.*)\(:,\s*(\d+)\)$")
_FIRST = re.compile(r"\(1\)")
_DELIMITERS = ",;\t"


def load_variables(file: Path, format_: Literal["mat", "csv"] = "mat") -> Mapping[str, Any]:
    """Reads all variables of a log.

    Fields of structures are named as MATLAB does, `meas.Y(2).Data`, elements of cells `name{2}`; objects of MATLAB
    classes are passed over. A CSV table has its column names in the first line that does not begin with `#`.

    Raises:
        DataError: If the file is missing, of another format, or damaged.
    """
    if not file.is_file():
        remedy = "Correct `file`, or set ROBID_DATA to the folder that holds the data."
        raise DataError("The log does not exist.", where=str(file), remedy=remedy)
    return _load_csv(file) if format_ == "csv" else _load_mat(file)


def find_variable(variables: Mapping[str, Any], name: str) -> Any:  # noqa: ANN401
    """Returns a variable by its name; `name(:,2)` is the second column of a matrix, an index `(1)` may be left out.

    Raises:
        KeyError: If there is none.
    """
    if name in variables:
        return variables[name]
    plain = _FIRST.sub("", name)
    if plain in variables:
        return variables[plain]
    column = _COLUMN.match(plain)
    if column is None:
        raise KeyError(name)
    matrix, index = np.asarray(variables[column[1]]), int(column[2]) - 1
    if matrix.ndim != 2 or not 0 <= index < matrix.shape[1]:
        raise KeyError(name)
    return matrix[:, index]


def _load_mat(file: Path) -> dict[str, Any]:
    try:
        loaded = loadmat(file, appendmat=False)
    except NotImplementedError:
        remedy = "Save it from MATLAB with `save -v7`."
        raise DataError("The log is a MAT file of version 7.3.", where=str(file), remedy=remedy) from None
    except (
        MatReadError,
        OSError,
        ValueError,
        TypeError,
        KeyError,
        IndexError,
        EOFError,
        struct.error,
        zlib.error,
    ) as e:
        remedy = "Check that it is a MAT file and that it was copied completely."
        raise DataError(f"The log cannot be read as a MAT file ({e}).", where=str(file), remedy=remedy) from e
    named = {name: value for name, value in loaded.items() if isinstance(name, str) and not name.startswith("__")}
    return {path: leaf for name, value in named.items() for path, leaf in _leaves(name, value)}


def _leaves(name: str, value: Any) -> Iterator[tuple[str, Any]]:  # noqa: ANN401
    """Names every array inside structures and cells."""
    array = np.asarray(value)
    if array.dtype.names is None and array.dtype != object:
        yield name, value
        return
    opening, closing = "()" if array.dtype.names else "{}"
    for index, element in enumerate(array.ravel(order="F"), start=1):
        place = name if array.dtype.names and array.size == 1 else f"{name}{opening}{index}{closing}"
        if array.dtype.names is None:
            yield from _leaves(place, element)
            continue
        for field in array.dtype.names:
            yield from _leaves(f"{place}.{field}", element[field])


def _load_csv(file: Path) -> dict[str, NDArray[np.float64]]:
    remedy = "Write one line of column names, then one line of numbers per sample, separated by `,`, `;` or tabs."
    try:
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except (UnicodeDecodeError, OSError) as e:
        raise DataError(f"The log cannot be read as text ({e}).", where=str(file), remedy=remedy) from e
    numbered = [(i, line) for i, line in enumerate(lines, start=1) if line.strip() and not line.startswith("#")]
    if len(numbered) < 2:
        raise DataError("The log holds no table.", where=str(file), remedy=remedy)
    delimiter = max(_DELIMITERS, key=numbered[0][1].count)
    names = [name.strip().strip('"') for name in numbered[0][1].split(delimiter)]
    twice = [name for name in dict.fromkeys(names) if names.count(name) > 1]
    if twice:
        raise DataError(f"Column names occur twice: {', '.join(twice)}.", where=str(file), remedy="Name each once.")
    rows = [line for _, line in numbered[1:]]
    if delimiter == ";" and "," in rows[0]:
        rows = [line.replace(",", ".") for line in rows]
    try:
        table = np.loadtxt(rows, delimiter=delimiter, ndmin=2, comments=None)
    except ValueError:
        table = np.zeros((0, 0))
    if table.shape[1] != len(names):
        number, why = _first_bad(numbered[1:], rows, delimiter, len(names))
        raise DataError(f"The table is broken: {why}.", where=f"{file}, line {number}", remedy=remedy)
    return dict(zip(names, table.T, strict=True))


def _first_bad(numbered: list[tuple[int, str]], rows: list[str], delimiter: str, count: int) -> tuple[int, str]:
    for (number, _), row in zip(numbered, rows, strict=True):
        cells = row.split(delimiter)
        if len(cells) != count:
            return number, f"{len(cells)} values for {count} columns"
        for cell in cells:
            try:
                float(cell)
            except ValueError:
                return number, f"`{cell.strip()}` is no number"
    return numbered[0][0], "it is no table of numbers"
