"""What a position-dependent fit leaves of its responses."""

from __future__ import annotations

import numpy as np

from robid.artifacts.artifact import Artifact
from robid.frf.frf import Frf
from robid.models.lpv.files import solution_from_artifact
from robid.models.lpv.fit.solution import LpvSolution
from robid.results.residual import Residual


def residual_of(solution: LpvSolution, _responses: Frf | None) -> Residual:
    """Returns measured and modelled responses of the positions that were fitted."""
    own = solution.own
    return Residual(
        measured=own.response,
        model=own.modelled,
        whitened=np.asarray((own.response - own.modelled) / own.std),
        axes=("configuration", "frequency", "output", "input"),
        abscissa=own.frequency_hz,
        over="frequency_hz",
        labels=solution.ports.inputs,
    )


def stored_residual(model: Artifact, responses: Frf | None) -> Residual:
    """Returns the same from the file of a fit."""
    return residual_of(solution_from_artifact(model), responses)
