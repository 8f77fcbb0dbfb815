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
from robid.artifacts.mapping import from_datasets, to_datasets
from robid.artifacts.model import Parts

if TYPE_CHECKING:
    from robid.results.outcome import Outcome

VALIDATION = Kind("validation", "3.2", "robid validate")


def validation_to_artifact(family: str, outcome: Outcome, own: Parts, provenance: Provenance | None = None) -> Artifact:
    """Turns a validation into an artifact.

    Args:
        family: Name of the model's family.
        outcome: What every family says.
        own: What only this one has, in a group of the family's name.
        provenance: Where it comes from; the stage fills in what is missing.
    """
    parts = [to_datasets(outcome, "outcome/", without=("grade",)), grade_content(outcome.grade), own]
    datasets = {name: dataset for part, _ in parts for name, dataset in part.items()}
    attributes = {name: attribute for _, part in parts for name, attribute in part.items()}
    return Artifact(VALIDATION, datasets, {"family": family, **attributes}, provenance or Provenance(stage="validate"))


def outcome_from_artifact(artifact: Artifact) -> Outcome:
    """What every family says of a validated model."""
    from robid.results.outcome import Outcome

    return from_datasets(Outcome, artifact, "outcome/", {"grade": grade_from_artifact(artifact)})
