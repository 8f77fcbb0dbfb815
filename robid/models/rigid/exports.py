"""Formats that a rigid model can be written in."""

from __future__ import annotations

from functools import partial

from robid.models.family import Export, ExportTask


def _written(name: str, task: ExportTask) -> bytes:
    from robid.models.rigid.writing import WRITERS

    return WRITERS[name](task)


EXPORTS = {
    "robot": Export("robot.yaml", (".yaml", ".yml"), partial(_written, "robot"), takes_configuration=False),
    "urdf": Export("robot.urdf", (".urdf",), partial(_written, "urdf"), takes_configuration=False),
    "mjcf": Export("robot.xml", (".xml",), partial(_written, "mjcf"), takes_configuration=False, takes_friction=True),
    "json": Export("parameters.json", (".json",), partial(_written, "json"), takes_configuration=False),
    "csv": Export("parameters.csv", (".csv",), partial(_written, "csv"), takes_configuration=False),
    "mat": Export("model.mat", (".mat",), partial(_written, "mat"), takes_configuration=False),
}
