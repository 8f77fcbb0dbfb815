"""How much of a known truth a fit recovered."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import median

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.fit.solution import Solution

_SPRING_TOLERANCE = 0.02


@dataclass(frozen=True)
class Recovery:
    """Fitted against true values.

    Attributes:
        names: Parameters whose truth is known.
        truth (n_known,): True values.
        relative_error (n_known,): Error over the true value; the error itself for relative errors of
            friction and where the truth is zero.
        covered (n_known,): Whether the interval holds the truth.
        identifiable (n_known,): As decided before the fit.
        coverage: Share of the identifiable parameters whose interval holds the truth; None without any.
        springs_within: Springs within 2 % of the truth.
        springs_known: Springs whose truth is known.
    """

    names: tuple[str, ...]
    truth: FloatArray
    relative_error: FloatArray
    covered: BoolArray
    identifiable: BoolArray
    coverage: float | None
    springs_within: int
    springs_known: int


def recover(solution: Solution, truth: dict[str, float]) -> Recovery:
    """Compares a solution with the truth.

    Args:
        solution: What the fit found.
        truth: True value by parameter name; names that the fit does not estimate are left out.
    """
    known = [index for index, name in enumerate(solution.names) if name in truth]
    names = tuple(solution.names[index] for index in known)
    values = np.array([truth[name] for name in names], float)
    kinds = np.array([solution.kinds[index] for index in known], dtype=str)
    size = np.where((kinds == "friction") | (values == 0), 1.0, np.abs(values))
    error = (solution.estimate[known] - values) / size
    covered = (solution.lower[known] <= values) & (values <= solution.upper[known])
    identifiable = solution.identifiable[known].astype(bool)
    springs = kinds == "stiffness"
    return Recovery(
        names=names,
        truth=values,
        relative_error=error,
        covered=covered,
        identifiable=identifiable,
        coverage=float(covered[identifiable].mean()) if identifiable.any() else None,
        springs_within=int((np.abs(error[springs]) <= _SPRING_TOLERANCE).sum()),
        springs_known=int(springs.sum()),
    )


def recovery_sentence(springs_within: int, springs_known: int, coverage: float | None) -> str:
    """Says how much of the truth was found; empty where none is known."""
    parts = [f"{springs_within} of {springs_known} springs within 2 %"] if springs_known else []
    parts += [] if coverage is None else [f"{100 * coverage:.0f} % of the intervals hold it"]
    return f"Against the truth: {', '.join(parts)}." if parts else ""


def median_spring_half_width(solution: Solution) -> float | None:
    """Median half width of the springs' intervals over their estimates; None without a fitted spring."""
    springs = np.array(solution.kinds) == "stiffness"
    if not springs.any():
        return None
    half = 0.5 * (solution.upper - solution.lower)[springs] / solution.estimate[springs]
    return float(median(half.tolist()))
