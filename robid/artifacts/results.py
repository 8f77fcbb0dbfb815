"""The artifacts of a fit and of a validation: what every family says; what only one has lies in a group of its name.

Schema history:
    model:
        2.0: parameters in the group `estimate`, their covariance in SI units; the rest in a group of the family's name.
        2.1: elastic fits say in `elastic/effective` what infinitely many places would give.
        2.2: that lies in `estimate/effective_*`; an elastic fit's `lower` and `upper` are those of the physical
            parameter, around `physical_value`, and its named nuisances lie in `elastic/doubts`.
        2.3: `grade/scales`, where a grade saw wrong scales.
        2.4: external fits say in `external/between_std` how much parameters differ between recordings.
        2.5: elastic fits say in `elastic/gears` what gears alone may be.
        2.6: elastic fits say in `elastic/doubts/moves` what nuisances move the middles of intervals by, and in
            `elastic/detectable` how large a defect their residual would have shown.
        2.7: rigid fits say in `rigid/residuals/shot` which record each row is of.
        2.8: external fits of responses have `external/transfers`, `external/quality` and `external/shown` of their own.
    validation:
        3.4: external validations on responses have `external/shown`, `external/relative_error` and `external/expected`.
        3.3: rigid validations say in `rigid/prediction/shot` which record each row is of.
        3.2: `grade/scales`, where a grade saw wrong scales.
        3.1: elastic validations hold the resonances of their data in `elastic/new_resonances`.
        3.0: what every family says in the groups `outcome` and `grade`, the rest in a group of the family's name.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TypeAlias

import numpy as np

from robid.artifacts.artifact import Artifact, Attribute, Dataset, Kind, Provenance
from robid.artifacts.kinds import from_datasets, to_datasets
from robid.artifacts.store import read_group
from robid.later import imported, later

with later(__name__):
    from robid.results.estimate import Estimate
    from robid.results.grade import Grade
    from robid.results.outcome import Outcome
    from robid.results.scale import read_scale

MODEL = Kind("model", "2.8", "robid fit")
VALIDATION = Kind("validation", "3.4", "robid validate")
START = Kind("start", "1.0", "robid fit")

Parts: TypeAlias = tuple[Mapping[str, Dataset], Mapping[str, Attribute]]

_SCALES = "grade/scales"
_SCALED = "Which wrong scales explain each, those that give the same data behind each other"


def estimate_content(estimate: Estimate) -> Parts:
    """Takes an estimate apart, as it lies in a model."""
    return to_datasets(estimate, "estimate/")


def estimate_from_artifact(artifact: Artifact) -> Estimate:
    """The inverse of `estimate_content`."""
    return from_datasets(imported(Estimate), artifact, "estimate/")


def model_to_artifact(
    family: str, estimate: Estimate, grade: Grade, own: Parts, provenance: Provenance | None = None
) -> Artifact:
    """Turns a fit into an artifact; what only its family has lies in a group of the family's name.

    The stage fills in what provenance lacks.
    """
    parts = estimate_content(estimate), grade_content(grade), own
    return Artifact(MODEL, *_joined(family, parts), provenance or Provenance(stage="fit"))


def validation_to_artifact(family: str, outcome: Outcome, own: Parts, provenance: Provenance | None = None) -> Artifact:
    """Turns a validation into an artifact; what only its family has lies in a group of the family's name.

    The stage fills in what provenance lacks.
    """
    parts = to_datasets(outcome, "outcome/", without=("grade",)), grade_content(outcome.grade), own
    return Artifact(VALIDATION, *_joined(family, parts), provenance or Provenance(stage="validate"))


def outcome_from_artifact(artifact: Artifact) -> Outcome:
    """What every family says of a validated model."""
    return from_datasets(imported(Outcome), artifact, "outcome/", {"grade": grade_from_artifact(artifact)})


def grade_content(grade: Grade) -> Parts:
    """Takes a grade apart."""
    datasets, attributes = to_datasets(grade, "grade/", without=("scales",))
    if any(grade.scales):
        told = ["; ".join(str(scale) for scale in scales) for scales in grade.scales]
        datasets[_SCALES] = Dataset(np.array(told, dtype=str), "1", ("doubt",), _SCALED)
    return datasets, attributes


def grade_from_artifact(artifact: Artifact) -> Grade:
    """The grade that a model or a validation holds."""
    told = artifact.datasets[_SCALES].values.tolist() if _SCALES in artifact.datasets else []
    scales = tuple(tuple(read_scale(one) for one in text.split("; ") if one) for text in told)
    return from_datasets(imported(Grade), artifact, "grade/", {"scales": scales})


def read_grade(path: Path, kind: Kind) -> Grade:
    """Reads the grade in a file of a model or a validation, and nothing else; see `read_artifact` for errors."""
    return grade_from_artifact(read_group(path, kind, "grade"))


def _joined(family: str, parts: Iterable[Parts]) -> Parts:
    datasets: dict[str, Dataset] = {}
    attributes: dict[str, Attribute] = {"family": family}
    for part in parts:
        datasets, attributes = {**datasets, **part[0]}, {**attributes, **part[1]}
    return datasets, attributes
