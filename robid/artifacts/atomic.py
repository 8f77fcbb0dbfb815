"""Files that are either the old one or the new one, what killed processes leave, JSON files; and locks on them."""

from __future__ import annotations

import fcntl
import json
import math
import os
import re
import secrets
import time
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

import numpy as np

from robid.artifacts.artifact import utc_now
from robid.errors import ArtifactError
from robid.files import read_regular_text
from robid.writing import NotOwnError, create_new, linked_folder, open_own

PARTS = ".parts"

_PART = re.compile(r"\d{5,}\.[0-9a-f]{16}\.(part|h5)((\.[0-9a-f]{8})?\.partial)?")
_UNFINISHED = re.compile(r".+\.(h5|part|json|html|xml|csv|mat|npz)(\.[0-9a-f]{8})?\.partial")
_PLACES = ("", "*", "*/*", "fits/*/export")


def remove_leftovers(folder: Path, resumable: Collection[Path]) -> None:
    """Removes unfinished files of a run folder in which nobody else works, and parts of artifacts nobody resumes.

    What lies behind a link to another folder is not this run's.
    """
    for place in _PLACES:
        for path in folder.glob(f"{place}/*.partial" if place else "*.partial"):
            if _UNFINISHED.fullmatch(path.name) and path.is_file() and linked_folder(folder, [path]) is None:
                path.unlink()
        for path in folder.glob(f"{place}/*.h5{PARTS}" if place else f"*.h5{PARTS}"):
            is_resumed = path.with_name(path.name.removesuffix(PARTS)) in resumable
            if not is_resumed and linked_folder(folder, [path]) is None:
                remove_parts(path)


def check_folders(folder: Path, files: Iterable[Path]) -> None:
    """Refuses to write into a folder of a run that is a link to somewhere else; the run folder itself may be one.

    Raises:
        ArtifactError: If a file is to go there.
    """
    linked = linked_folder(folder, [*files])
    if linked is not None:
        what = "A040 A folder within the run folder is a link: what is written there would go elsewhere."
        remedy = "remove the link and move here what it leads to, or name another run folder with --run-dir"
        raise ArtifactError(what, where=str(linked), remedy=remedy)


def parts_of(artifact: Path) -> Path:
    """The folder of an artifact's parts."""
    return artifact.with_name(artifact.name + PARTS)


def remove_parts(folder: Path, *, keep: str | None = None) -> None:
    """Removes parts but those with this end of their names, and their folder if it is empty; other files stay."""
    if folder.is_symlink() or not folder.is_dir():
        return
    for path in folder.iterdir():
        if _PART.fullmatch(path.name) and not (keep and path.name.endswith(keep)):
            path.unlink()
    with suppress(OSError):
        folder.rmdir()


@contextmanager
def replacing(path: Path, *, alone: bool = True, lasting: bool = True) -> Iterator[Path]:
    """Yields `<name>.partial` to write to, which takes the place of `path` at the end.

    Args:
        path: The file.
        alone: Whether nobody else writes it now; otherwise the name is `<name>.<8 hexadecimal digits>.partial`.
        lasting: Whether it must be on the disk before it is named: a part that a power cut spoils is made again.

    Raises:
        ArtifactError: If the file cannot be written; `path` is as it was.
    """
    writer = "" if alone else f".{secrets.token_hex(4)}"
    partial = path.with_name(f"{path.name}{writer}.partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # One that a killed process left, or a link to something else, is not written through.
        partial.unlink(missing_ok=True)
        os.close(create_new(partial))
        yield partial
        if lasting:
            _sync(partial)
        partial.replace(path)
        if lasting:
            _sync(path.parent)
    except OSError as error:
        what = f"A001 The file cannot be written: {error.strerror or error}."
        remedy = "check that the folder may be written to and that the disk has room"
        raise ArtifactError(what, where=str(path), remedy=remedy) from error
    finally:
        with suppress(OSError):
            partial.unlink()


def write_json(path: Path, content: object) -> None:
    """Writes a JSON file at once; numpy values become plain ones, numbers that are not finite become null."""
    with replacing(path) as partial:
        partial.write_bytes(json_text(content).encode())


def json_text(content: object) -> str:
    """Returns the text of a JSON file."""
    return json.dumps(plain(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def read_json(path: Path, *, made_by: str = "robid run") -> Any:  # noqa: ANN401
    """Reads a JSON file.

    Raises:
        ArtifactError: If it is missing or not JSON.
    """
    remedy = f"`{made_by}` makes it again"
    try:
        return json.loads(read_regular_text(path))
    except FileNotFoundError as error:
        raise ArtifactError("A002 The file is missing.", where=str(path), remedy=remedy) from error
    except (OSError, ValueError, RecursionError) as error:
        what, remedy = f"A003 The file is damaged: {error}.", f"delete it; {remedy}"
        raise ArtifactError(what, where=str(path), remedy=remedy) from error


def plain(value: object) -> object:
    """Turns numpy values into plain ones, and numbers that are not finite into None."""
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


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
    except NotOwnError as error:
        what = f"A039 The lock cannot be taken: {error}."
        remedy = "look at what it is, and move it away; or name another folder with --run-dir"
        raise ArtifactError(what, where=str(path), remedy=remedy) from error
    except OSError as error:
        what = f"A004 The lock cannot be written: {error.strerror or error}."
        remedy = "name another folder with --run-dir, or change its permissions"
        raise ArtifactError(what, where=str(path), remedy=remedy) from error
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
        file = os.fdopen(open_own(path), "a+", encoding="utf-8")
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            file.close()
            raise _taken(path) from error
        except OSError:
            file.close()
            raise
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(file.fileno()), path.lstat()):
                return file
        file.close()


def _taken(path: Path) -> ArtifactError:
    holder = _holder(path)
    who = f"process {holder['pid']}, since {holder['since_utc']}: {holder['does']}" if holder else "it says not which"
    what = f"A005 Another robid is at work here ({who})."
    remedy = "wait until it is done, or name another folder with --run-dir"
    return ArtifactError(what, where=str(path), remedy=remedy)


def _holder(path: Path) -> dict[str, Any]:
    """Reads who holds a lock; the holder may be about to write it."""
    for _ in range(_TRIES):
        with suppress(OSError, ValueError):
            found = json.loads(path.read_text(encoding="utf-8"))
            if isinstance(found, dict) and {"pid", "since_utc", "does"} <= found.keys():
                return found
        time.sleep(_PAUSE_S)
    return {}
