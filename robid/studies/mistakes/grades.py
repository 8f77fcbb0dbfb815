"""The grade that a fit deserves by the truth, and the one that it is given."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robid.frf.frf import Frf
from robid.models.elastic.fit.solution import ElasticSolution
from robid.models.elastic.judge.validating import Validation
from robid.results.doubt import CAUSES
from robid.results.plausible.doubts import data_doubts
from robid.robot.description import Robot

GRADING = 4
"""Raised when the rules of the grade change, so that the cases are graded anew."""

GRADES = ("do not use", "predicts", "trust")
"""Grades in words, by their value."""

COVERED = 0.9
HALF_WIDTHS = 3.0
SPRING_ERROR = 0.2


@dataclass(frozen=True)
class Against:
    """A fit against the truth.

    Attributes:
        spring_error: Largest relative error of an identified spring; NaN where none is known.
        half_widths: Largest error of one over half its interval, both logarithmic; NaN where none is known.
        coverage: Share of the identified parameters whose interval holds the truth; NaN where none is known.
        holds: Whether the validation passes.
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


def against_truth(solution: ElasticSolution, validation: Validation, truth: dict[str, float]) -> Against:
    """Compares a fit and its validation with the truth."""
    estimate = solution.estimate
    known = np.array([name in truth for name in estimate.names]) & estimate.identified
    true = np.array([truth.get(name, np.nan) for name in estimate.names])
    covered = (estimate.lower <= true) & (true <= estimate.upper)
    springs = known & np.array([kind == "stiffness" for kind in estimate.kinds])
    found, lower, upper = (each[springs] / true[springs] for each in (estimate.value, estimate.lower, estimate.upper))
    widths = np.abs(np.log(found)) / np.maximum(0.5 * np.log(upper / lower), 1e-300)
    return Against(
        spring_error=float(np.abs(found - 1).max()) if springs.any() else math.nan,
        half_widths=float(widths.max()) if springs.any() else math.nan,
        coverage=float(covered[known].mean()) if known.any() else math.nan,
        holds=validation.outcome.ok,
    )


def refused_causes(robot: Robot, frf: Frf | None, text: str, delay_s: float = 0.0) -> tuple[str, ...]:
    """Returns the causes that the tool names where it refuses data, in their order.

    Args:
        robot: The robot as the file that the fit reads describes it.
        frf: The response, if that was not refused itself.
        text: Why it was refused.
        delay_s: Nominal delay from recorded to applied torque, hold excluded [s].
    """
    seen = () if frf is None else tuple(doubt.cause for doubt in data_doubts(robot, frf, delay_s))
    named = sorted((text.find(words), cause) for cause, words in CAUSES.items() if words in text)
    return tuple(dict.fromkeys((*seen, *(cause for _, cause in named))))
