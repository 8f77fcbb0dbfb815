"""What a killed process leaves: parts of artifacts and unfinished files."""

from __future__ import annotations

import re
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path

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
