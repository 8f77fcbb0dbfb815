"""What an external fit leaves of its motions, or of its response."""

from __future__ import annotations

import numpy as np

from robid.artifacts.artifact import Artifact
from robid.frf.frf import Frf
from robid.models.external.files import solution_from_artifact
from robid.models.external.fit.solution import ExternalSolution
from robid.models.external.of_responses.files import solution_from_artifact as rational_from_artifact
from robid.models.external.of_responses.solution import RationalSolution
from robid.results.residual import Residual, scaled_by_group

_SHOWN = "external/shown/"  # datasets that only fits of responses have


def residual_of(solution: ExternalSolution | RationalSolution, _responses: Frf | None) -> Residual:
    """Returns measured and simulated motions, one output of one shot after the other; or responses, by channel."""
    if isinstance(solution, RationalSolution):
        return _of_response(solution)
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
    of_response = any(name.startswith(_SHOWN) for name in model.datasets)
    return residual_of((rational_from_artifact if of_response else solution_from_artifact)(model), responses)


def _of_response(solution: RationalSolution) -> Residual:
    shown = solution.shown
    return Residual(
        measured=shown.measured,
        model=shown.model,
        whitened=(shown.measured - shown.model) / shown.measured_std,
        axes=("frequency", "channel"),
        abscissa=shown.frequency_hz,
        over="frequency_hz",
        labels=solution.transfers.names,
    )
