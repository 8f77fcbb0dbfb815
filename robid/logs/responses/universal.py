"""Reads Universal Files, dataset 58, and JSON: in the process that reads foreign binary files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from robid.logs.formats.unpacking import UnreadableLogError
from robid.logs.formats.variables import Found, Wanted

_TEXTS = ("id1", "id2", "id3", "id4", "id5", "rsp_ent_name", "ref_ent_name", "ordinate_axis_units_lab")
_NUMBERS = ("func_type", "ver_num", "rsp_node", "rsp_dir", "ref_node", "ref_dir")


def read_uff(file: Path, wanted: Wanted) -> Found:  # noqa: ARG001
    """Reads every dataset 58 as `set(k).x`, `set(k).data` and what it says of itself, k from 1."""
    import pyuff

    found = Found()
    source = pyuff.UFF(str(file))
    kinds = [int(kind) for kind in np.ravel(source.get_set_types())]
    places = [index for index, kind in enumerate(kinds) if kind == 58]
    if not places:
        raise UnreadableLogError("D611 The Universal File has no dataset 58.", "Export responses as dataset 58.")
    for number, index in enumerate(places, start=1):
        found.look()
        name = f"set({number})"
        with found.guarded(name):
            read = source.read_sets(index)
            found.add(f"{name}.x", np.asarray(read["x"], float))
            found.add(f"{name}.data", np.asarray(read["data"]))
            for key in _NUMBERS:
                found.add(f"{name}.{key}", float(read.get(key) or 0))
            found.texts.update({f"{name}.{key}": str(read.get(key) or "").strip() for key in _TEXTS})
    return found


def read_json(file: Path, wanted: Wanted) -> Found:  # noqa: ARG001
    """Reads arrays of numbers by their path, as `a.b`; null is NaN; texts beside them."""
    found = Found()
    try:
        content = json.loads(file.read_text(encoding="utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise UnreadableLogError(f"D612 The file is no JSON ({error}).", "Export the response again.") from error
    _take("", content, found)
    return found


def _take(name: str, value: Any, found: Found) -> None:  # noqa: ANN401
    found.look()
    if isinstance(value, dict):
        for key, inside in value.items():
            _take(f"{name}.{key}" if name else str(key), inside, found)
    elif isinstance(value, str):
        found.note_text(name, value)
    elif isinstance(value, list) and value and all(isinstance(one, str) for one in value):
        for index, one in enumerate(value, start=1):
            found.note_text(f"{name}{{{index}}}", one)
    elif isinstance(value, list | int | float):
        with found.guarded(name, "It is no array of numbers"):
            found.add(name, np.array(value, dtype=float))
