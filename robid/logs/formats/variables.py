"""What every reader shares: the table of formats, and the variables of a log by name.

How a format is told from a file's first bytes or its name; what was read, what was not asked for, and what cannot be
read, with the reason.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any, Literal, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from robid.errors import DataError
from robid.logs.formats.unpacking import TooLargeError, first_bytes, is_packed
from robid.signals.log_options import LogFormat

_Name = TypeVar("_Name", bound=str)

LARGEST = 1e100
"""Of a value that a sensor may give: powers of larger ones are no numbers."""


def measurable(values: NDArray[Any]) -> NDArray[np.bool_]:
    """Returns which values a sensor may give: numbers, none of them too large."""
    return np.asarray(np.abs(values.astype(float)) <= LARGEST)  # in single precision there is no such limit


@dataclass(frozen=True)
class Format:
    """A format of logs."""

    title: str  # What a message calls it
    reader: str  # The function that reads it, by `(file, wanted)`: `module:function`
    suffixes: tuple[str, ...] = ()  # Ends of file names that say so where the first bytes do not
    magic: tuple[bytes, ...] = ()  # First bytes of its files
    # What it holds: `columns` in an order, `messages` of topics, `timed` channels, or `variables`
    holds: Literal["columns", "messages", "timed", "variables"] = "variables"
    needs: tuple[str, ...] = ()  # Modules that must be installed
    extra: str = ""  # What installs them, `pip install 'robid[extra]'`


_TEXT = (".csv", ".txt", ".tsv", ".dat", ".asc", ".log", ".lvm")
_ROS = ("mcap", "rosbags")
_JSON = (b'{"', b"[{", b"{\n", b"[\n", b"{\r", b"[\r")
_IN_HERE: dict[LogFormat, Format] = {
    "csv": Format("a table of text", "tables:read_table", _TEXT, holds="columns"),
    "mat": Format("a MAT file", "mat:read_mat", (".mat",), (b"MATLAB ",)),
    "hdf5": Format("an HDF5 file", "containers:read_hdf5", (".h5", ".hdf5", ".hdf"), (b"\x89HDF\r\n\x1a\n",)),
    "npz": Format("a NumPy file", "numpy_files:read_numpy", (".npz", ".npy"), (b"\x93NUMPY",)),
    "parquet": Format(
        "a Parquet file", "containers:read_parquet", (".parquet", ".pq"), (b"PAR1",), "columns", ("pyarrow",), "parquet"
    ),
    "arrow": Format(
        "an Arrow or Feather file",
        "containers:read_arrow",
        (".arrow", ".feather"),
        (b"ARROW1",),
        "columns",
        ("pyarrow",),
        "parquet",
    ),
    "mcap": Format("an MCAP file", "messages:read_mcap", (".mcap",), (b"\x89MCAP0\r\n",), "messages", _ROS, "ros"),
    "rosbag": Format("a ROS 2 bag", "messages:read_bag", (".db3",), (b"SQLite format 3\x00",), "messages", _ROS, "ros"),
    "json": Format("JSON", "json_text:read_json", (".json", ".jsonl", ".ndjson"), _JSON, holds="columns"),
    "tdms": Format("a TDMS file", "containers:read_tdms", (".tdms",), (b"TDSm",), "timed", ("nptdms",), "tdms"),
    "mdf": Format(
        "an MDF file", "containers:read_mdf", (".mf4", ".mdf"), (b"MDF     ", b"UnFinMF "), "timed", ("asammdf",), "mdf"
    ),
}
FORMATS = {name: replace(one, reader=f"robid.logs.formats.{one.reader}") for name, one in _IN_HERE.items()}
"""What a log may be; settings and the command line take the same names from `LogFormat`."""

OF_RESPONSES: dict[str, Format] = {
    **{name: FORMATS[name] for name in ("csv", "mat", "hdf5", "json")},
    "uff": Format(
        "a Universal File",
        "robid.logs.responses.universal:read_uff",
        (".uff", ".unv", ".uf", ".bunv"),
        (b"    -1\n", b"    -1\r\n"),
        needs=("pyuff",),
        extra="uff",
    ),
}
"""What a file of responses may be; settings take the same names from `ResponseFormat`."""

EVERY: dict[str, Format] = {**{str(name): one for name, one in FORMATS.items()}, **OF_RESPONSES}
"""All that is read."""

_ZIP, _ARRAY = b"PK\x03\x04", b".npy"
"""First bytes of an archive, and the end of a name that follows where its members are arrays of NumPy."""

FOREIGN = (
    (b"#ROSBAG V2.0", "a bag of ROS 1", "Convert it with `rosbags-convert --src LOG --dst FOLDER`."),
    (_ZIP, "a zip archive or a spreadsheet", "Unpack it, or save the sheet as CSV."),
    (b"\xd0\xcf\x11\xe0", "a spreadsheet of an old version", "Save the sheet as CSV."),
    (b"FEA1", "a Feather file of version 1", "Save the table as Parquet."),
    (b"\x28\xb5\x2f\xfd", "packed with zstd", "Unpack it with `zstd -d`."),
)


def tell_format(file: Path) -> LogFormat:
    """Returns the name of a log's format by its first bytes, else by its name; a table of text where neither says."""
    return "rosbag" if file.is_dir() else _told(file, FORMATS, "csv")


def tell_response_format(file: Path) -> str:
    """Returns the name of the format of a file of responses in the same way, of any format where it is another one."""
    return _told(file, OF_RESPONSES, "" if file.is_dir() else _told(file, EVERY, "csv"))


def _told(file: Path, formats: Mapping[_Name, Format], otherwise: _Name) -> _Name:
    start = first_bytes(file)
    found = next((name for name, one in formats.items() if one.magic and start.startswith(one.magic)), None)
    if found is not None:
        return found
    if "npz" in formats and start.startswith(_ZIP) and _ARRAY in start:
        return next(name for name in formats if name == "npz")
    suffixes = [suffix.lower() for suffix in file.suffixes]
    if is_packed(file) and suffixes:
        suffixes.pop()
    last = suffixes[-1] if suffixes else ""
    return next((name for name, one in formats.items() if last in one.suffixes), otherwise)


Origin: TypeAlias = tuple[str, int]
"""What a moment counts from, `1970` or `midnight`, and nanoseconds since then."""

_SERIES = re.compile(r"\((?:\d+,\s*)*:(?:,\s*\d+)*\)$")
_FIRST = re.compile(r"\(1\)")
_BELOW = (".", "(", "{", "[", "/")
_MOST_LOOKS = 20_000
_AS_NUMBERS = "Save it as a real numeric column."


@dataclass(frozen=True)
class Reason:
    """Why a variable cannot be read, and what to do."""

    what: str
    remedy: str = _AS_NUMBERS


@dataclass
class Found:
    """What a reader finds in a log, piece by piece."""

    arrays: dict[str, NDArray[Any]] = field(default_factory=dict)  # Values of the variables that were asked for
    sizes: dict[str, int] = field(default_factory=dict)  # Number of values of every variable that could be read
    units: dict[str, str] = field(default_factory=dict)  # Units that the log states
    # Moments from which times count that were written as moments: nanoseconds since 1970, or since midnight without
    # a date, by the time's name
    origins: dict[str, Origin] = field(default_factory=dict)
    unreadable: dict[str, Reason] = field(default_factory=dict)  # Variables that cannot be read, with the reason
    texts: dict[str, str] = field(default_factory=dict)  # Texts that the log holds beside its numbers
    damage: Reason | None = None  # What is wrong with the log as a whole, where some of it can be read
    room: int = sys.maxsize  # What there is room for in the values that are still to be read [bytes]
    looks: int = 0  # How many things within each other were looked at

    def add(self, name: str, values: Any, unit: str = "") -> None:  # noqa: ANN401
        """Adds an array; what holds no numbers is noted as unreadable."""
        array = np.asarray(values)
        if array.dtype.kind not in "fiubc":
            self.unreadable[name] = Reason(f"D086 It contains {_KINDS.get(array.dtype.kind, 'objects')}, not numbers.")
            return
        self.arrays[name] = array
        self.mention(name, array.size, unit)

    @contextmanager
    def guarded(self, name: str, what: str = "It is damaged", remedy: str = "Save the log again.") -> Iterator[None]:
        """Notes a variable as unreadable where reading it fails, with whatever a damaged one makes libraries raise.

        The others stay readable; a lack of memory is the log's, not the variable's.
        """
        try:
            yield
        except (MemoryError, TooLargeError):
            raise
        except Exception as e:  # noqa: BLE001
            self.unreadable[name] = Reason(f"D087 {what} ({e}).", remedy)

    def reserve(self, name: str, size: int) -> None:
        """Takes room for values before they are read [bytes]: a file may declare any number of them.

        Raises:
            TooLargeError: If there is none.
        """
        self.room -= size
        if self.room < 0:
            what = f"D507 `{name}` would have {size >> 20} MB, more than signals in a file of its size."
            raise TooLargeError(what, "Write the log again without it, or with less compression.")

    def look(self) -> None:
        """Counts what is looked at in structures that may contain themselves.

        Raises:
            TooLargeError: If it does not end.
        """
        self.looks += 1
        if self.looks > _MOST_LOOKS:
            raise TooLargeError("D508 Its structures do not end.", "Save what is needed as variables of their own.")

    def take(self, name: str, matrix: Any, wanted: Wanted, unit: str = "") -> None:  # noqa: ANN401
        """Adds an array; of one of which only columns or rows were asked for, these; of what was not, the size."""
        series = wanted.series(name) if name in wanted else []
        if series is None or (series and len(matrix.shape) < 2):
            self.reserve(name, matrix.nbytes)
            self.add(name, matrix[()], unit)
            return
        self.mention(name, int(np.prod(matrix.shape)), unit)
        for index in series:
            if (place := series_place(index, matrix.shape)) is not None:
                self.reserve(f"{name}{index}", matrix.dtype.itemsize * max(matrix.shape))
                self.arrays[f"{name}{index}"] = matrix[place]

    def note_text(self, name: str, text: str) -> None:
        """Notes a text; as the unit, where its name says so, of the field `Data` beside it."""
        self.texts[name] = text
        self.unreadable[name] = Reason("D088 It contains text, not numbers.")
        parent, _, field_name = name.rpartition(".")
        if field_name in ("Unit", "Units", "unit", "units"):
            self.units[f"{parent}.Data"] = text

    def mention(self, name: str, size: int, unit: str = "") -> None:
        """Notes a variable that was not asked for, or the unit of one that was."""
        self.sizes[name] = size
        if unit:
            self.units[name] = unit


_KINDS = {"U": "text", "S": "text", "T": "text", "M": "dates", "m": "time spans"}


@dataclass(frozen=True)
class Variables(Mapping[str, NDArray[Any]]):
    """The variables of a log that were asked for, and what its reader found of the others."""

    file: Path
    found: Found

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self.found.arrays[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.found.arrays)

    def __len__(self) -> int:
        return len(self.found.arrays)

    @property
    def sizes(self) -> Mapping[str, int]:
        """Number of values of every readable variable, asked for or not."""
        return self.found.sizes

    @property
    def units(self) -> Mapping[str, str]:
        """Units that the log states, as it writes them."""
        return self.found.units

    def origin(self, name: str) -> Origin | None:
        """The moment from which a time counts; None where it is not known."""
        known = _match(self.found.origins, plain_name(name), name)
        return None if known is None else self.found.origins[known]

    @property
    def texts(self) -> Mapping[str, str]:
        """Texts that the log holds beside its numbers, as the names of channels."""
        return self.found.texts

    @property
    def unreadable(self) -> Mapping[str, Reason]:
        """Variables that cannot be read, with the reason."""
        return self.found.unreadable


@dataclass(frozen=True)
class Wanted:
    """Which variables were asked for; all where `names` is None."""

    names: Collection[str] | None = None
    _plain: frozenset[str] = field(init=False, default=frozenset())

    def __post_init__(self) -> None:
        both = {form for name in self.names or () for form in (plain_name(name), base_name(name))}
        object.__setattr__(self, "_plain", frozenset(both))

    def __contains__(self, name: str) -> bool:
        return self.names is None or plain_name(name) in self._plain

    def below(self, name: str) -> bool:
        """Whether a variable, or one inside it, was asked for."""
        if name in self:
            return True
        starts = tuple(plain_name(name) + mark for mark in _BELOW)
        return any(one.startswith(starts) for one in self._plain)

    def series(self, name: str) -> list[str] | None:
        """Columns and rows of a matrix that were asked for, as `(:,2)` and `(2,:)`; None where all of it was."""
        if self.names is None or plain_name(name) in {plain_name(one) for one in self.names}:
            return None
        inside = [series_index(one) for one in self.names if base_name(one) == plain_name(name)]
        return sorted({one for one in inside if one})


def plain_name(name: str) -> str:
    """Returns a name without what may be left out: the index `(1)`, spaces in an index, a `/` at its beginning."""
    return _FIRST.sub("", _tidy(name)).removeprefix("/")


def base_name(name: str) -> str:
    """Returns the plain name of the matrix that a column or row belongs to."""
    return _SERIES.sub("", plain_name(name))


def series_index(name: str) -> str:
    """Returns which column or row of a matrix a name says, as `(:,2)` or `(2,:)`; nothing where it says none."""
    found = _SERIES.search(_tidy(name))
    return found[0] if found else ""


def series_place(index: str, shape: Sequence[int]) -> tuple[int | slice, ...] | None:
    """Returns where a column or row is in a matrix; None where that has no such one."""
    parts = index.strip("()").split(",")
    if len(parts) != len(shape):
        return None
    place = tuple(slice(None) if part == ":" else int(part) - 1 for part in parts)
    inside = all(isinstance(one, slice) or 0 <= one < size for one, size in zip(place, shape, strict=True))
    return place if inside else None


def series_of(shape: Sequence[int]) -> list[str]:
    """Returns the series along an array's longest axis: columns `(:,2)` of a high one, rows `(2,:)` of a wide one."""
    time = int(np.argmax(shape))
    rest = [range(1, 1 + size) for axis, size in enumerate(shape) if axis != time]
    indices = ([*map(str, one[:time]), ":", *map(str, one[time:])] for one in product(*rest))
    return [f"({','.join(one)})" for one in indices]


def _tidy(name: str) -> str:
    """A name without spaces in the index of a column or row."""
    return _SERIES.sub(lambda found: found[0].replace(" ", ""), name)


def number_repeated(names: Sequence[str]) -> tuple[list[str], dict[str, Reason]]:
    """Numbers the names that occur more than once, as `speed(2)`, and says why the plain name will not do."""
    again = {name: names.count(name) for name in names} if len(set(names)) < len(names) else {}
    seen: dict[str, int] = {}
    numbered = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        numbered.append(f"{name}({seen[name]})" if again.get(name, 1) > 1 else name)
    reasons = {
        name: Reason(f"D089 Its name occurs {count} times.", f"Say which: `{name}(1)` to `{name}({count})`.")
        for name, count in again.items()
        if count > 1
    }
    return numbered, reasons


def find_variable(variables: Mapping[str, Any], name: str) -> Any:  # noqa: ANN401
    """Returns a variable by its name.

    `name(:,2)` is the second column of a matrix, `name(2,:)` its second row; an index `(1)` may be left out.

    Raises:
        KeyError: If there is none.
        DataError: If it is there, or may be, but cannot be read.
    """
    if name in variables:
        return variables[name]
    if isinstance(variables, Variables):
        _check_readable(variables, name)
    known = _match(variables, plain_name(name), name)
    if known is not None:
        return variables[known]
    index, base = series_index(name), _match(variables, base_name(name), _SERIES.sub("", name))
    if not index or base is None:
        raise KeyError(name)
    matrix = np.asarray(variables[base])
    place = series_place(index, matrix.shape)
    if place is None:
        raise KeyError(name)
    return matrix[place]


def _match(known: Iterable[str], plain: str, name: str) -> str | None:
    """Returns the known name that a name stands for; only the name, not the known one, may have `(1)` too many."""
    pattern = re.escape(_tidy(name).removeprefix("/")).replace(r"\(1\)", r"(?:\(1\))?")
    alike = (one for one in known if plain_name(one) == plain)
    return next((one for one in alike if re.fullmatch(f"/?{pattern}", one)), None)


def _check_readable(variables: Variables, name: str) -> None:
    """Refuses a variable that cannot be read: it, what it lies in, or the rest of a damaged log."""
    plain, found = plain_name(name), variables.found
    if _match(found.sizes, plain, name) is not None:
        return
    for known, reason in found.unreadable.items():
        inside = plain.startswith(tuple(plain_name(known) + mark for mark in _BELOW))
        if inside or _match([known], plain, name) is not None:
            raise _unreadable(variables, name, reason)
    absent = {plain, base_name(name)}.isdisjoint(plain_name(known) for known in found.sizes)
    if absent and found.damage is not None:
        raise _unreadable(variables, name, found.damage)


def _unreadable(variables: Variables, name: str, reason: Reason) -> DataError:
    return DataError(reason.what, where=f"{variables.file}: variable `{name}`", remedy=reason.remedy)
