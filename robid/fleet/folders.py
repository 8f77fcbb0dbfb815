"""Folders of rows: made aside, in place when whole, old or new whenever a run is killed."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from robid.errors import ArtifactError
from robid.fleet.ledger import LEDGER, read_ledger

PAGE = "report.html"
"""A row's own page, which goes when the row is made again."""


@contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Tells of a folder that cannot be written."""
    try:
        yield
    except OSError as error:
        remedy = "check that the folder may be written to and that the disk has room"
        message = f"The folder cannot be written: {error.strerror or error}."
        raise ArtifactError(message, where=str(folder), remedy=remedy) from error


def keep_files(folder: Path, *, all_files: bool) -> list[Path]:
    """Removes what is not to stay; returns what is there."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
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
    old = folder.with_name(f".{folder.name}.old")
    with writing(folder):
        if folder.exists():
            _carry_over(folder, made)
            folder.replace(old)
        made.replace(folder)
        descriptor = os.open(folder.parent, os.O_RDONLY)
        os.fsync(descriptor)
        os.close(descriptor)
        remove(old)


def _carry_over(old: Path, made: Path) -> None:
    """Copies files that no run of the row has made."""
    before = read_ledger(old)
    own = None if before is None else {LEDGER, PAGE, *before.outputs}
    for path in sorted(old.rglob("*")):
        name = path.relative_to(old)
        # Without a ledger that can be read, what looks like ours is ours.
        is_own = (
            str(name) in own if own is not None else path.suffix == ".h5" or path.name in (LEDGER, PAGE, "truth.json")
        )
        if path.is_file() and not is_own and not (made / name).exists():
            (made / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(path, made / name)


def recover(rows: Path) -> None:
    """Finishes or takes back what a killed run has left half done between two folders."""
    for old in rows.glob(".*.old"):
        folder = rows / old.name[1:].removesuffix(".old")
        if folder.exists():
            remove(old)
        else:
            old.replace(folder)
    for pattern in (".*.work", ".*.page"):
        for work in rows.glob(pattern):
            remove(work)


def remove(folder: Path) -> None:
    """Removes a folder with all that is in it, if it is there."""
    if folder.exists():
        shutil.rmtree(folder)
