"""What a rigid fit leaves of its torques."""

from __future__ import annotations

import numpy as np

from robid.artifacts.artifact import Artifact
from robid.frf.frf import Frf
from robid.models.rigid.files import solution_from_artifact
from robid.models.rigid.fit.solution import RigidSolution
from robid.results.residual import Residual


def residual_of(solution: RigidSolution, _responses: Frf | None) -> Residual:
    """Returns measured and modelled torques, row by row as they were fitted."""
    found = solution.residuals
    return Residual(
        measured=found.torque,
        model=np.asarray(found.torque - found.residual),
        whitened=np.asarray(found.residual / np.sqrt(np.nanmean(found.residual**2, axis=0))),
        axes=("row", "joint"),
        abscissa=found.time_s,
        over="time_s",
        labels=(),
    )


def stored_residual(model: Artifact, responses: Frf | None) -> Residual:
    """Returns the same from the file of a fit."""
    return residual_of(solution_from_artifact(model), responses)
