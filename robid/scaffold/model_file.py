"""A copy of a rigid model in one file, with what it includes."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

from robid.errors import DataError
from robid.files import read_regular

_DEEPEST = 16


def self_contained(path: Path) -> bytes:
    """Returns a model's file, MJCF or URDF, with the files that it includes in their places; meshes are not needed.

    Raises:
        DataError: If it or one that it includes cannot be read.
    """
    text = _read(path)
    try:
        root = ET.fromstring(text)
    except ET.ParseError:
        return text  # whoever reads it says what is wrong with it
    if root.tag != "mujoco" or root.find(".//include") is None:
        return text
    _include(root, path.parent, 0)
    return ET.tostring(root, encoding="unicode").encode()


def _include(element: ET.Element, folder: Path, depth: int) -> None:
    """Puts the children of every included file where it is included; names start at the outermost file's folder."""
    children = [part for child in element for part in _parts(child, folder, depth)]
    element[:] = children
    for child in children:
        _include(child, folder, depth)


def _parts(child: ET.Element, folder: Path, depth: int) -> Iterator[ET.Element]:
    if child.tag != "include":
        yield child
        return
    path = folder / child.get("file", "")
    if depth == _DEEPEST:
        raise DataError("D281 includes itself", where=str(path), remedy="correct the model")
    try:
        held = ET.fromstring(_read(path))
    except ET.ParseError as error:
        raise DataError(f"D282 is no XML: {error}", where=str(path), remedy="correct the model") from error
    for part in held:
        yield from _parts(part, folder, depth + 1)


def _read(path: Path) -> bytes:
    try:
        return read_regular(path)
    except OSError as error:
        what = f"D280 cannot be read: {error.strerror or error}"
        raise DataError(what, where=str(path), remedy="check the path") from error
