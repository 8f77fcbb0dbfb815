"""The validation artifact: a model on data that its fit never saw; what only its family has lies in its own group.

Schema history:
    3.2: `grade/scales`, where a grade saw wrong scales.
    3.1: elastic validations hold the resonances of their data in `elastic/new_resonances`.
    3.0: what every family says in the groups `outcome` and `grade`, the rest in a group of the family's name.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from robid.artifacts.artifact import Artifact, Kind, Provenance
from robid.artifacts.grade import grade_content, grade_from_artifact
from robid.artifacts.mapping import Column, from_datasets, to_datasets
from robid.artifacts.model import Parts

if TYPE_CHECKING:
    from robid.results.outcome import Outcome

VALIDATION = Kind("validation", "3.2", "robid validate")

_KNOWN = ("known",)
_OUTCOME = {
    "outcome/recovery/names": Column("1", _KNOWN, "Parameters with a known truth"),
    "outcome/recovery/kinds": Column("1", _KNOWN),
    "outcome/recovery/truth": Column("as in the model", _KNOWN, "True values"),
    "outcome/recovery/relative_error": Column("1", _KNOWN, "Error over the true value; the error itself for friction"),
    "outcome/recovery/covered": Column("1", _KNOWN, "Whether the interval holds the truth"),
    "outcome/recovery/identifiable": Column("1", _KNOWN, "Whether the parameter counts as identifiable"),
}


def validation_to_artifact(family: str, outcome: Outcome, own: Parts, provenance: Provenance | None = None) -> Artifact:
    """Turns a validation into an artifact.

    Args:
        family: Name of the model's family.
        outcome: What every family says.
        own: What only this one has, in a group of the family's name.
        provenance: Where it comes from; the stage fills in what is missing.
    """
    parts = [to_datasets(outcome, _OUTCOME, "outcome/", without=("grade",)), grade_content(outcome.grade), own]
    datasets = {name: dataset for part, _ in parts for name, dataset in part.items()}
    attributes = {name: attribute for _, part in parts for name, attribute in part.items()}
    return Artifact(VALIDATION, datasets, {"family": family, **attributes}, provenance or Provenance(stage="validate"))


def outcome_from_artifact(artifact: Artifact) -> Outcome:
    """What every family says of a validated model."""
    from robid.results.outcome import Outcome

    return from_datasets(Outcome, artifact, "outcome/", {"grade": grade_from_artifact(artifact)})
