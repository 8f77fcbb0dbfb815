"""Reads MAT files: versions 4 to 7 through scipy, variable by variable, and 7.3 through HDF5."""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np
from scipy.io import loadmat, whosmat
from scipy.io.matlab import MatlabFunction, MatlabObject, MatlabOpaque
from scipy.sparse import issparse

from robid.logs.formats.mat_layouts import add_clocks, note_units, with_clocks
from robid.logs.formats.variables import Found, Reason, UnreadableLogError, Wanted

_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
_PEEK = 1 << 18
"""Bytes of a variable that hold its name and shape, packed or not."""
_REMEDIES = {
    "table": "Save its columns: `s = table2struct(name, 'ToScalar', true)`.",
    "timetable": "Save its columns: `s = table2struct(timetable2table(name), 'ToScalar', true)`.",
    "timeseries": "Save `name.Time` and `name.Data` as variables of their own.",
    "string": "Save it as a real numeric column.",
    **dict.fromkeys(
        ("Simulink.SimulationOutput", "Simulink.SimulationData.Dataset", "Simulink.SimulationData.Signal"),
        "Save the time and the values of its signals, as `t = out.logsout{1}.Values.Time` and"
        " `q = out.logsout{1}.Values.Data`; or have To Workspace save a structure with time.",
    ),
}
_DAMAGED = Reason("The log is damaged before its end.", "Check that it was copied completely, or save it again.")


def read(file: Path, wanted: Wanted) -> Found:
    """Reads a MAT file of any version.

    Raises:
        UnreadableLogError: If it is none.
    """
    asked, wanted = wanted, with_clocks(wanted)
    with file.open("rb") as stream:
        header = stream.read(_HEADER)
        if header.startswith(b"MATLAB 7.3"):
            from robid.logs.formats.mat_hdf5 import read as read_hdf5

            found = read_hdf5(file, wanted)
        elif header[126:128] not in (b"IM", b"MI") or 0 in header[:4]:
            found = _read_old(file, wanted)
        else:
            found = Found()
            _read_elements(stream, header, wanted, found)
    note_units(found)
    add_clocks(found, asked)
    if wanted is not asked:
        added = set(wanted.names or ()) - set(asked.names or ())
        found.arrays = {name: x for name, x in found.arrays.items() if name in asked or name not in added}
    return found


def object_reason(kind: str) -> Reason:
    """Says that an object of a MATLAB class cannot be read, and what to save instead."""
    remedy = _REMEDIES.get(kind, "Save what it holds as numeric variables of their own.")
    return Reason(f"It is an object of the MATLAB class `{kind}`, which only MATLAB can decode.", remedy)


def _read_old(file: Path, wanted: Wanted) -> Found:
    """Reads version 4, which has no structures."""
    found = Found()
    with file.open("rb") as stream:
        if b"HDF\r\n" in stream.read(600):
            raise UnreadableLogError("it is an HDF5 file", "Set `format: hdf5`, or leave it out.")
    for name, value in loadmat(file, appendmat=False).items():
        if not name.startswith("__"):
            _take(name, value, wanted, found)
    return found


def _read_elements(stream: IO[bytes], header: bytes, wanted: Wanted, found: Found) -> None:
    """Reads the file variable by variable, each as a file of its own; what lies beyond damage is not found."""
    order = "<" if header[126:128] == b"IM" else ">"
    header = header[:116] + bytes(8) + header[124:]
    while tag := stream.read(8):
        kind, size = struct.unpack(f"{order}II", tag) if len(tag) == 8 else (0, 0)
        if kind not in (_MATRIX, _COMPRESSED):
            found.damage = _DAMAGED
            return
        start = stream.tell()
        name = _peek(header + tag + stream.read(min(size, _PEEK)), wanted, found)
        if name is not None:
            stream.seek(start)
            _read_element(name, header + tag + stream.read(size), wanted, found)
        if stream.seek(0, io.SEEK_END) < start + size:
            found.damage = _DAMAGED
        stream.seek(start + size)


def _peek(element: bytes, wanted: Wanted, found: Found) -> str | None:
    """Name of a variable that is to be read, by the first bytes of its file; empty where it may be an object."""
    try:
        ((name, shape, kind),) = whosmat(io.BytesIO(element))
    except Exception:  # noqa: BLE001 scipy raises whatever a damaged header, or an object, leads to
        return ""
    if not name or name == "__function_workspace__":  # where MATLAB keeps what objects hold
        return None
    if not wanted.below(name) and kind not in ("object", "opaque"):
        found.mention(name, int(np.prod(shape)))
        return None
    return str(name)


def _read_element(name: str, element: bytes, wanted: Wanted, found: Found) -> None:
    """Reads the variable of a file that holds one."""
    try:
        loaded = loadmat(io.BytesIO(element)) if name else None
    except MemoryError:
        raise
    except Exception as e:  # noqa: BLE001 see above
        found.unreadable[name] = Reason(f"It is damaged ({e}).", _DAMAGED.remedy)
        return
    if loaded is None or name not in loaded:
        _note_object(element, found)
    elif _is_mislabelled(name, element, loaded[name]):
        found.unreadable[name] = _DAMAGED
    else:
        _take(name, loaded[name], wanted, found)


def _is_mislabelled(name: str, element: bytes, loaded: Any) -> bool:  # noqa: ANN401
    """Whether floats are said to be stored as 64-bit integers, as nobody writes them: a flipped bit makes them so."""
    stored = [(leaf.dtype.kind, leaf.dtype.itemsize) for _, leaf in _leaves(name, loaded) if hasattr(leaf, "dtype")]
    if ("i", 8) not in stored and ("u", 8) not in stored:
        return False
    meant = loadmat(io.BytesIO(element), mat_dtype=True)[name]
    kinds = [leaf.dtype.kind for _, leaf in _leaves(name, meant) if hasattr(leaf, "dtype")]
    return any(one in (("i", 8), ("u", 8)) and kind == "f" for one, kind in zip(stored, kinds, strict=True))


def _note_object(element: bytes, found: Found) -> None:
    """Notes an object of the newer kind, whose name scipy keeps beside its undecoded content; else, damage."""
    try:
        (value,) = (one for name, one in loadmat(io.BytesIO(element)).items() if not name.startswith("__"))
        name, kind = _text(value["s0"]), _text(value["s2"])
    except MemoryError:
        raise
    except Exception:  # noqa: BLE001 see above
        found.damage = _DAMAGED
    else:
        found.unreadable[name] = object_reason(kind)


def _text(value: Any) -> str:  # noqa: ANN401
    """The text in the first element of an array of bytes."""
    return str(np.ravel(value)[0].decode(errors="replace"))


def _take(name: str, value: Any, wanted: Wanted, found: Found) -> None:  # noqa: ANN401
    """Adds what is inside a variable."""
    for path, leaf in _leaves(name, value):
        if isinstance(leaf, MatlabOpaque):
            found.unreadable[path] = object_reason(_text(leaf["s2"]))
        elif isinstance(leaf, MatlabObject):
            found.unreadable[path] = object_reason(str(leaf.classname))
        elif isinstance(leaf, MatlabFunction):
            found.unreadable[path] = Reason("It is a function.")
        elif issparse(leaf):
            found.unreadable[path] = Reason("It is a sparse matrix.", "Save `full(name)`.")
        elif leaf.dtype.kind == "U" and leaf.size == 1:
            found.note_text(path, str(leaf.ravel()[0]))
        elif leaf.dtype.kind not in "fiubc":
            found.add(path, leaf)
        else:
            found.take(path, leaf, wanted)


def _leaves(name: str, value: Any) -> Iterator[tuple[str, Any]]:  # noqa: ANN401
    """Names every array inside structures and cells."""
    special = isinstance(value, MatlabOpaque | MatlabObject | MatlabFunction) or issparse(value)
    array = value if special else np.asarray(value)
    if special or (array.dtype.names is None and array.dtype != object):
        yield name, array
        return
    opening, closing = "()" if array.dtype.names else "{}"
    for index, element in enumerate(array.ravel(order="F"), start=1):
        place = name if array.dtype.names and array.size == 1 else f"{name}{opening}{index}{closing}"
        if array.dtype.names is None:
            yield from _leaves(place, element)
            continue
        for field in array.dtype.names:
            yield from _leaves(f"{place}.{field}", element[field])
