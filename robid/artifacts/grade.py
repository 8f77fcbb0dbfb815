"""How a grade lies in the artifacts that hold one."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from robid.artifacts.artifact import Artifact, Attribute, Dataset, Kind
from robid.artifacts.mapping import Column, from_datasets, to_datasets
from robid.artifacts.store import read_group

if TYPE_CHECKING:
    from robid.results.grade import Grade

_DOUBT = ("doubt",)
_COLUMNS = {
    "grade/reasons": Column("1", ("reason",), "What keeps it from a better grade"),
    "grade/causes": Column("1", _DOUBT, "Likely causes, the first to blame first"),
    "grade/messages": Column("1", _DOUBT, "What was seen of each"),
    "grade/decisive": Column("1", _DOUBT, "Whether nothing that follows from the data may be used while it stands"),
    "grade/strength": Column("1", _DOUBT, "How far each is beyond what is normal"),
}


_SCALES = "grade/scales"
_SCALED = "Which wrong scales explain each, those that give the same data behind each other"


def grade_content(grade: Grade) -> tuple[dict[str, Dataset], dict[str, Attribute]]:
    """Takes a grade apart."""
    datasets, attributes = to_datasets(grade, _COLUMNS, "grade/", without=("scales",))
    if any(grade.scales):
        told = ["; ".join(str(scale) for scale in scales) for scales in grade.scales]
        datasets[_SCALES] = Dataset(np.array(told, dtype=str), "1", _DOUBT, _SCALED)
    return datasets, attributes


def grade_from_artifact(artifact: Artifact) -> Grade:
    """The grade that a model or a validation holds."""
    from robid.results.grade import Grade
    from robid.results.scale import read_scale

    told = artifact.datasets[_SCALES].values.tolist() if _SCALES in artifact.datasets else []
    scales = tuple(tuple(read_scale(one) for one in text.split("; ") if one) for text in told)
    return from_datasets(Grade, artifact, "grade/", {"scales": scales})


def read_grade(path: Path, kind: Kind) -> Grade:
    """Reads the grade in a file of a model or a validation, and nothing else; see `read_artifact` for errors."""
    return grade_from_artifact(read_group(path, kind, "grade"))
