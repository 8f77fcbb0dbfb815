"""Content of exported files: where it comes from, and as bytes that depend on nothing but the content."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

import robid
from robid.arrays import FloatArray
from robid.artifacts.atomic import plain

if TYPE_CHECKING:
    from robid.models.family import ExportTask

Content: TypeAlias = dict[str, Any]

PARAMETER_COLUMNS = (
    *("name", "kind", "unit", "nominal", "estimate"),
    *("effective_value", "effective_lower", "effective_upper"),
    *("physical_value", "physical_lower", "physical_upper", "physical_relative_std"),
    "identifiable",
)
"""Columns of parameters that have two intervals, each beside the value that it is of."""
_MAT_TITLE = 116


def origin_of(task: ExportTask, status: str) -> dict[str, str]:
    """Returns where an exported model comes from, and how its fit ended."""
    loaded = task.data.loaded
    return {
        "robot": loaded.robot.name,
        "experiment": loaded.experiment.name,
        "fit": task.data.name,
        "fitted_utc": task.model.provenance.finished_utc,
        "status": status,
        "robid_version": robid.__version__,
    }


def encode_json(content: Content) -> bytes:
    """Writes JSON; complex numbers are refused, numbers that are not finite become null."""
    return (json.dumps(plain(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n").encode()


def encode_csv(columns: Sequence[str], rows: Sequence[Sequence[object]]) -> bytes:
    """Writes a table with its column names, numbers with all their digits."""
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerows([columns, *rows])
    return text.getvalue().encode()


def encode_table(notes: Sequence[str], columns: Sequence[str], rows: FloatArray, *, digits: int = 9) -> bytes:
    """Writes a table of numbers below lines of notes that begin with `#`; nine digits keep every float32, 17 all."""
    text = io.StringIO(newline="")
    text.writelines(f"# {note}\n" for note in notes)
    np.savetxt(text, rows, fmt=f"%.{digits}g", delimiter=",", header=",".join(columns), comments="")
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
