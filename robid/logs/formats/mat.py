"""Reads MAT files: versions 4 to 7 through scipy, variable by variable, and 7.3 through HDF5.

First what the structures that tools save say of times and units, then each version.
"""

from __future__ import annotations

import io
import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat, whosmat
from scipy.io.matlab import MatlabFunction, MatlabObject, MatlabOpaque
from scipy.sparse import issparse

from robid.hdf5 import datasets_in
from robid.logs.formats.unpacking import UnreadableLogError, room_for
from robid.logs.formats.variables import Found, Reason, Wanted, series_place

_AXIS = re.compile(r"(.*?)\.X([({]\d+[)}])?\.Data")
_CHANNEL = re.compile(r"(.*?)\.Y([({]\d+[)}])?\.Data")
_CLOCK = re.compile(r"(.*?)\.Y([({]\d+[)}])?\.Data\.time")
_INDICES = ("", *(f"({i})" for i in range(1, 17)), *(f"{{{i}}}" for i in range(1, 17)))
_SIGNALS = re.compile(r"(.*?)\.signals([({]\d+[)}])?\.values")
_UNIT = re.compile(r"[\[(]\s*([^\[\]()]*?)\s*[\])]\s*$")
_SERIES = re.compile(r"(.*?)\.(Time|Data)")
_INFO = {"Time": "TimeInfo", "Data": "DataInfo"}


def _units(found: Found) -> Iterator[tuple[str, str]]:
    """Units that the structures of a MAT file say by what they are.

    A recording of ControlDesk has channels `Y(2).Data` over times `X(1).Data`, Simulink's structure with time
    `signals(2).values` over `time`, its block To File a matrix whose first row is time, a time series `Data` over
    `Time`.
    """
    for name in found.sizes:
        axis = _AXIS.fullmatch(name)
        if axis and any(one.startswith(f"{axis[1]}.Y") and one.endswith(".Data") for one in found.sizes):
            if name not in found.arrays or np.all(np.diff(found.arrays[name].ravel()) > 0):
                yield name, "s"
        elif signals := _SIGNALS.fullmatch(name):
            yield f"{signals[1]}.time", "s"
            label = _UNIT.search(found.texts.get(f"{name.removesuffix('.values')}.label", ""))
            if label:
                yield name, label[1]
        elif series := _SERIES.fullmatch(name):
            info = f"{series[1]}.{_INFO[series[2]]}.Units"
            if info in found.texts:
                yield name, found.texts[info]
        elif name in found.arrays and _is_timed(found.arrays[name]):
            yield f"{name}(1,:)", "s"


def _with_clocks(wanted: Wanted) -> Wanted:
    """Returns what was asked for, with what tells the times of channels of ControlDesk, as `Y(2).Data.time`."""
    asked = [found for name in wanted.names or () if (found := _CLOCK.fullmatch(name))]
    if not asked or wanted.names is None:
        return wanted
    axes = [f"{one[1]}.X{index}.Data" for one in asked for index in _INDICES]
    return Wanted([*wanted.names, *axes, *(f"{one[1]}.Y{one[2] or ''}.XIndex" for one in asked)])


def _add_clocks(found: Found, wanted: Wanted) -> None:
    """Adds the times of channels that ControlDesk recorded in several rasters, each over one of several `X(1).Data`."""
    axes: dict[str, list[str]] = {}
    for name in found.sizes:
        if axis := _AXIS.fullmatch(name):
            axes.setdefault(axis[1], []).append(name)
    channels = {name: axes.get(one[1], []) for name in found.sizes if (one := _CHANNEL.fullmatch(name))}
    for name, times in channels.items():
        if len(times) < 2:
            continue
        index = found.arrays.get(f"{name.removesuffix('.Data')}.XIndex")
        place = int(index.ravel()[0]) - 1 if index is not None and index.size == 1 else -1
        if f"{name}.time" in wanted and 0 <= place < len(times) and times[place] in found.arrays:
            found.add(f"{name}.time", found.arrays[times[place]].ravel(), "s")
        else:
            found.mention(f"{name}.time", found.sizes[name], "s")


def _is_timed(matrix: NDArray[np.generic]) -> bool:
    """Whether the first row of a wide matrix is time, as Simulink writes it to a file: it alone rises all the way."""
    if matrix.ndim != 2 or not 1 < matrix.shape[0] < matrix.shape[1] or matrix.dtype.kind != "f":
        return False
    rises = np.all(np.diff(matrix, axis=1) > 0, axis=1)
    return bool(rises[0] and not rises[1:].any())


_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
_PEEK = 1 << 18  # bytes of a variable that hold its name and shape, packed or not
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
_DAMAGED = Reason("D062 The log is damaged before its end.", "Check that it was copied completely, or save it again.")


def read_mat(file: Path, wanted: Wanted) -> Found:
    """Reads a MAT file of any version.

    Raises:
        UnreadableLogError: If it is none.
    """
    asked, wanted = wanted, _with_clocks(wanted)
    with file.open("rb") as stream:
        header = stream.read(_HEADER)
        if header.startswith(b"MATLAB 7.3"):
            found = _read_hdf5(file, wanted)
        elif header[126:128] not in (b"IM", b"MI") or 0 in header[:4]:
            found = _read_old(file, wanted)
        else:
            found = Found()
            _read_elements(stream, header, wanted, found)
    for name, unit in list(_units(found)):
        found.units.setdefault(name, unit)
    _add_clocks(found, asked)
    if wanted is not asked:
        added = set(wanted.names or ()) - set(asked.names or ())
        found.arrays = {name: x for name, x in found.arrays.items() if name in asked or name not in added}
    return found


def _object_reason(kind: str) -> Reason:
    """Says that an object of a MATLAB class cannot be read, and what to save instead."""
    remedy = _REMEDIES.get(kind, "Save what it contains as numeric variables of their own.")
    return Reason(f"D063 It is an object of the MATLAB class `{kind}`, which only MATLAB can decode.", remedy)


def _read_old(file: Path, wanted: Wanted) -> Found:
    """Reads version 4, which has no structures."""
    found = Found()
    with file.open("rb") as stream:
        if b"HDF\r\n" in stream.read(600):
            raise UnreadableLogError("D064 it is an HDF5 file", "Set `format: hdf5`, or leave it out.")
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
    try:
        loaded = loadmat(io.BytesIO(element)) if name else None
    except MemoryError:
        raise
    except Exception as e:  # noqa: BLE001 see above
        found.unreadable[name] = Reason(f"D065 It is damaged ({e}).", _DAMAGED.remedy)
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
        found.unreadable[name] = _object_reason(kind)


def _text(value: Any) -> str:  # noqa: ANN401
    return str(np.ravel(value)[0].decode(errors="replace"))


def _take(name: str, value: Any, wanted: Wanted, found: Found) -> None:  # noqa: ANN401
    """Adds what is inside a variable."""
    for path, leaf in _leaves(name, value):
        if isinstance(leaf, MatlabOpaque):
            found.unreadable[path] = _object_reason(_text(leaf["s2"]))
        elif isinstance(leaf, MatlabObject):
            found.unreadable[path] = _object_reason(str(leaf.classname))
        elif isinstance(leaf, MatlabFunction):
            found.unreadable[path] = Reason("D066 It is a function.")
        elif issparse(leaf):
            found.unreadable[path] = Reason("D067 It is a sparse matrix.", "Save `full(name)`.")
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


_NUMBERS = ("double", "single", "logical", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64")
_DEEPEST = 30
_CHARACTER = 64  # bytes that one takes while it is read


def _read_hdf5(file: Path, wanted: Wanted) -> Found:
    """Reads the variables of a MAT file of version 7.3; those that cannot be decoded are noted."""
    found = Found(room=room_for(file))
    with h5py.File(file, "r") as root:
        for _ in datasets_in(root):
            pass
        for name in root:
            if not name.startswith("#"):  # where MATLAB keeps what references point to
                _try(name, root, name, wanted, found)
    return found


def _try(name: str, parent: Any, key: Any, wanted: Wanted, found: Found, depth: int = 0) -> None:  # noqa: ANN401
    with found.guarded(name):
        _take_item(name, parent[key], wanted, found, depth)


def _take_item(name: str, item: Any, wanted: Wanted, found: Found, depth: int) -> None:  # noqa: ANN401
    kind = item.attrs.get("MATLAB_class", b"")
    kind = kind.decode() if isinstance(kind, bytes) else str(kind)
    found.look()
    if depth > _DEEPEST:
        found.unreadable[name] = Reason("D068 Its structures do not end.", "Save the log again.")
    elif "MATLAB_object_decode" in item.attrs and kind not in ("cell", "struct"):
        found.unreadable[name] = _object_reason(kind)
    elif isinstance(item, h5py.Group):
        _take_group(name, item, wanted, found, depth)
    elif item.dtype == h5py.ref_dtype:
        found.reserve(name, item.nbytes)
        for index, reference in enumerate(item[()].ravel(), start=1):
            _try(f"{name}{{{index}}}", item.file, reference, wanted, found, depth + 1)
    elif item.attrs.get("MATLAB_empty", 0):
        found.mention(name, 0)
    elif kind == "char" and item.dtype.kind == "u":
        found.reserve(name, _CHARACTER * item.size)
        found.note_text(name, "".join(map(chr, item[()].ravel())))
    elif kind == "char" or item.dtype.kind not in "fiubcV":
        found.unreadable[name] = Reason("D069 It contains text, not numbers.")
    elif kind and kind not in _NUMBERS:
        found.unreadable[name] = _object_reason(kind)
    elif name in wanted:
        _take_numbers(name, item, wanted, found)
    else:
        found.mention(name, int(np.prod(item.shape)))


def _take_group(name: str, group: Any, wanted: Wanted, found: Found, depth: int) -> None:  # noqa: ANN401
    """Adds the fields of a structure, or of each structure of an array, whose fields are lists of references."""
    if "MATLAB_sparse" in group.attrs:
        found.unreadable[name] = Reason("D070 It is a sparse matrix.", "Save `full(name)`.")
        return
    for field in group:
        child = group[field]
        listed = isinstance(child, h5py.Dataset) and child.dtype == h5py.ref_dtype
        if listed and "MATLAB_class" not in child.attrs:
            found.reserve(f"{name}.{field}", child.nbytes)
            for index, reference in enumerate(child[()].ravel(), start=1):
                _try(f"{name}({index}).{field}", group.file, reference, wanted, found, depth + 1)
        else:
            _try(f"{name}.{field}", group, field, wanted, found, depth + 1)


def _take_numbers(name: str, dataset: Any, wanted: Wanted, found: Found) -> None:  # noqa: ANN401
    """Adds an array, whose axes MATLAB writes in reverse; of a matrix only the columns and rows that were asked for."""
    if dataset.dtype.names == ("real", "imag"):
        found.reserve(name, dataset.nbytes)
        values = dataset[()]
        found.add(name, (values["real"] + 1j * values["imag"]).T)
        return
    series, shape = wanted.series(name), dataset.shape[::-1]
    if series is None or dataset.ndim < 2:
        found.reserve(name, dataset.nbytes)
        found.add(name, dataset[()].T)
        return
    found.mention(name, int(np.prod(shape)))
    for index in series:
        if (place := series_place(index, shape)) is not None:
            found.reserve(f"{name}{index}", dataset.dtype.itemsize * max(shape))
            found.arrays[f"{name}{index}"] = dataset[place[::-1]]
