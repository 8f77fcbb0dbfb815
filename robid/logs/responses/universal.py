"""Reads Universal Files, dataset 58: in the process that reads foreign binary files."""

from __future__ import annotations

from pathlib import Path

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
