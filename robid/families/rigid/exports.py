"""Formats that a rigid model can be written in."""

from __future__ import annotations

from functools import partial

from robid.families.family import Export, ExportTask


def _written(name: str, task: ExportTask) -> bytes:
    from robid.families.rigid.writing import WRITERS

    return WRITERS[name](task)


EXPORTS = {
    "json": Export("parameters.json", (".json",), partial(_written, "json"), takes_configuration=False),
    "csv": Export("parameters.csv", (".csv",), partial(_written, "csv"), takes_configuration=False),
    "mat": Export("model.mat", (".mat",), partial(_written, "mat"), takes_configuration=False),
}
