"""Defects that a residual plainly asks for, though hardly an element shows them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robid.models.elastic.fit.solution import ElasticSolution
from robid.models.elastic.judge.causes import TELLING, misfit_findings
from robid.models.elastic.judge.drifting import drift_findings
from robid.models.elastic.judge.fitted import FittedModel
from robid.results.finding import Finding

_LARGE = 0.25  # of the interval that is known beforehand: half a standard deviation


def outstanding_findings(fitted: FittedModel, solution: ElasticSolution, far: float) -> tuple[Finding, ...]:
    """Findings about a residual within its covariance: a drift that it follows, or one defect that is much of it.

    In other configurations the defect may do more than in those of the fit, whose parameters followed it. Of sound
    robots no listed defect explains more than 1.5 % of the residual's cost. What is small beside what files commonly
    have wrong is left out: where noise is overstated, even that would be most of the residual.

    Args:
        fitted: The fitted model in the configurations of the fit's own response.
        solution: What the fit found, with what its residual asks for.
        far: Half widths from the middle of an interval beyond which a value is outside.
    """
    if drifting := drift_findings(fitted, solution, far):
        return drifting
    found, problem = solution.detectable, fitted.problem
    if found is None or not found.names:
        return ()
    freedom = problem.residual_kind.parts * int((problem.weight > 0).sum()) - fitted.internal.size
    # What a random column saves in the mean is the cost over its degrees of freedom.
    most = int(np.argmax(found.gain))
    large = not _LARGE * found.lower[most] <= found.asked[most] <= _LARGE * found.upper[most]
    if found.gain[most] < TELLING * freedom or not large:
        return ()
    return tuple(replace(each, strength=each.strength / far) for each in misfit_findings(solution, fitted))
