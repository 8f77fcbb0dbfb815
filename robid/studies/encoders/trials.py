"""One robot of the study: its motions are simulated, its gears fitted and validated, and compared with the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.artifacts.artifact import Dataset
from robid.errors import DataError
from robid.models.transmission.fit.fitting import fit_transmissions
from robid.models.transmission.fit.motions import motions_of
from robid.models.transmission.fit.options import TransmissionFitOptions
from robid.models.transmission.fit.solution import TransmissionSolution
from robid.models.transmission.judge.plausible import assess
from robid.models.transmission.judge.validating import TransmissionValidation, validate_transmissions
from robid.models.transmission.truth import true_values_of
from robid.studies.encoders.robots import Individual, drawn_options, recorded, truth_of
from robid.studies.study import Content

COLUMNS = (
    *("stiffness", "stiffness_lower", "stiffness_upper", "stiffness_true"),
    *("lost", "lost_lower", "lost_upper", "lost_true", "lost_identified"),
    *("width", "width_lower", "width_upper", "width_true"),
    *("lag_s", "lag_true_s", "agreement", "reached", "determined", "error"),
)
"""What is kept of each gear."""
GRADE, SENTENCE = "grade", "sentence"
REFUSED = -1


@dataclass(frozen=True)
class Trial:
    """What a task is given."""

    one: Individual
    options: TransmissionFitOptions


def try_robot(trial: Trial) -> Content:
    """Simulates a robot, fits its gears to all motions but the last, and validates them on that one."""
    one, options = trial.one, trial.options
    drawn = drawn_options(one)
    record = recorded(one, drawn, one.study.motions + 1)
    late = one.controller.delay_samples
    try:
        motions = motions_of(record, one.file, late_samples=late)
        solution = fit_transmissions(one.file, motions[:-1], options)
        found = assess(solution, options).findings
        validation = validate_transmissions(one.file, solution, motions[-1:], options, found)
    except DataError as refusal:
        return Content({}, {GRADE: REFUSED, SENTENCE: str(refusal)})
    truth = true_values_of(one.file, truth_of(one, drawn), options)
    rows = [_gear(solution, validation, truth, gear) for gear in range(len(solution.joints))]
    grade = validation.outcome.grade
    table = Dataset(np.array(rows), "SI", ("gear", "column"), f"Of each gear: {', '.join(COLUMNS)}")
    return Content({"gears": table}, {GRADE: grade.value, SENTENCE: grade.sentence})


def _gear(
    solution: TransmissionSolution, validation: TransmissionValidation, truth: dict[str, float], gear: int
) -> list[float]:
    estimate, joint = solution.estimate, solution.joints[gear]

    def interval(name: str) -> list[float]:
        at = estimate.names.index(name)
        values = (estimate.value[at], estimate.lower[at], estimate.upper[at], truth[name])
        return [float(value) for value in values]

    lost = estimate.names.index(f"{joint}.lost_motion")
    return [
        *interval(f"{solution.springs[gear]}.stiffness"),
        *interval(f"{joint}.lost_motion"),
        float(estimate.identified[lost]),
        *interval(f"{joint}.hysteresis"),
        float(solution.lag_s[gear]),
        truth[f"{joint}.encoder_lag"],
        float(solution.agreement[gear]),
        float(solution.reached[gear] / solution.rated[gear]),
        float(solution.determined[gear]),
        float(validation.relative_error[gear]),
    ]
