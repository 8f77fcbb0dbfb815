"""Reads a position-dependent model from a run folder or from what was exported."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from robid.artifacts.model import MODEL
from robid.artifacts.store import read_artifact
from robid.errors import ArtifactError
from robid.families.lpv.files import solution_from_artifact
from robid.fit.lpv.model import LpvModel
from robid.fit.lpv.solution import BasisTable
from robid.fit.lpv.state_space import MATRICES, StateSpace, pack

FORMAT = "robid lpv 1"


def read_model(path: Path) -> LpvModel:
    """Reads a model of `model.h5`, or of an export as JSON or HDF5.

    Raises:
        ArtifactError: If the file holds none.
    """
    if path.suffix == ".json":
        content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    else:
        content = _exported(path)
    if content.get("format") == FORMAT:
        return _model(content)
    model = read_artifact(path, MODEL) if path.suffix == ".h5" else None
    if model is None or model.attributes.get("family") != "lpv":
        message = f"{path} holds no position-dependent model"
        raise ArtifactError(message, remedy="name the model.h5 of a fit of family `lpv`, or its export")
    return solution_from_artifact(model).model


def _exported(path: Path) -> dict[str, Any]:
    if not h5py.is_hdf5(path):
        return {}
    with h5py.File(path) as file:
        datasets = {name: one[()] for name, one in file.items() if isinstance(one, h5py.Dataset)}
        return {**datasets, **dict(file.attrs)}


def _model(content: dict[str, Any]) -> LpvModel:
    table = BasisTable(
        names=tuple(map(str, content["functions"])),
        kind=str(content["basis"]),
        exponents=np.asarray(content["exponents"], int).reshape(-1, len(content["scheduling"])),
        center=np.asarray(content["center"], float),
        scale=np.asarray(content["scale"], float),
        knots=np.asarray(content["knots"], float).reshape(len(content["scheduling"]), -1),
        degree=int(content["degree"]),
        lower=np.asarray(content["lower"], float),
        upper=np.asarray(content["upper"], float),
    )
    blocks = StateSpace(*(np.asarray(content[name], float) for name in MATRICES))
    return LpvModel(pack(blocks), blocks.sizes, table.basis(), float(content["sampling_period_s"]))
