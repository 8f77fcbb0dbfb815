"""The grade that a fit deserves by the truth, and the one that it is given."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robid.fit.solution import Solution
from robid.frf.frf import Frf
from robid.robot.description import Robot
from robid.validation.doubt import CAUSES, Doubt
from robid.validation.elastic import Validation

GRADING = 1
"""Raised when the rules of the grade change, so that the cases are graded anew."""

GRADES = ("do not use", "predicts", "trust")
"""Grades in words, by their value."""

COVERED = 0.9
HALF_WIDTHS = 3.0
SPRING_ERROR = 0.2
COST_LIMIT = 1.5
MEDIAN_LIMIT_DB = 1.0


@dataclass(frozen=True)
class Against:
    """A fit against the truth.

    Attributes:
        spring_error: Largest relative error of an identified spring; NaN where none is known.
        half_widths: Largest error of one over half its interval, both logarithmic; NaN where none is known.
        coverage: Share of the identified parameters whose interval holds the truth; NaN where none is known.
        holds: Whether the validation passes by what noise and the assumed model error allow.
    """

    spring_error: float
    half_widths: float
    coverage: float
    holds: bool

    @property
    def grade(self) -> int:
        """The grade that it deserves."""
        if not self.holds or self.spring_error > SPRING_ERROR:
            return 0
        covered = math.isnan(self.coverage) or self.coverage >= COVERED
        return 2 if covered and not self.half_widths > HALF_WIDTHS else 1


def against_truth(solution: Solution, validation: Validation, truth: dict[str, float]) -> Against:
    """Compares a fit and its validation with the truth."""
    identified = solution.identifiable.astype(bool)
    springs = [
        index
        for index, (name, kind) in enumerate(zip(solution.names, solution.kinds, strict=True))
        if kind == "stiffness" and identified[index] and name in truth
    ]
    true = np.array([truth[solution.names[index]] for index in springs], float)
    estimate, lower, upper = (each[springs] for each in (solution.estimate, solution.lower, solution.upper))
    error = np.abs(estimate / true - 1)
    widths = np.abs(np.log(estimate / true)) / np.maximum(0.5 * np.log(upper / lower), 1e-300)
    coverage = validation.coverage
    return Against(
        spring_error=float(error.max()) if springs else math.nan,
        half_widths=float(widths.max()) if springs else math.nan,
        coverage=math.nan if coverage is None else coverage,
        holds=validation_holds(validation),
    )


def validation_holds(validation: Validation) -> bool:
    """Tells whether a validation passes by absolute figures, the fit's own cost aside."""
    return absolute_cost(validation) <= COST_LIMIT and validation.median_error_db <= MEDIAN_LIMIT_DB


def absolute_cost(validation: Validation) -> float:
    """Returns the largest cost per element over what noise and the assumed model error allow there."""
    allowed = np.maximum(validation.expected_cost / validation.elements, 1.0)
    return float((validation.cost / validation.elements / allowed).max())


def tool_grade(robot: Robot, frf: Frf, solution: Solution, validation: Validation) -> tuple[int, tuple[Doubt, ...]]:
    """Returns the grade that the tool gives, and its reasons to doubt, the strongest first.

    With `tool_refusal` the only place that knows how the tool judges.

    Args:
        robot: The robot as the file that the fit reads describes it.
        frf: The response that was fitted.
        solution: What the fit found.
        validation: How it holds.
    """
    del robot, frf
    return (2 if solution.status == "converged" and validation.ok else 0), ()


def tool_refusal(robot: Robot, frf: Frf | None, text: str) -> tuple[str, ...]:
    """Returns the causes that the tool names where it refuses data, in their order.

    Args:
        robot: The robot as the file that the fit reads describes it.
        frf: The response, if that was not refused itself.
        text: Why it was refused.
    """
    del robot, frf
    named = [(text.find(words), cause) for cause, words in CAUSES.items() if words in text]
    return tuple(cause for _, cause in sorted(named))
