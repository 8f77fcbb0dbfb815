"""How transfer functions and their validations lie in their files."""

from __future__ import annotations

from robid.artifacts.artifact import Artifact
from robid.artifacts.kinds import from_datasets, to_datasets
from robid.artifacts.results import (
    estimate_from_artifact,
    model_to_artifact,
    outcome_from_artifact,
    validation_to_artifact,
)
from robid.models.external.fit.solution import ExternalSolution
from robid.models.external.judge.validating import ExternalValidation
from robid.results.grade import Grade

_NAME = "external"


def model_of(solution: ExternalSolution, grade: Grade) -> Artifact:
    """Turns a fit's solution and what it is worth by itself into an artifact."""
    own = to_datasets(solution, "external/", without=("estimate",))
    return model_to_artifact(_NAME, solution.estimate, grade, own)


def solution_from_artifact(artifact: Artifact) -> ExternalSolution:
    """What a fit found, from its model."""
    return from_datasets(ExternalSolution, artifact, "external/", {"estimate": estimate_from_artifact(artifact)})


def validation_of(validation: ExternalValidation) -> Artifact:
    """Turns a validation into an artifact."""
    own = to_datasets(validation, "external/", without=("outcome",))
    return validation_to_artifact(_NAME, validation.outcome, own)


def validation_from_artifact(artifact: Artifact) -> ExternalValidation:
    """The inverse of `validation_of`."""
    return from_datasets(ExternalValidation, artifact, "external/", {"outcome": outcome_from_artifact(artifact)})
