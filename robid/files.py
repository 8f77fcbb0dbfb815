"""Opening files that users name: regular ones alone, and no more of them than somebody asks for."""

from __future__ import annotations

import errno
import os
import stat
from io import BufferedReader
from pathlib import Path

_OTHERS = ((stat.S_ISFIFO, "a pipe"), (stat.S_ISSOCK, "a socket"), (stat.S_ISCHR, "a device"), (stat.S_ISBLK, "a disk"))
_AT_ONCE = 1 << 16
MOST_BYTES = 1 << 30
"""More than any page, model or table has that is read at once."""


class NotRegularError(OSError):
    """What is asked for is there, but is no file with a content of its own: a pipe, a socket or a device."""

    def __str__(self) -> str:
        return str(self.strerror)


class TooLargeError(OSError):
    """A file is larger than what reads it takes."""


def check_regular(path: Path) -> None:
    """Refuses what is no regular file, without opening it: to open a pipe waits for whoever writes to it.

    Raises:
        OSError: If it is missing, a folder, or something that has no content of its own.
    """
    _check(path.stat().st_mode, path)


def open_regular(path: Path) -> BufferedReader:
    """Opens a file for reading; see `check_regular` for errors."""
    check_regular(path)
    # What lies there may be another one by now: opened so that a pipe does not wait, and looked at again.
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | os.O_NOCTTY)
    try:
        _check(os.fstat(descriptor).st_mode, path)
    except OSError:
        os.close(descriptor)
        raise
    return os.fdopen(descriptor, "rb")


def read_regular(path: Path, most_bytes: int = MOST_BYTES) -> bytes:
    """Reads a whole file that may have so many bytes.

    Raises:
        TooLargeError: If it has more; a file that says to have none may go on without end.
        OSError: As `check_regular` does.
    """
    with open_regular(path) as file:
        # As much as the file says first, and more as it comes: asked for at once, all that it may have is set aside.
        content = bytearray(file.read(min(os.fstat(file.fileno()).st_size, most_bytes)))
        while len(content) <= most_bytes and (more := file.read(_AT_ONCE)):
            content += more
    if len(content) > most_bytes:
        told = f"it has more than {most_bytes / 2**20:g} MiB"
        raise TooLargeError(errno.EFBIG, told, str(path))
    return bytes(content)


def read_regular_text(path: Path) -> str:
    """Reads a whole text in UTF-8; see `read_regular` for errors."""
    return read_regular(path).decode("utf-8")


def _check(mode: int, path: Path) -> None:
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(mode):
        kind = next((told for is_kind, told in _OTHERS if is_kind(mode)), "no file")
        raise NotRegularError(errno.EINVAL, f"it is {kind}, where a file is asked for", str(path))
