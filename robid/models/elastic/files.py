"""How elastic models and their validations lie in their files."""

from __future__ import annotations

from robid.artifacts.artifact import Artifact
from robid.artifacts.kinds import from_datasets, to_datasets
from robid.artifacts.results import (
    Parts,
    estimate_content,
    estimate_from_artifact,
    model_to_artifact,
    outcome_from_artifact,
    validation_to_artifact,
)
from robid.models.elastic.fit.solution import ElasticSolution
from robid.models.elastic.judge.resonances import ResonanceTable
from robid.models.elastic.judge.validating import Validation
from robid.results.grade import Grade

_NAME = "elastic"


def solution_content(solution: ElasticSolution) -> Parts:
    """Takes what a fit found apart: the parameters and what only elastic fits have."""
    estimate, own = estimate_content(solution.estimate), _own(solution)
    return {**estimate[0], **own[0]}, {**estimate[1], **own[1]}


def solution_from_artifact(artifact: Artifact) -> ElasticSolution:
    """The inverse of `solution_content`, from an artifact that holds it."""
    return from_datasets(ElasticSolution, artifact, "elastic/", {"estimate": estimate_from_artifact(artifact)})


def model_of(solution: ElasticSolution, grade: Grade, resonances: ResonanceTable) -> Artifact:
    """Turns a fit's solution, what it is worth by itself, and its resonances into an artifact."""
    datasets, attributes = _own(solution)
    table = to_datasets(resonances, "elastic/resonances/")[0]
    return model_to_artifact(_NAME, solution.estimate, grade, ({**datasets, **table}, attributes))


def resonances_from_artifact(artifact: Artifact) -> ResonanceTable:
    """Resonances of the fit's own data."""
    return from_datasets(ResonanceTable, artifact, "elastic/resonances/")


def validation_of(validation: Validation, resonances: ResonanceTable) -> Artifact:
    """Turns a validation and the resonances of its data into an artifact."""
    datasets, attributes = to_datasets(validation, "elastic/", without=("outcome",))
    table = to_datasets(resonances, "elastic/new_resonances/")[0]
    return validation_to_artifact(_NAME, validation.outcome, ({**datasets, **table}, attributes))


def new_resonances_from_artifact(artifact: Artifact) -> ResonanceTable | None:
    """Resonances of a validation's data; None in validations of old."""
    if "elastic/new_resonances/measured_hz" not in artifact.datasets:
        return None
    return from_datasets(ResonanceTable, artifact, "elastic/new_resonances/")


def validation_from_artifact(artifact: Artifact) -> Validation:
    """The inverse of `validation_of`."""
    return from_datasets(Validation, artifact, "elastic/", {"outcome": outcome_from_artifact(artifact)})


def _own(solution: ElasticSolution) -> Parts:
    return to_datasets(solution, "elastic/", without=("estimate",))
