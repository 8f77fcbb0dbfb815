"""How a grade lies in the artifacts that hold one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from robid.artifacts.artifact import Artifact, Attribute, Dataset
from robid.artifacts.mapping import from_datasets, to_datasets

if TYPE_CHECKING:
    from robid.results.grade import Grade

_DOUBT = ("doubt",)
_SCALES = "grade/scales"
_SCALED = "Which wrong scales explain each, those that give the same data behind each other"


def grade_content(grade: Grade) -> tuple[dict[str, Dataset], dict[str, Attribute]]:
    """Takes a grade apart."""
    datasets, attributes = to_datasets(grade, "grade/", without=("scales",))
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
