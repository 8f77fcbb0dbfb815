"""How rigid models and their validations lie in their files."""

from __future__ import annotations

from robid.artifacts.artifact import Artifact
from robid.artifacts.kinds import from_datasets, to_datasets
from robid.artifacts.results import (
    estimate_from_artifact,
    model_to_artifact,
    outcome_from_artifact,
    validation_to_artifact,
)
from robid.models.rigid.fit.solution import RigidSolution
from robid.models.rigid.judge.validating import RigidValidation
from robid.results.grade import Grade

_NAME = "rigid"


def model_of(solution: RigidSolution, grade: Grade) -> Artifact:
    """Turns a fit's solution and what it is worth by itself into an artifact."""
    own = to_datasets(solution, "rigid/", without=("estimate",))
    return model_to_artifact(_NAME, solution.estimate, grade, own)


def solution_from_artifact(artifact: Artifact) -> RigidSolution:
    """What a fit found, from its model."""
    return from_datasets(RigidSolution, artifact, "rigid/", {"estimate": estimate_from_artifact(artifact)})


def validation_of(validation: RigidValidation) -> Artifact:
    """Turns a validation into an artifact."""
    own = to_datasets(validation, "rigid/", without=("outcome",))
    return validation_to_artifact(_NAME, validation.outcome, own)


def validation_from_artifact(artifact: Artifact) -> RigidValidation:
    """The inverse of `validation_of`."""
    return from_datasets(RigidValidation, artifact, "rigid/", {"outcome": outcome_from_artifact(artifact)})
