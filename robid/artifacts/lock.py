"""A lock on a folder or file that one process holds, and that ends with it however it ends."""

from __future__ import annotations

import fcntl
import json
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from robid.artifacts.artifact import utc_now
from robid.errors import ArtifactError

FOLDER_LOCK = ".lock"

_TRIES = 5
_PAUSE_S = 0.05


@contextmanager
def locked(path: Path, does: str) -> Iterator[None]:
    """Holds a lock file; the system gives it free when the process dies, so that one left behind blocks nobody.

    Args:
        path: The lock file, which says who holds it and is gone afterwards.
        does: What the holder does, for the message that others get.

    Raises:
        ArtifactError: If another process holds it, or it cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = _hold(path)
    except OSError as error:
        raise ArtifactError(
            f"A004 The lock cannot be written: {error.strerror or error}.",
            where=str(path),
            remedy="name another folder with --run-dir, or change its permissions",
        ) from error
    with file:
        try:
            file.truncate(0)
            file.write(json.dumps({"pid": os.getpid(), "since_utc": utc_now(), "does": does}))
            file.flush()
            yield
        finally:
            # While it is still held: afterwards it may be another one's.
            with suppress(OSError):
                path.unlink()


def _hold(path: Path) -> IO[str]:
    """Opens the lock file and holds it; one that its holder has removed meanwhile is opened anew."""
    while True:
        file = path.open("a+", encoding="utf-8")
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            file.close()
            raise _taken(path) from error
        except OSError:
            file.close()
            raise
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(file.fileno()), path.stat()):
                return file
        file.close()


def _taken(path: Path) -> ArtifactError:
    holder = _holder(path)
    who = f"process {holder['pid']}, since {holder['since_utc']}: {holder['does']}" if holder else "it says not which"
    return ArtifactError(
        f"A005 Another robid is at work here ({who}).",
        where=str(path),
        remedy="wait until it is done, or name another folder with --run-dir",
    )


def _holder(path: Path) -> dict[str, Any]:
    """Reads who holds a lock; the holder may be about to write it."""
    for _ in range(_TRIES):
        with suppress(OSError, ValueError):
            found = json.loads(path.read_text(encoding="utf-8"))
            if isinstance(found, dict) and {"pid", "since_utc", "does"} <= found.keys():
                return found
        time.sleep(_PAUSE_S)
    return {}
