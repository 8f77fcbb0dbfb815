"""Opening our own files for writing: regular files with one name, and never another one behind a link."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Sequence
from pathlib import Path

_ALWAYS = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC


class NotOwnError(OSError):
    """What lies in the place of a file of ours is none: a link, a second name of another file, a pipe or a device."""

    def __str__(self) -> str:
        return str(self.strerror)


def create_new(path: Path) -> int:
    """Creates an empty file where there is nothing yet, not even a link, and returns its descriptor.

    Raises:
        OSError: If something is there, or it cannot be made.
    """
    return os.open(path, _ALWAYS | os.O_EXCL, 0o666)


def open_own(path: Path) -> int:
    """Opens a file of ours to be written on, or creates it, and returns its descriptor.

    Raises:
        NotOwnError: If what is there is a link, a file that has another name too, or no regular file; it is left alone.
        OSError: If it cannot be opened.
    """
    try:
        # Without waiting: a pipe would have us wait for a reader.
        descriptor = os.open(path, _ALWAYS | os.O_APPEND | os.O_NONBLOCK, 0o666)
    except OSError as error:
        if error.errno in (errno.ELOOP, errno.EMLINK):
            raise _not_own("a link", path) from error
        raise
    status = os.fstat(descriptor)
    # A file whose names are all gone meanwhile, as that of a lock that was just given back, is still ours.
    if not stat.S_ISREG(status.st_mode) or status.st_nlink > 1:
        os.close(descriptor)
        raise _not_own("a second name of another file" if stat.S_ISREG(status.st_mode) else "no regular file", path)
    return descriptor


def linked_folder(folder: Path, files: Sequence[Path]) -> Path | None:
    """Returns the first folder between a folder of ours and files in it that is a link to somewhere else, if any."""
    parents = (parent for file in files for parent in file.parents if folder in parent.parents)
    return next((parent for parent in dict.fromkeys(parents) if parent.is_symlink()), None)


def _not_own(what: str, path: Path) -> NotOwnError:
    return NotOwnError(errno.EEXIST, f"it is {what}, which robid does not write through", str(path))
