"""How much may come out of a log: bytes of a packed one, the length of a line, the values that a file declares.

A few megabytes can unpack to gigabytes. What measured signals hold does not: noise alone keeps them from it.
"""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

UNPACKING_ERRORS = (OSError, EOFError, zlib.error, lzma.LZMAError)

LEAST_ROOM = 64 << 20
ROOM_PER_BYTE = 50
"""A log may hold `LEAST_ROOM` bytes, and so many more for each byte of its file."""
LONGEST_LINE = 8 << 20
_BUFFER = 1 << 16
_BLOCK = 1 << 20
_FIRST_BYTES = 512

_PACKED: tuple[tuple[bytes, Callable[[Path], Any]], ...] = (
    (b"\x1f\x8b", gzip.GzipFile),
    (b"BZh", bz2.BZ2File),
    (b"\xfd7zXZ\x00", lzma.LZMAFile),
)


class UnreadableLogError(Exception):
    """A reader's word on why it cannot read a log, with a remedy of its own."""

    def __init__(self, what: str, remedy: str = "") -> None:
        super().__init__(what)
        self.remedy = remedy


class TooLargeError(UnreadableLogError):
    """A log, or a variable of it, that would become larger than one of its size can be; no matter of one variable."""


def room_for(file: Path) -> int:
    """Returns how much may come out of a log or bag [bytes]."""
    parts = file.rglob("*") if file.is_dir() else [file]
    return LEAST_ROOM + ROOM_PER_BYTE * sum(one.stat().st_size for one in parts if one.is_file())


def is_packed(file: Path) -> bool:
    """Whether a file is packed by gzip, bzip2 or xz."""
    return _opener(file) is not None


def open_bytes(file: Path, *, longest_line: int | None = None) -> IO[bytes]:
    """Opens a file for reading, unpacked, of which no more comes out than there is room for.

    Args:
        file: The file.
        longest_line: Bytes of a line at most; any number where it is None.

    Raises:
        UnreadableLogError: While it is read, if there is no room for the rest or a line goes on.
    """
    opener = _opener(file)
    if opener is None and longest_line is None:
        return file.open("rb")
    room = None if opener is None else room_for(file)
    return io.BufferedReader(_Bounded((opener or io.FileIO)(file), room, longest_line), _BUFFER)


def check_unpacks(file: Path) -> None:
    """Refuses a packed file of which more comes out than there is room for, before anything is made of it.

    Raises:
        UnreadableLogError: If it is so.
    """
    if is_packed(file):
        with open_bytes(file) as stream:
            while stream.read(_BLOCK):
                pass


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


class _Bounded(io.RawIOBase):
    """A stream that counts what is read from it."""

    def __init__(self, stream: IO[bytes], room: int | None, longest_line: int | None) -> None:
        self._stream, self._room, self._longest = stream, room, longest_line
        self._read = self._line = 0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:  # noqa: ANN401
        data = self._stream.read(len(buffer))
        buffer[: len(data)] = data
        self._read += len(data)
        if self._room is not None and self._read > self._room:
            what = f"D505 It unpacks to more than {self._room >> 20} MB, which signals in a file of its size do not."
            raise TooLargeError(what, "Unpack it yourself if it is to be so, and name the unpacked file.")
        end = data.rfind(b"\n")
        self._line = self._line + len(data) if end < 0 else len(data) - end - 1
        if self._longest is not None and self._line > self._longest:
            what = f"D506 A line is longer than {self._longest >> 20} MB."
            raise TooLargeError(what, "Write one line per sample, or save it as Parquet, HDF5 or MAT.")
        return len(data)

    def close(self) -> None:
        self._stream.close()
        super().close()
