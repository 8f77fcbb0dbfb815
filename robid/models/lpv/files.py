"""How position-dependent models and their validations lie in their files."""

from __future__ import annotations

from robid.artifacts.artifact import Artifact
from robid.artifacts.kinds import from_datasets, to_datasets
from robid.artifacts.results import (
    estimate_from_artifact,
    model_to_artifact,
    outcome_from_artifact,
    validation_to_artifact,
)
from robid.models.lpv.fit.solution import LpvSolution
from robid.models.lpv.judge.validating import LpvValidation
from robid.results.grade import Grade

_NAME = "lpv"


def model_of(solution: LpvSolution, grade: Grade) -> Artifact:
    """Turns a fit's solution and what it is worth by itself into an artifact."""
    own = to_datasets(solution, "lpv/", without=("estimate",))
    return model_to_artifact(_NAME, solution.estimate, grade, own)


def solution_from_artifact(artifact: Artifact) -> LpvSolution:
    """What a fit found, from its model."""
    return from_datasets(LpvSolution, artifact, "lpv/", {"estimate": estimate_from_artifact(artifact)})


def validation_of(validation: LpvValidation) -> Artifact:
    """Turns a validation into an artifact."""
    own = to_datasets(validation, "lpv/", without=("outcome",))
    return validation_to_artifact(_NAME, validation.outcome, own)


def validation_from_artifact(artifact: Artifact) -> LpvValidation:
    """The inverse of `validation_of`."""
    return from_datasets(LpvValidation, artifact, "lpv/", {"outcome": outcome_from_artifact(artifact)})
