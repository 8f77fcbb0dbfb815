"""What the external family does with campaigns of responses alone: settings and artifacts in, artifacts out."""

from __future__ import annotations

import numpy as np

from robid.artifacts.artifact import Artifact
from robid.artifacts.results import grade_from_artifact
from robid.models.external.of_responses.files import (
    model_of,
    solution_from_artifact,
    validation_from_artifact,
    validation_of,
)
from robid.models.external.of_responses.fitting import fit_rational
from robid.models.external.of_responses.judging import assess_rational, validate_rational
from robid.models.external.settings import external_fit
from robid.models.family import Data, Work
from robid.simulate.truth import TrueRobot


def fit(data: Data, work: Work) -> Artifact:
    """Fits transfer functions to a response and grades them by themselves."""
    options = external_fit(data.loaded.experiment, data.name).options()
    work.progress.expect(1, "fits")
    solution = fit_rational(data.response, options)
    work.progress.advance()
    return model_of(solution, assess_rational(solution, options))


def validate(data: Data, model: Artifact, _true: TrueRobot | None = None) -> Artifact:
    """Holds transfer functions against a response that they never saw."""
    findings = grade_from_artifact(model).findings
    return validation_of(validate_rational(solution_from_artifact(model), data.response, findings))


def misfits(model: Artifact, validation: Artifact | None) -> dict[str, float]:
    """Relative errors of the worst channel, of the fit and of its validation."""
    found = {"relative error": float(np.nanmax(solution_from_artifact(model).quality.relative_error))}
    if validation is not None:
        worst = float(np.nanmax(validation_from_artifact(validation).relative_error))
        found["relative error of the validation"] = worst
    return found


def phrase_of_model(model: Artifact) -> str:
    """Says how the fit ended, in a phrase, from its artifact."""
    solution = solution_from_artifact(model)
    own, quality = solution.transfers, solution.quality
    parts = [
        f"{name} {own.poles[own.block_of[channel]]} poles {own.zeros[channel]} zeros"
        for channel, name in enumerate(own.names[:6])
    ]
    more = f" and {len(own.names) - len(parts)} more" if len(own.names) > len(parts) else ""
    return (
        f"{solution.estimate.status}, {', '.join(parts)}{more}, off by {np.nanmax(quality.relative_error):.2%} or less"
    )
