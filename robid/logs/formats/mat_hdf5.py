"""Reads MAT files of version 7.3: HDF5 files in which MATLAB lays out its structures and cells."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from robid.logs.formats.mat import object_reason
from robid.logs.formats.variables import Found, Reason, Wanted, series_place

_NUMBERS = ("double", "single", "logical", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64")
_DEPTH = 30


def read(file: Path, wanted: Wanted) -> Found:
    """Reads the variables of a MAT file of version 7.3; those that cannot be decoded are noted."""
    found = Found()
    with h5py.File(file, "r") as root:
        for name in root:
            if not name.startswith("#"):  # where MATLAB keeps what references point to
                _try(name, root, name, wanted, found)
    return found


def _try(name: str, parent: Any, key: Any, wanted: Wanted, found: Found, depth: int = 0) -> None:  # noqa: ANN401
    try:
        _take(name, parent[key], wanted, found, depth)
    except MemoryError:
        raise
    except Exception as e:  # noqa: BLE001 a damaged variable leaves the others readable
        found.unreadable[name] = Reason(f"It is damaged ({e}).", "Save the log again.")


def _take(name: str, item: Any, wanted: Wanted, found: Found, depth: int) -> None:  # noqa: ANN401
    """Adds what is inside a variable."""
    kind = item.attrs.get("MATLAB_class", b"")
    kind = kind.decode() if isinstance(kind, bytes) else str(kind)
    if depth > _DEPTH:
        found.unreadable[name] = Reason("Its structures do not end.", "Save the log again.")
    elif "MATLAB_object_decode" in item.attrs and kind not in ("cell", "struct"):
        found.unreadable[name] = object_reason(kind)
    elif isinstance(item, h5py.Group):
        _take_group(name, item, wanted, found, depth)
    elif item.dtype == h5py.ref_dtype:
        for index, reference in enumerate(item[()].ravel(), start=1):
            _try(f"{name}{{{index}}}", item.file, reference, wanted, found, depth + 1)
    elif item.attrs.get("MATLAB_empty", 0):
        found.mention(name, 0)
    elif kind == "char" and item.dtype.kind == "u":
        found.note_text(name, "".join(map(chr, item[()].ravel())))
    elif kind == "char" or item.dtype.kind not in "fiubcV":
        found.unreadable[name] = Reason("It holds text, not numbers.")
    elif kind and kind not in _NUMBERS:
        found.unreadable[name] = object_reason(kind)
    elif name in wanted:
        _take_numbers(name, item, wanted, found)
    else:
        found.mention(name, int(np.prod(item.shape)))


def _take_group(name: str, group: Any, wanted: Wanted, found: Found, depth: int) -> None:  # noqa: ANN401
    """Adds the fields of a structure, or of each structure of an array, whose fields are lists of references."""
    if "MATLAB_sparse" in group.attrs:
        found.unreadable[name] = Reason("It is a sparse matrix.", "Save `full(name)`.")
        return
    for field in group:
        child = group[field]
        listed = isinstance(child, h5py.Dataset) and child.dtype == h5py.ref_dtype
        if listed and "MATLAB_class" not in child.attrs:
            for index, reference in enumerate(child[()].ravel(), start=1):
                _try(f"{name}({index}).{field}", group.file, reference, wanted, found, depth + 1)
        else:
            _try(f"{name}.{field}", group, field, wanted, found, depth + 1)


def _take_numbers(name: str, dataset: Any, wanted: Wanted, found: Found) -> None:  # noqa: ANN401
    """Adds an array, whose axes MATLAB writes in reverse; of a matrix only the columns and rows that were asked for."""
    if dataset.dtype.names == ("real", "imag"):
        values = dataset[()]
        found.add(name, (values["real"] + 1j * values["imag"]).T)
        return
    series, shape = wanted.series(name), dataset.shape[::-1]
    if series is None or dataset.ndim < 2:
        found.add(name, dataset[()].T)
        return
    found.mention(name, int(np.prod(shape)))
    for index in series:
        if (place := series_place(index, shape)) is not None:
            found.arrays[f"{name}{index}"] = dataset[place[::-1]]
