"""Writing a rigid model in each of its formats."""

from __future__ import annotations

import robid
from robid.models.encode import Content, encode_csv, encode_json, encode_mat
from robid.models.family import ExportTask
from robid.models.rigid.files import solution_from_artifact
from robid.models.rigid.fit.solution import RigidSolution

_COLUMNS = ("name", "kind", "unit", "nominal", "estimate", "lower", "upper", "relative_std", "identifiable")


def _origin(task: ExportTask, solution: RigidSolution) -> dict[str, str]:
    loaded = task.data.loaded
    return {
        "robot": loaded.robot.name,
        "experiment": loaded.experiment.name,
        "fit": task.data.name,
        "fitted_utc": task.model.provenance.finished_utc,
        "status": solution.estimate.status,
        "robid_version": robid.__version__,
    }


def _records(solution: RigidSolution) -> list[dict[str, object]]:
    found = solution.estimate
    values = (found.nominal, found.value, found.lower, found.upper, found.relative_std, found.identifiable)
    columns = (found.names, found.kinds, found.units, *(each.tolist() for each in values))
    rows = [dict(zip(_COLUMNS, row, strict=True)) for row in zip(*columns, strict=True)]
    return [{**row, "combination": label} for row, label in zip(rows, solution.base.labels, strict=True)]


def _standard(solution: RigidSolution) -> dict[str, dict[str, float]]:
    found = solution.standard
    if found is None:
        return {}
    rows = zip(found.names, found.nominal.tolist(), found.value.tolist(), strict=True)
    return {name: {"nominal": nominal, "value": value} for name, nominal, value in rows}


def write_json(task: ExportTask) -> bytes:
    """Writes the parameters as JSON."""
    solution = solution_from_artifact(task.model)
    content: Content = {**_origin(task, solution), "confidence": solution.estimate.confidence}
    return encode_json({**content, "parameters": _records(solution), "standard": _standard(solution)})


def write_csv(task: ExportTask) -> bytes:
    """Writes the parameters as a table."""
    rows = _records(solution_from_artifact(task.model))
    return encode_csv((*_COLUMNS, "combination"), [list(row.values()) for row in rows])


def write_mat(task: ExportTask) -> bytes:
    """Writes parameters and covariance for MATLAB."""
    solution = solution_from_artifact(task.model)
    found, standard = solution.estimate, solution.standard
    content: Content = {
        **_origin(task, solution),
        "names": found.names,
        "kinds": found.kinds,
        "units": found.units,
        "labels": solution.base.labels,
        "nominal": found.nominal,
        "estimate": found.value,
        "lower": found.lower,
        "upper": found.upper,
        "covariance": found.covariance,
        "standard_names": solution.base.standard,
        "combination": solution.base.combination,
    }
    if standard is not None:
        content |= {"standard": standard.value, "standard_covariance": standard.covariance}
    return encode_mat(content)
