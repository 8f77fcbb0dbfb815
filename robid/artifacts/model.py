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
from robid.artifacts.mapping import Column, from_datasets, to_datasets

if TYPE_CHECKING:
    from robid.results.estimate import Estimate
    from robid.results.grade import Grade

MODEL = Kind("model", "2.3", "robid fit")

Parts: TypeAlias = tuple[Mapping[str, Dataset], Mapping[str, Attribute]]

_PARAMETER, _TIED = ("parameter",), ("tied",)
_OWN = "as in units"
_ESTIMATE = {
    "estimate/names": Column("1", _PARAMETER),
    "estimate/kinds": Column("1", _PARAMETER),
    "estimate/units": Column("1", _PARAMETER, "Unit of each parameter"),
    "estimate/nominal": Column(_OWN, _PARAMETER, "Value of the robot file"),
    "estimate/value": Column(_OWN, _PARAMETER, "Estimated value"),
    "estimate/lower": Column(_OWN, _PARAMETER, "Lower end of the interval"),
    "estimate/upper": Column(_OWN, _PARAMETER, "Upper end of the interval"),
    "estimate/physical_value": Column(_OWN, _PARAMETER, "Middle of the interval"),
    "estimate/effective_value": Column(_OWN, _PARAMETER, "What infinitely many places would give by this model"),
    "estimate/effective_lower": Column(_OWN, _PARAMETER, "Lower end of its interval"),
    "estimate/effective_upper": Column(_OWN, _PARAMETER, "Upper end of its interval"),
    "estimate/covariance": Column("products of units", ("parameter", "parameter"), "Covariance of the values"),
    "estimate/degrees_of_freedom": Column("1", _PARAMETER, "Of Student's distribution that the intervals follow"),
    "estimate/relative_std": Column("1", _PARAMETER, "Relative standard deviation"),
    "estimate/predicted_relative_std": Column("1", _PARAMETER, "The same, predicted before the fit"),
    "estimate/prior_relative_std": Column("1", _PARAMETER, "What was known beforehand, as predicted_relative_std"),
    "estimate/relative_half_width": Column("1", _PARAMETER, "Half width of the interval over the value"),
    "estimate/identifiable": Column("1", _PARAMETER, "Whether the prediction was small enough"),
    "estimate/undetermined": Column("1", ("combination",), "What the data do not determine"),
    "estimate/tied/names": Column("1", _TIED, "Parameters that follow another one"),
    "estimate/tied/to": Column("1", _TIED, "Name of that one"),
    "estimate/tied/nominal": Column("as of to", _TIED, "Values of the robot file"),
    "estimate/tied/value": Column("as of to", _TIED, "Estimated values"),
    "estimate/tied/lower": Column("as of to", _TIED, "Lower ends of their intervals"),
    "estimate/tied/upper": Column("as of to", _TIED, "Upper ends of their intervals"),
}


def estimate_content(estimate: Estimate) -> Parts:
    """Takes an estimate apart, as it lies in a model."""
    return to_datasets(estimate, _ESTIMATE, "estimate/")


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
