"""What an elastic fit leaves of its responses."""

from __future__ import annotations

import numpy as np

from robid.artifacts.artifact import Artifact
from robid.frf.frf import Frf
from robid.models.elastic.files import solution_from_artifact
from robid.models.elastic.fit.solution import ElasticSolution
from robid.results.residual import Residual, whitened_responses


def residual_of(solution: ElasticSolution, responses: Frf | None) -> Residual:
    """Returns measured and modelled responses; whitened where the covariance of the measured ones is known."""
    found = solution.responses
    error, names = found.measured - found.modelled, () if responses is None else responses.input_names
    white = np.full(error.shape, np.nan, complex)
    if responses is not None and responses.response.shape == error.shape and responses.covariance.any():
        white = whitened_responses(error, responses.covariance, responses.input_factor, responses.scale)
        white = white if responses.dropped is None else np.where(responses.dropped[:, :, None], np.nan, white)
    return Residual(
        measured=found.measured,
        model=found.modelled,
        whitened=white,
        axes=("configuration", "frequency", "output", "input"),
        abscissa=found.frequency_hz,
        over="frequency_hz",
        labels=names,
    )


def stored_residual(model: Artifact, responses: Frf | None) -> Residual:
    """Returns the same from the file of a fit."""
    return residual_of(solution_from_artifact(model), responses)
