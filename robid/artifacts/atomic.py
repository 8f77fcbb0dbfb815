"""Files that are either the old one or the new one, never half of it; what killed processes leave; JSON files."""

from __future__ import annotations

import json
import math
import os
import re
import secrets
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from robid.errors import ArtifactError

PARTS = ".parts"

_PART = re.compile(r"\d{5,}\.[0-9a-f]{16}\.h5((\.[0-9a-f]{8})?\.partial)?")
_UNFINISHED = re.compile(r".+\.(h5|json|html|xml|csv|mat|npz)(\.[0-9a-f]{8})?\.partial")
_PLACES = ("", "*", "*/*", "fits/*/export")


def remove_leftovers(folder: Path, resumable: Collection[Path]) -> None:
    """Removes unfinished files from a run folder that nobody else works in, and parts that nobody resumes.

    Args:
        folder: The run folder.
        resumable: Artifacts whose parts stay.
    """
    for place in _PLACES:
        for path in folder.glob(f"{place}/*.partial" if place else "*.partial"):
            if _UNFINISHED.fullmatch(path.name) and path.is_file():
                path.unlink()
        for path in folder.glob(f"{place}/*.h5{PARTS}" if place else f"*.h5{PARTS}"):
            if path.with_name(path.name.removesuffix(PARTS)) not in resumable:
                remove_parts(path)


def remove_parts(folder: Path, *, keep: str | None = None) -> None:
    """Removes parts, and their folder once it is empty; files that are no parts stay.

    Args:
        folder: The folder of the parts.
        keep: End of the names of parts that stay.
    """
    if not folder.is_dir():
        return
    for path in folder.iterdir():
        if _PART.fullmatch(path.name) and not (keep and path.name.endswith(keep)):
            path.unlink()
    with suppress(OSError):
        folder.rmdir()


@contextmanager
def replacing(path: Path, *, alone: bool = True) -> Iterator[Path]:
    """Yields `<name>.partial` to write to, which takes the place of `path` at the end.

    Args:
        path: The file.
        alone: Whether nobody else writes it now; otherwise the name is `<name>.<8 hexadecimal digits>.partial`.

    Raises:
        ArtifactError: If the file cannot be written; `path` is as it was.
    """
    writer = "" if alone else f".{secrets.token_hex(4)}"
    partial = path.with_name(f"{path.name}{writer}.partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # One that a killed process left, or a link to something else, is not written through.
        partial.unlink(missing_ok=True)
        yield partial
        _sync(partial)
        partial.replace(path)
        _sync(path.parent)
    except OSError as error:
        raise ArtifactError(
            f"A001 The file cannot be written: {error.strerror or error}.",
            where=str(path),
            remedy="check that the folder may be written to and that the disk has room",
        ) from error
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
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise ArtifactError("A002 The file is missing.", where=str(path), remedy=remedy) from error
    except (OSError, ValueError) as error:
        raise ArtifactError(
            f"A003 The file is damaged: {error}.", where=str(path), remedy=f"delete it; {remedy}"
        ) from error


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
