"""Writing an elastic model in each of its formats."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from robid.errors import SettingsError
from robid.models.elastic.files import solution_from_artifact
from robid.models.elastic.fitting import nominal_robot
from robid.models.elastic.mechanics import FittedExport, arrays, mjcf, parameter_records, state_spaces
from robid.models.encode import PARAMETER_COLUMNS, Content, encode_csv, encode_json, encode_mat, encode_npz
from robid.models.family import ExportTask

_ENCODERS: Mapping[str, Callable[[Content], bytes]] = {".mat": encode_mat, ".json": encode_json, ".npz": encode_npz}


def _found(task: ExportTask) -> FittedExport:
    date, solution = task.model.provenance.finished_utc, solution_from_artifact(task.model)
    data = task.data
    return FittedExport(data.loaded, data.name, nominal_robot(data), date, solution, data.response, data.configurations)


def _rows(task: ExportTask) -> list[int]:
    chosen = task.data.configurations
    if task.configuration is None:
        return list(range(len(chosen)))
    if task.configuration not in chosen:
        listed = ", ".join(map(str, chosen))
        message = f"S060 fit `{task.data.name}` has no configuration {task.configuration} (it has {listed})"
        raise SettingsError(message, where="--configuration", remedy="name one of them, or none for all")
    return [chosen.index(task.configuration)]


def write_mjcf(task: ExportTask) -> bytes:
    """Writes the elastic robot as MJCF."""
    return mjcf(_found(task), _rows(task), friction=task.friction is not False).encode()


def write_json(task: ExportTask) -> bytes:
    """Writes the parameters as JSON."""
    found = _found(task)
    content = {**found.origin, "confidence": found.solution.estimate.confidence, "parameters": parameter_records(found)}
    return encode_json(content)


def write_csv(task: ExportTask) -> bytes:
    """Writes the parameters as a table."""
    return encode_csv(PARAMETER_COLUMNS, [list(record.values()) for record in parameter_records(_found(task))])


def write_mat(task: ExportTask) -> bytes:
    """Writes parameters and responses for MATLAB."""
    return encode_mat(arrays(_found(task), _rows(task)))


def write_state_space(task: ExportTask) -> bytes:
    """Writes the linearised models."""
    return _ENCODERS[task.suffix](state_spaces(_found(task), _rows(task)))
