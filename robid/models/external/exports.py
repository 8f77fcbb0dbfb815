"""Formats that transfer functions can be written in."""

from __future__ import annotations

from functools import partial

from robid.models.family import Export, ExportTask


def _written(name: str, task: ExportTask) -> bytes:
    from robid.models.external.writing import WRITERS

    return WRITERS[name](task)


EXPORTS = {
    "json": Export("transfer.json", (".json",), partial(_written, "json"), takes_configuration=False),
    "csv": Export("transfer.csv", (".csv",), partial(_written, "csv"), takes_configuration=False),
    "mat": Export("transfer.mat", (".mat",), partial(_written, "mat"), takes_configuration=False),
    "control": Export("transfer_functions.py", (".py",), partial(_written, "control"), takes_configuration=False),
}
