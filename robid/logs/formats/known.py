"""The table of formats, and how a file's is told from its first bytes or its name."""

from __future__ import annotations

import bz2
import gzip
import lzma
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

_FIRST_BYTES = 512
UNPACKING_ERRORS = (OSError, EOFError, zlib.error, lzma.LZMAError)


@dataclass(frozen=True)
class Format:
    """A format of logs.

    Attributes:
        title: What a message calls it.
        module: The module that reads it, by `read(file, wanted)`.
        suffixes: Ends of file names that say so where the first bytes do not.
        needs: Modules that must be installed.
        extra: What installs them, `pip install 'robid[extra]'`.
    """

    title: str
    module: str
    suffixes: tuple[str, ...]
    needs: tuple[str, ...] = ()
    extra: str = ""


_HERE = "robid.logs.formats"
FORMATS = {
    "csv": Format("a table of text", f"{_HERE}.tables", (".csv", ".txt", ".tsv", ".dat", ".asc", ".log", ".lvm")),
    "mat": Format("a MAT file", f"{_HERE}.mat", (".mat",)),
    "hdf5": Format("an HDF5 file", f"{_HERE}.hdf5", (".h5", ".hdf5", ".hdf")),
    "parquet": Format("a Parquet file", f"{_HERE}.parquet", (".parquet", ".pq"), ("pyarrow",), "parquet"),
    "mcap": Format("an MCAP file", f"{_HERE}.mcap_file", (".mcap",), ("mcap", "rosbags"), "ros"),
    "rosbag": Format("a ROS 2 bag", f"{_HERE}.rosbag", (".db3",), ("mcap", "rosbags"), "ros"),
    "tdms": Format("a TDMS file", f"{_HERE}.tdms", (".tdms",), ("nptdms",), "tdms"),
    "mdf": Format("an MDF file", f"{_HERE}.mdf", (".mf4", ".mdf"), ("asammdf",), "mdf"),
}

_MAGIC = (
    (b"\x89HDF\r\n\x1a\n", "hdf5"),
    (b"PAR1", "parquet"),
    (b"\x89MCAP0\r\n", "mcap"),
    (b"SQLite format 3\x00", "rosbag"),
    (b"TDSm", "tdms"),
    (b"MDF     ", "mdf"),
    (b"UnFinMF ", "mdf"),
    (b"MATLAB ", "mat"),
)
_PACKED: tuple[tuple[bytes, Callable[[Path], Any]], ...] = (
    (b"\x1f\x8b", gzip.GzipFile),
    (b"BZh", bz2.BZ2File),
    (b"\xfd7zXZ\x00", lzma.LZMAFile),
)
FOREIGN = (
    (b"#ROSBAG V2.0", "a bag of ROS 1", "Convert it with `rosbags-convert --src LOG --dst FOLDER`."),
    (b"PK\x03\x04", "a zip archive or a spreadsheet", "Unpack it, or save the sheet as CSV."),
    (b"\xd0\xcf\x11\xe0", "a spreadsheet of an old version", "Save the sheet as CSV."),
    (b"\x28\xb5\x2f\xfd", "packed with zstd", "Unpack it with `zstd -d`."),
)


def is_packed(file: Path) -> bool:
    """Whether a file is packed by gzip, bzip2 or xz."""
    return _opener(file) is not None


def open_bytes(file: Path) -> IO[bytes]:
    """Opens a file for reading, unpacked."""
    opener = _opener(file)
    return file.open("rb") if opener is None else opener(file)


def tell_format(file: Path) -> str:
    """Returns the name of a log's format by its first bytes, else by its name; a table of text where neither says."""
    if file.is_dir():
        return "rosbag"
    start = first_bytes(file)
    found = next((name for magic, name in _MAGIC if start.startswith(magic)), None)
    if found is not None:
        return found
    suffixes = [suffix.lower() for suffix in file.suffixes]
    if is_packed(file) and suffixes:
        suffixes.pop()
    last = suffixes[-1] if suffixes else ""
    return next((name for name, one in FORMATS.items() if last in one.suffixes), "csv")


def first_bytes(file: Path) -> bytes:
    """Returns the first bytes of a file, unpacked; none of a folder or of a file that cannot be unpacked."""
    if file.is_dir():
        return b""
    try:
        with open_bytes(file) as stream:
            return stream.read(_FIRST_BYTES)
    except UNPACKING_ERRORS:
        return b""


def _opener(file: Path) -> Callable[[Path], Any] | None:
    with file.open("rb") as stream:
        start = stream.read(8)
    return next((opener for magic, opener in _PACKED if start.startswith(magic)), None)
