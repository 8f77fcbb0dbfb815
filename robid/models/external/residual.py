"""What an external fit leaves of its motions."""

from __future__ import annotations

import numpy as np

from robid.artifacts.artifact import Artifact
from robid.frf.frf import Frf
from robid.models.external.files import solution_from_artifact
from robid.models.external.fit.solution import ExternalSolution
from robid.results.residual import Residual, scaled_by_group


def residual_of(solution: ExternalSolution, _responses: Frf | None) -> Residual:
    """Returns measured and simulated motions, one output of one shot after the other."""
    found, names = solution.traces, solution.quality.output_names
    rows = zip(found.shot.tolist(), found.output.tolist(), strict=True)
    labels = tuple(f"{found.shots[shot]}: {names[output]}" for shot, output in rows)
    return Residual(
        measured=found.measured,
        model=found.simulated,
        whitened=scaled_by_group(found.measured - found.simulated, np.array(labels)),
        axes=("row",),
        abscissa=found.time_s,
        over="time_s",
        labels=labels,
    )


def stored_residual(model: Artifact, responses: Frf | None) -> Residual:
    """Returns the same from the file of a fit."""
    return residual_of(solution_from_artifact(model), responses)
