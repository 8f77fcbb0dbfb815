"""Writing a position-dependent model in each of its formats."""

from __future__ import annotations

import io

import h5py
import numpy as np

import robid
from robid.models.encode import Content, encode_json, encode_mat
from robid.models.family import ExportTask
from robid.models.lpv.files import solution_from_artifact
from robid.models.lpv.fit.blocks import block_names
from robid.models.lpv.fit.solution import LpvSolution
from robid.models.lpv.fit.state_space import MATRICES
from robid.models.lpv.reading import FORMAT

_EQUATIONS = "x(t+1) = A(p) x + B(p) u, y = C(p) x + D(p) u; A(p) = A_0 + sum_k A_k psi_k(p), B, C and D alike"
_FUNCTIONS = "polynomials: psi = prod_j ((p_j - center_j) / scale_j)^exponent_j; splines: products of B-splines"


def _content(task: ExportTask) -> Content:
    """What every format holds; arrays as they are."""
    solution, loaded = solution_from_artifact(task.model), task.data.loaded
    ports, basis = solution.ports, solution.basis
    return {
        "format": FORMAT,
        "robot": loaded.robot.name,
        "experiment": loaded.experiment.name,
        "fit": task.data.name,
        "fitted_utc": task.model.provenance.finished_utc,
        "status": solution.estimate.status,
        "robid_version": robid.__version__,
        "equations": f"{_EQUATIONS}. {_FUNCTIONS}",
        "sampling_period_s": ports.sampling_period_s,
        "inputs": ports.inputs,
        "input_units": ports.input_units,
        "outputs": ports.outputs,
        "output_units": ports.output_units,
        "scheduling": ports.scheduling,
        "scheduling_units": ports.scheduling_units,
        "functions": basis.names,
        "basis": basis.kind,
        "exponents": basis.exponents,
        "center": basis.center,
        "scale": basis.scale,
        "knots": basis.knots,
        "degree": basis.degree,
        "lower": basis.lower,
        "upper": basis.upper,
        "dropped": block_names(~solution.blocks.kept),
        **_poles(solution),
        **{name: getattr(solution.matrices, name) for name in MATRICES},
    }


def _poles(solution: LpvSolution) -> Content:
    found = solution.estimate
    return {
        "positions": solution.own.points,
        "parameter_names": found.names,
        "parameter_units": found.units,
        "parameter_values": found.value,
        "parameter_lower": found.lower,
        "parameter_upper": found.upper,
        "largest_pole": solution.largest_pole,
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
