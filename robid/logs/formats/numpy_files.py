"""Reads files of NumPy: the arrays of an archive by their names, a lone one by its fields; never pickled objects."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy

from robid.logs.formats.unpacking import room_for
from robid.logs.formats.variables import Found, Reason, Wanted

_ALONE = "1"  # the name of a lone array without fields, as of columns without names
_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


def read_numpy(file: Path, wanted: Wanted) -> Found:
    """Reads arrays of an NPZ archive by their names, `name` or `name.field`; of an NPY file by its fields."""
    found = Found(room=room_for(file))
    if not zipfile.is_zipfile(file):
        with file.open("rb") as stream:
            _take("", stream, wanted, found)
        return found
    with zipfile.ZipFile(file) as archive:
        for member in archive.namelist():
            name = member.removesuffix(".npy")
            with found.guarded(name), archive.open(member) as stream:
                _take(name, stream, wanted, found)
    return found


def _take(name: str, stream: IO[bytes], wanted: Wanted, found: Found) -> None:
    """Adds an array where it, or something of it, was asked for; else its size."""
    read_header = _HEADERS.get(npy.read_magic(stream), npy.read_array_header_2_0)
    shape, by_columns, dtype = read_header(stream)
    names = [f"{name}.{one}".strip(".") for one in dtype.names or ("",)]
    names = [_ALONE] if names == [""] else names
    if dtype.hasobject:
        what = "D659 It contains Python objects, which are not read: they may run code."
        found.unreadable.update(dict.fromkeys(names, Reason(what, "Save it as an array of numbers.")))
    elif any(wanted.below(one) for one in names):
        array = _read(stream, shape, dtype, found, names[0], by_columns=by_columns)
        for one, key in zip(names, dtype.names or (None,), strict=True):
            found.take(one, array if key is None else array[key], wanted)
    else:
        for one in names:
            found.mention(one, int(np.prod(shape)))


def _read(stream: IO[bytes], shape: Any, dtype: Any, found: Found, name: str, *, by_columns: bool) -> Any:  # noqa: ANN401
    """The numbers behind a header, for which there has to be room."""
    size = int(np.prod(shape)) * dtype.itemsize
    found.reserve(name, size)
    raw = stream.read(size)
    if len(raw) != size:
        raise ValueError(f"{len(raw)} of its {size} bytes are there")
    return np.frombuffer(raw, dtype).reshape(shape, order="F" if by_columns else "C")
