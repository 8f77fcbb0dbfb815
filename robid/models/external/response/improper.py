"""Whether a response rises faster than the functions allowed: poles beyond its lines that stand for zeros.

`(a s + b) / (1 + s / p)` with p far above all lines is `a s + b` there. A function with no more zeros than poles
explains an improper response by a pole that the lines do not determine; without that pole it has a parameter less.
"""

from __future__ import annotations

import numpy as np

from robid.models.external.response.denominator import denominator_of
from robid.models.external.response.descent import descend
from robid.models.external.response.evidence import make_evidence, scale_of
from robid.models.external.response.lines import Lines
from robid.models.external.response.options import ResponseFitOptions
from robid.models.external.response.residual import State

_MOST = 2


def missing_zeros(lines: Lines, state: State, options: ResponseFitOptions, longest: float | None) -> int:
    """Counts the zeros that the response asks for beyond what was allowed.

    Args:
        lines: The response.
        state: The chosen model.
        options: What was given.
        longest: Longest delay allowed, in the lines' units; None where it was not estimated.

    Returns:
        Poles beyond all lines without which the model has more evidence; 0 in discrete time, which has no improper
        functions, and where the model has fewer zeros than it might, does not explain the response, or needs several
        such poles, which stand for something else.
    """
    most = state.denominator.n_pole - options.relative_degree
    if options.time == "discrete" or options.zeros is not None or max(state.degrees) < most:
        return 0
    delayed = longest is not None
    if scale_of(lines, state, delayed=delayed) > 1:
        return 0
    evidence = make_evidence(lines)
    best = state
    while (fewer := _without_fastest(lines, best, longest, stable=options.stable)) is not None:
        if evidence.score(fewer, delayed=delayed) >= evidence.score(best, delayed=delayed):
            break
        best = fewer
    count = state.denominator.n_pole - best.denominator.n_pole
    return count if count <= _MOST else 0


def _without_fastest(lines: Lines, state: State, longest: float | None, *, stable: bool) -> State | None:
    """The model without its fastest real pole or pair, all numerators kept; None where that lies among the lines."""
    poles = state.denominator.moving_poles()
    order = np.argsort(np.abs(poles))
    if not len(order) or abs(poles[order[-1]]) <= lines.x[-1]:
        return None
    kept = poles[order[: -1 if poles[order[-1]].imag == 0 else -2]]
    denominator = denominator_of(kept, state.denominator.integrators)
    return descend(
        lines,
        denominator,
        state.delay,
        state.degrees,
        longest=longest,
        stable=stable,
        max_iterations=60,
        tolerance=1e-6,
    )
