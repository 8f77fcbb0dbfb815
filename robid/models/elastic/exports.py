"""Formats that an elastic model can be written in."""

from __future__ import annotations

from functools import partial

from robid.models.family import Export, ExportTask


def _written(name: str, task: ExportTask) -> bytes:
    from robid.models.elastic.writing import WRITERS

    return WRITERS[name](task)


EXPORTS = {
    "mjcf": Export("model.xml", (".xml",), partial(_written, "mjcf"), takes_friction=True),
    "json": Export("parameters.json", (".json",), partial(_written, "json"), takes_configuration=False),
    "csv": Export("parameters.csv", (".csv",), partial(_written, "csv"), takes_configuration=False),
    "mat": Export("model.mat", (".mat",), partial(_written, "mat")),
    "statespace": Export("statespace.mat", (".mat", ".json", ".npz"), partial(_written, "statespace")),
}
