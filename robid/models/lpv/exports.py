"""Formats that a position-dependent model can be written in."""

from __future__ import annotations

from functools import partial

from robid.models.family import Export, ExportTask


def _written(name: str, task: ExportTask) -> bytes:
    from robid.models.lpv.writing import WRITERS

    return WRITERS[name](task)


EXPORTS = {
    "json": Export("lpv.json", (".json",), partial(_written, "json"), takes_configuration=False),
    "mat": Export("lpv.mat", (".mat",), partial(_written, "mat"), takes_configuration=False),
    "hdf5": Export("lpv.h5", (".h5",), partial(_written, "hdf5"), takes_configuration=False),
}
