"""Folders of rows: each attempt makes its own aside, which takes the row's place when whole, however a run ends."""

from __future__ import annotations

import errno
import os
import secrets
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from robid.errors import ArtifactError
from robid.fleet.ledger import LEDGER, read_ledger

PAGE = "report.html"
"""A row's own page, which goes when the row is made again."""

_MARK = ".attempt"
# What ids do not contain: it ends the id in the name of a folder aside.
_BETWEEN = "~"
_OVERTAKEN = (errno.ENOENT, errno.ENOTEMPTY, errno.EEXIST)


@contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Tells of a folder that cannot be written."""
    try:
        yield
    except OSError as error:
        remedy = "check that the folder may be written to and that the disk has room"
        message = f"A024 The folder cannot be written: {error.strerror or error}."
        raise ArtifactError(message, where=str(folder), remedy=remedy) from error


def new_attempt() -> str:
    """Returns the name of an attempt at a row, which no other has."""
    return secrets.token_hex(8)


def aside(folder: Path, attempt: str, kind: str) -> Path:
    """Returns the folder of one attempt beside a row's: `.<id>~<attempt>.<kind>`."""
    return folder.with_name(f".{folder.name}{_BETWEEN}{attempt}.{kind}")


def at_work(rows: Path) -> set[str]:
    """Returns the rows that somebody is at, or was when it died."""
    return {_row_of(path).name for path in rows.glob(".*.work")}


def _row_of(path: Path) -> Path:
    """The row's folder that a folder aside belongs to; earlier versions named it `.<id>.<kind>`."""
    return path.with_name(path.name[1:].rpartition(".")[0].partition(_BETWEEN)[0])


def begin(work: Path) -> None:
    """Makes the folder of an attempt, with a mark that it is still its own."""
    with writing(work):
        work.mkdir(parents=True)
        (work / _MARK).touch()


def check_own(work: Path, files: Iterable[str] = ()) -> None:
    """Refuses to go on where another command has removed the folder of an attempt, or what must be in it.

    Raises:
        ArtifactError: If it has.
    """
    if not all((work / name).exists() for name in (*files, _MARK)):
        remove(work)
        remedy = "nothing is lost: the command that took it over makes it"
        raise ArtifactError("A025 The row was taken over by another command.", where=str(work), remedy=remedy)


def keep_files(folder: Path, *, all_files: bool) -> list[Path]:
    """Removes what is not to stay; returns what is there."""
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path.name != _MARK)
    stay = [path for path in files if all_files or path.name in ("model.h5", "validation.h5")]
    for path in set(files).difference(stay):
        path.unlink()
    for path in sorted(folder.rglob("*"), reverse=True):
        if path.is_dir():
            with suppress(OSError):
                path.rmdir()
    return stay


def put_in_place(made: Path, folder: Path) -> None:
    """Lets a finished folder take the place of the row's; files that somebody else put there move with it.

    Raises:
        ArtifactError: If it cannot be.
    """
    with writing(folder):
        (made / _MARK).unlink(missing_ok=True)
        try:
            _replace(made, folder)
        except OSError as error:
            if error.errno not in _OVERTAKEN:
                raise
            # Another attempt has just put its own in place: ours takes the place of that one.
            _replace(made, folder)
        descriptor = os.open(folder.parent, os.O_RDONLY)
        os.fsync(descriptor)
        os.close(descriptor)


def _replace(made: Path, folder: Path) -> None:
    old = aside(folder, new_attempt(), "old")
    if folder.exists():
        _carry_over(folder, made)
        folder.replace(old)
    try:
        made.replace(folder)
    except OSError:
        if folder.exists():
            remove(old)
        elif old.exists():
            old.replace(folder)
        raise
    remove(old)


def _carry_over(old: Path, made: Path) -> None:
    """Copies files, links and empty folders that no run of the row has made."""
    before = read_ledger(old)
    own = None if before is None else {LEDGER, PAGE, *before.outputs}
    for path in sorted(old.rglob("*")):
        name = path.relative_to(old)
        # Without a ledger that can be read, what looks like ours is ours.
        is_own = (
            str(name) in own if own is not None else path.suffix == ".h5" or path.name in (LEDGER, PAGE, "truth.json")
        )
        if not is_own and not os.path.lexists(made / name):
            _copy(path, made / name)


def _copy(path: Path, to: Path) -> None:
    """Copies a file, a link as a link, or an empty folder; others come with what is in them."""
    is_empty = path.is_dir() and not path.is_symlink() and not any(path.iterdir())
    if not (path.is_symlink() or path.is_file() or is_empty):
        return
    to.parent.mkdir(parents=True, exist_ok=True)
    if path.is_symlink():
        to.symlink_to(path.readlink())
    elif is_empty:
        to.mkdir()
    else:
        shutil.copy2(path, to)


def recover(rows: Path) -> None:
    """Finishes or takes back what a killed run has left half done between two folders.

    Who is still at a row for that run finds its folder gone, and leaves the row alone.
    """
    for old in rows.glob(".*.old"):
        folder = _row_of(old)
        if folder.exists():
            remove(old)
        else:
            try:
                old.replace(folder)
            except OSError as error:  # another attempt may just have put its own in place
                if error.errno not in _OVERTAKEN:
                    raise
    for pattern in (".*.work", ".*.page"):
        for work in rows.glob(pattern):
            (work / _MARK).unlink(missing_ok=True)
            remove(work)


def remove(folder: Path) -> None:
    """Removes a folder with all that is in it, as far as nobody else is at it; the next run removes what is left."""
    shutil.rmtree(folder, ignore_errors=True)
