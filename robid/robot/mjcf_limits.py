"""What an MJCF file reads and repeats, looked at before MuJoCo does, which waits on pipes and repeats without end."""

from __future__ import annotations

import math
from contextlib import suppress
from pathlib import Path
from xml.etree import ElementTree as ET

from robid.files import check_regular, read_regular

_MOST_COPIES = 10_000
_MOST_RESERVED = 100_000_000  # bytes of a small arena too
_DEEPEST = 10
_REPEATED = ("replicate", "composite")


def check_mjcf(root: ET.Element, folder: Path, depth: int = 0) -> None:
    """Looks at a model and all that it includes; meshes need not be there.

    Raises:
        OSError: If a file that it names is a pipe, a socket, a device, or too large.
        ValueError: If it repeats bodies more often than any robot does, or includes itself.
    """
    if depth > _DEEPEST:
        message = "it includes itself, or files within files without end"
        raise ValueError(message)
    copies = _copies(root)
    if copies > _MOST_COPIES:
        message = f"`replicate` and `composite` make {copies:.3g} copies, more than {_MOST_COPIES}"
        raise ValueError(message)
    reserved = [float(text) for size in root.iter("size") for text in size.attrib.values() if text.isdigit()]
    if max(reserved, default=0.0) > _MOST_RESERVED:
        message = f"`size` reserves {max(reserved):.3g} entries, more than {_MOST_RESERVED}"
        raise ValueError(message)
    for element in root.iter():
        name = element.get("file")
        if not name:
            continue
        if element.tag == "include":
            with suppress(FileNotFoundError):  # MuJoCo says where it looked
                check_mjcf(ET.fromstring(read_regular(folder / name)), folder, depth + 1)
            continue
        for place in (folder / name, *(folder / below / name for below in _folders(root))):
            with suppress(FileNotFoundError, NotADirectoryError):
                check_regular(place)


def _copies(element: ET.Element) -> float:
    """How many elements all of these make, what is repeated within what is repeated counted."""
    below = sum(_copies(child) for child in element)
    if element.tag not in _REPEATED:
        return below
    counts = [float(text) for text in element.get("count", "1").split()]
    return max(math.prod(counts), 1.0) * max(below, 1.0)


def _folders(root: ET.Element) -> list[str]:
    """Folders below that of the file in which it looks for meshes and textures."""
    keys = ("meshdir", "texturedir", "assetdir")
    return [text for compiler in root.iter("compiler") for key in keys if (text := compiler.get(key))]
