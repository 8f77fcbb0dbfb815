"""How position-dependent models lie in their files, what they are written as, and reading them from either."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from robid.artifacts.layout import DAMAGE
from robid.artifacts.results import MODEL
from robid.artifacts.store import kind_of, read_artifact
from robid.errors import ArtifactError, DataError
from robid.files import read_regular_text
from robid.models.encode import Content, Files, encode_json, encode_mat, origin_of
from robid.models.family import ExportTask
from robid.models.lpv.fit.model import LpvModel
from robid.models.lpv.fit.solution import BasisTable, LpvSolution
from robid.models.lpv.fit.state_space import MATRICES, StateSpace, block_names, pack
from robid.models.lpv.judge import LpvValidation

FILES = Files("lpv", LpvSolution, LpvValidation)
model_of, solution_from_artifact = FILES.model_of, FILES.solution_of
validation_of, validation_from_artifact = FILES.validation_of, FILES.validated_in

_FORMATS = "robid lpv"
FORMAT = f"{_FORMATS} 1"


def evaluate(path: Path | str) -> LpvModel:
    """Reads a model: of a run folder's `model.h5`, or of an export as JSON or HDF5.

    `evaluate(path).at(points)` gives A(p), B(p), C(p) and D(p) at points (n_point, n_scheduling).

    Raises:
        ArtifactError: If the file is missing, damaged, or holds none.
    """
    path = Path(path)
    if not path.is_file():
        raise _refused(path, "there is no such file")
    content = _json(path) if path.suffix == ".json" else _hdf5(path)
    if content.get("format") == FORMAT:
        return _whole(path, content)
    if str(content.get("format")).startswith(_FORMATS):
        raise _refused(path, f"its format is `{content['format']}`, not `{FORMAT}`")
    model = read_artifact(path, MODEL) if kind_of(path) == MODEL.name else None
    if model is None or model.attributes.get("family") != "lpv":
        raise _refused(path, "it contains no position-dependent model")
    return solution_from_artifact(model).model


def _refused(path: Path, what: str) -> ArtifactError:
    remedy = "name the model.h5 of a fit of family `lpv`, or its `robid export` as json or hdf5"
    return ArtifactError(f"A029 {what}.", where=str(path), remedy=remedy)


def _json(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(read_regular_text(path))
    except (OSError, ValueError) as error:
        raise _refused(path, f"it is no JSON ({error})") from error
    return content if isinstance(content, dict) else {}


def _hdf5(path: Path) -> dict[str, Any]:
    if not (path.is_file() and h5py.is_hdf5(path)):
        return {}
    try:
        with h5py.File(path) as file:
            datasets = {name: one[()] for name, one in file.items() if isinstance(one, h5py.Dataset)}
            return {**datasets, **dict(file.attrs)}
    except DAMAGE as error:
        raise _refused(path, f"it is damaged ({error})") from error


def _whole(path: Path, content: dict[str, Any]) -> LpvModel:
    """The model of an export, whose entries may be missing or of shapes that do not agree."""
    try:
        model = _model(content)
        found = model.at(np.stack([model.basis.lower, model.basis.upper]))
    except KeyError as error:
        raise _refused(path, f"it has no `{error.args[0]}`") from error
    except (TypeError, ValueError, IndexError, DataError) as error:
        raise _refused(path, f"its entries do not make a model ({error})") from error
    finite = all(np.isfinite(matrix).all() for matrix in (*found.matrices, model.parameters))
    if not (finite and np.isfinite(model.sampling_period_s) and model.sampling_period_s > 0):
        raise _refused(path, "its entries do not make a model (one of them is not finite, or no sampling period)")
    return model


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


_EQUATIONS = "x(t+1) = A(p) x + B(p) u, y = C(p) x + D(p) u; A(p) = A_0 + sum_k A_k psi_k(p), B, C and D alike"
_FUNCTIONS = "polynomials: psi = prod_j ((p_j - center_j) / scale_j)^exponent_j; splines: products of B-splines"

_PORTS = ("inputs", "input_units", "outputs", "output_units", "scheduling", "scheduling_units")
_NUMBERS = ("exponents", "center", "scale", "knots", "degree", "lower", "upper")


def _content(task: ExportTask) -> Content:
    """What every format holds; arrays as they are."""
    solution = solution_from_artifact(task.model)
    ports, basis, found = solution.ports, solution.basis, solution.estimate
    return {
        "format": FORMAT,
        **origin_of(task, solution.estimate.status),
        "equations": f"{_EQUATIONS}. {_FUNCTIONS}",
        "sampling_period_s": ports.sampling_period_s,
        **{name: getattr(ports, name) for name in _PORTS},
        "functions": basis.names,
        "basis": basis.kind,
        **{name: getattr(basis, name) for name in _NUMBERS},
        "dropped": block_names(~solution.blocks.kept),
        "positions": solution.own.points,
        "parameter_names": found.names,
        "parameter_units": found.units,
        "parameter_values": found.value,
        "parameter_lower": found.lower,
        "parameter_upper": found.upper,
        "largest_pole": solution.largest_pole,
        **{name: getattr(solution.matrices, name) for name in MATRICES},
    }


def write_json(task: ExportTask) -> bytes:
    """Writes the model as JSON."""
    content = _content(task)
    return encode_json(
        {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in content.items()}
    )


def write_mat(task: ExportTask) -> bytes:
    """Writes the model for MATLAB, its matrices as `A_0` to `D_<n_function>`."""
    content = _content(task)
    blocks = {f"{name}_{function}": block for name in MATRICES for function, block in enumerate(content.pop(name))}
    return encode_mat({**content, **blocks})


def write_hdf5(task: ExportTask) -> bytes:
    """Writes the model as HDF5."""
    file = io.BytesIO()
    with h5py.File(file, "w") as written:
        for name, value in _content(task).items():
            if isinstance(value, np.ndarray):
                written.create_dataset(name, data=value, track_times=False)
            else:
                written.attrs[name] = list(value) if isinstance(value, tuple) else value
    return file.getvalue()
