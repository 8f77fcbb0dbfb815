"""The model artifact: what every fit found; what only its family has lies in the family's own group.

Schema history:
    2.0: parameters in the group `estimate`, their covariance in SI units; the rest in a group of the family's name.
    2.1: elastic fits say in `elastic/effective` what infinitely many places would give.
    2.2: that lies in `estimate/effective_*`; an elastic fit's `lower` and `upper` are those of the physical parameter,
        around `physical_value`, and its named doubts lie in `elastic/doubts`.
    2.3: `grade/scales`, where a grade saw wrong scales.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, TypeAlias

from robid.artifacts.artifact import Artifact, Attribute, Dataset, Kind, Provenance
from robid.artifacts.grade import grade_content
from robid.artifacts.mapping import from_datasets, to_datasets

if TYPE_CHECKING:
    from robid.results.estimate import Estimate
    from robid.results.grade import Grade

MODEL = Kind("model", "2.3", "robid fit")

Parts: TypeAlias = tuple[Mapping[str, Dataset], Mapping[str, Attribute]]


def estimate_content(estimate: Estimate) -> Parts:
    """Takes an estimate apart, as it lies in a model."""
    return to_datasets(estimate, "estimate/")


def estimate_from_artifact(artifact: Artifact) -> Estimate:
    """The inverse of `estimate_content`."""
    from robid.results.estimate import Estimate

    return from_datasets(Estimate, artifact, "estimate/")


def model_to_artifact(
    family: str, estimate: Estimate, grade: Grade, own: Parts, provenance: Provenance | None = None
) -> Artifact:
    """Turns a fit into an artifact.

    Args:
        family: Name of its family.
        estimate: Its parameters.
        grade: What it is worth by itself.
        own: What only its family has, in a group of the family's name.
        provenance: Where it comes from; the stage fills in what is missing.
    """
    parts = [estimate_content(estimate), grade_content(grade), own]
    datasets = {name: dataset for part, _ in parts for name, dataset in part.items()}
    attributes = {name: attribute for _, part in parts for name, attribute in part.items()}
    return Artifact(MODEL, datasets, {"family": family, **attributes}, provenance or Provenance(stage="fit"))
