"""What a fit of gears leaves of the encoders' differences."""

from __future__ import annotations

import numpy as np

from robid.artifacts.artifact import Artifact
from robid.frf.frf import Frf
from robid.models.transmission.files import solution_from_artifact
from robid.models.transmission.fit.solution import TransmissionSolution
from robid.results.residual import Residual


def residual_of(solution: TransmissionSolution, _responses: Frf | None) -> Residual:
    """Returns measured and modelled differences of the encoders, row by row as they were fitted."""
    found = solution.rows
    left = found.measured - found.model
    return Residual(
        measured=found.measured,
        model=found.model,
        whitened=np.asarray(left / np.sqrt(np.mean(left**2, axis=0))),
        axes=("row", "gear"),
        abscissa=found.time_s,
        over="time_s",
        labels=solution.joints,
    )


def stored_residual(model: Artifact, responses: Frf | None) -> Residual:
    """Returns the same from the file of a fit."""
    return residual_of(solution_from_artifact(model), responses)
