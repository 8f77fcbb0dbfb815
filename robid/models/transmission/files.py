"""How fits of gears lie in their files, and what they are written as."""

from __future__ import annotations

import numpy as np

from robid.models.encode import (
    Content,
    Files,
    encode_csv,
    encode_json,
    encode_mat,
    origin_of,
    parameter_arrays,
    parameter_records,
)
from robid.models.family import ExportTask
from robid.models.transmission.fit.solution import TransmissionSolution
from robid.models.transmission.judge.validating import TransmissionValidation

FILES = Files("transmission", TransmissionSolution, TransmissionValidation)
model_of, solution_from_artifact = FILES.model_of, FILES.solution_of
validation_of, validation_from_artifact = FILES.validation_of, FILES.validated_in

_COLUMNS = ("name", "kind", "unit", "nominal", "estimate", "lower", "upper", "relative_std", "identifiable")


def write_json(task: ExportTask) -> bytes:
    """Writes parameters, sums and loops as JSON."""
    solution = solution_from_artifact(task.model)
    content: Content = {**origin_of(task, solution.estimate.status), "confidence": solution.estimate.confidence}
    gears = {joint: _gear(solution, index) for index, joint in enumerate(solution.joints)}
    return encode_json({**content, "parameters": parameter_records(solution.estimate, _COLUMNS), "gears": gears})


def _gear(solution: TransmissionSolution, gear: int) -> Content:
    """What is determined of one gear, and its loop."""
    names = ("rated", "reached", "lag_s", "lag_std_s", "damping_s", "damping_std_s", "loop", "loop_std", "agreement")
    found: Content = {name: float(getattr(solution, name)[gear]) for name in names}
    found["stiffness_by_motion"] = dict(zip(solution.motions, solution.by_motion[gear].tolist(), strict=True))
    found["loop_torque"] = solution.loops.torque[:, gear].tolist()
    found["loop_deflection"] = solution.loops.deflection[:, gear].tolist()
    return found


def write_csv(task: ExportTask) -> bytes:
    """Writes the parameters as a table."""
    rows = parameter_records(solution_from_artifact(task.model).estimate, _COLUMNS)
    return encode_csv(_COLUMNS, [list(row.values()) for row in rows])


def write_mat(task: ExportTask) -> bytes:
    """Writes parameters, covariance and loops for MATLAB."""
    solution = solution_from_artifact(task.model)
    content: Content = {
        **origin_of(task, solution.estimate.status),
        **parameter_arrays(solution.estimate),
        "nominal": solution.estimate.nominal,
        "joints": solution.joints,
        "motions": solution.motions,
        "stiffness_by_motion": np.asarray(solution.by_motion),
        "loop_torque": solution.loops.torque,
        "loop_deflection": solution.loops.deflection,
    }
    return encode_mat(content)
