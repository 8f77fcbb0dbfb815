"""How models lie in files: in those of a run, and as content of exported ones, in bytes that depend on nothing else."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeAlias, TypeVar

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.artifact import Artifact
from robid.artifacts.atomic import plain
from robid.artifacts.kinds import from_datasets, to_datasets
from robid.artifacts.results import (
    estimate_from_artifact,
    model_to_artifact,
    outcome_from_artifact,
    validation_to_artifact,
)
from robid.versions import __version__

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    from robid.models.family import ExportTask
    from robid.results.estimate import Estimate
    from robid.results.grade import Grade
    from robid.results.outcome import Outcome

    class AnySolution(DataclassInstance, Protocol):
        """What a fit found: an estimate, and what only its family has."""

        @property
        def estimate(self) -> Estimate:
            """Its parameters."""

    class AnyValidation(DataclassInstance, Protocol):
        """What a validation found: an outcome, and what only its family has."""

        @property
        def outcome(self) -> Outcome:
            """What every family says."""


SolutionType = TypeVar("SolutionType", bound="AnySolution")
ValidationType = TypeVar("ValidationType", bound="AnyValidation")


@dataclass(frozen=True)
class Files(Generic[SolutionType, ValidationType]):
    """How the models of a family and their validations lie in their files: what is its own in a group of its name."""

    family: str
    solution: type[SolutionType]
    validation: type[ValidationType]

    def model_of(self, solution: SolutionType, grade: Grade) -> Artifact:
        """Turns a fit's solution and what it is worth by itself into an artifact."""
        own = to_datasets(solution, f"{self.family}/", without=("estimate",))
        return model_to_artifact(self.family, solution.estimate, grade, own)

    def solution_of(self, model: Artifact) -> SolutionType:
        """What a fit found, from its model."""
        return from_datasets(self.solution, model, f"{self.family}/", {"estimate": estimate_from_artifact(model)})

    def validation_of(self, validation: ValidationType) -> Artifact:
        """Turns a validation into an artifact."""
        own = to_datasets(validation, f"{self.family}/", without=("outcome",))
        return validation_to_artifact(self.family, validation.outcome, own)

    def validated_in(self, validation: Artifact) -> ValidationType:
        """The inverse of `validation_of`."""
        given = {"outcome": outcome_from_artifact(validation)}
        return from_datasets(self.validation, validation, f"{self.family}/", given)


Content: TypeAlias = dict[str, Any]

PARAMETER_COLUMNS = (
    *("name", "kind", "unit", "nominal", "estimate"),
    *("effective_value", "effective_lower", "effective_upper"),
    *("physical_value", "physical_lower", "physical_upper", "physical_relative_std"),
    "identifiable",
)
"""Columns of parameters that have two intervals, each beside the value that it is of."""
_MAT_TITLE = 116
_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")


def origin_of(task: ExportTask, status: str) -> dict[str, str]:
    """Returns where an exported model comes from, and how its fit ended."""
    loaded = task.data.loaded
    return {
        "robot": loaded.robot.name,
        "experiment": loaded.experiment.name,
        "fit": task.data.name,
        "fitted_utc": task.model.provenance.finished_utc,
        "status": status,
        "robid_version": __version__,
    }


def parameter_records(found: Estimate, columns: Sequence[str]) -> list[dict[str, object]]:
    """Returns the chosen columns of every parameter, by name."""
    every = {"name": found.names, "kind": found.kinds, "unit": found.units} | {
        "nominal": found.nominal.tolist(),
        "estimate": found.value.tolist(),
        "lower": found.lower.tolist(),
        "upper": found.upper.tolist(),
        "relative_std": found.relative_std.tolist(),
        "identifiable": found.identifiable.tolist(),
    }
    return [dict(zip(columns, row, strict=True)) for row in zip(*(every[name] for name in columns), strict=True)]


def parameter_arrays(found: Estimate) -> Content:
    """Returns parameters, their intervals and their covariance as arrays, for formats that hold such."""
    return {
        "names": found.names,
        "kinds": found.kinds,
        "units": found.units,
        "estimate": found.value,
        "lower": found.lower,
        "upper": found.upper,
        "covariance": found.covariance,
    }


def encode_json(content: Content) -> bytes:
    """Writes JSON; complex numbers are refused, numbers that are not finite become null."""
    return (json.dumps(plain(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n").encode()


def encode_csv(columns: Sequence[str], rows: Sequence[Sequence[object]]) -> bytes:
    """Writes a table with its column names, numbers with all their digits; no text is taken for a formula."""
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerows([as_text(cell) for cell in row] for row in (columns, *rows))
    return text.getvalue().encode()


def as_text(cell: object) -> object:
    """Puts an apostrophe before a text that a spreadsheet would run as a formula; numbers stay what they are."""
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(_FORMULA) else cell


def encode_table(notes: Sequence[str], columns: Sequence[str], rows: FloatArray, *, digits: int = 9) -> bytes:
    """Writes a table of numbers below lines of notes that begin with `#`; nine digits keep every float32, 17 all."""
    text = io.StringIO(newline="")
    text.writelines(f"# {note}\n" for note in notes)
    csv.writer(text, lineterminator="\n").writerow(map(as_text, columns))
    np.savetxt(text, rows, fmt=f"%.{digits}g", delimiter=",")
    return text.getvalue().encode()


def encode_mat(content: Content) -> bytes:
    """Writes a MAT file of version 5; tuples and lists of text become cell columns."""
    from scipy.io import savemat

    cells = {name: _cell(value) if isinstance(value, tuple | list) else value for name, value in content.items()}
    file = io.BytesIO()
    savemat(file, cells, oned_as="column")
    # The title would hold the time and the platform.
    title = "MATLAB 5.0 MAT-file, written by robid".ljust(_MAT_TITLE).encode()
    return title + file.getvalue()[_MAT_TITLE:]


def encode_npz(content: Content) -> bytes:
    """Writes a NumPy archive without pickles."""
    file = io.BytesIO()
    arrays: dict[str, Any] = {name: np.asarray(value) for name, value in content.items()}
    np.savez(file, **arrays)
    return file.getvalue()


def _cell(texts: Sequence[str]) -> np.ndarray[Any, Any]:
    cells = np.empty((len(texts), 1), object)
    cells[:, 0] = texts
    return cells
