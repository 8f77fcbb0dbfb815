"""What a rigid fit adds to page, terminal and summary."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robid.artifacts.results import grade_from_artifact
from robid.models.family import Shown
from robid.models.parameters import parameter_rows, parameter_summary
from robid.models.rigid.files import solution_from_artifact, validation_from_artifact
from robid.models.rigid.fit.solution import RigidSolution
from robid.models.rigid.judge.validating import RigidValidation
from robid.models.rigid.page.sections import sections
from robid.report.content import FitReport, Headline, KeyNumber
from robid.report.numbers import percent, significant
from robid.report.parameter_section import parameter_numbers
from robid.report.parameters import Estimates
from robid.report.terminal import parameter_table
from robid.results.grade import Grade


def report(shown: Shown) -> FitReport:
    """Lays out a rigid fit for page, terminal and summary."""
    solution = solution_from_artifact(shown.model)
    validation = None if shown.validation is None else validation_from_artifact(shown.validation)
    grade = grade_from_artifact(shown.model) if validation is None else validation.outcome.grade
    estimates = _estimates(shown, solution)
    robot = shown.data.loaded.robot
    joints, sensed = tuple(joint.name for joint in robot.joints), robot.without_motor
    pushed = tuple(joint.name for joint in robot.joints if joint.slides and joint.name in sensed)
    return FitReport(
        headline=_headline(shown.data.name, solution, estimates, validation, grade),
        verdict=_verdict(solution, validation, grade, named=shown.data.settings.validate_on is not None),
        grade=grade.value,
        sections=sections(solution, estimates, joints, validation, sensed, pushed),
        parameters=estimates.rows,
        summary=_summary(solution, estimates, validation, grade),
        terminal=(parameter_table(_identified(estimates)),),
    )


def _estimates(shown: Shown, solution: RigidSolution) -> Estimates:
    estimate = solution.estimate
    assumed = shown.data.loaded.robot.to_robot(0.0).assumed
    return Estimates(
        rows=parameter_rows(estimate, shown.true, assumed, solution.torque_unit),
        level=estimate.confidence,
        torque_unit=solution.torque_unit,
        undetermined=estimate.undetermined,
        identifiable_relative_std=estimate.identifiable_relative_std,
        interval_rule=estimate.interval_rule,
    )


def _identified(estimates: Estimates) -> Estimates:
    """Those that a terminal shows: what is not identified is told in one sentence."""
    return replace(estimates, rows=tuple(row for row in estimates.rows if row.identified))


def _headline(
    name: str, solution: RigidSolution, estimates: Estimates, validation: RigidValidation | None, grade: Grade
) -> Headline:
    own = KeyNumber("Torques explained to", percent(solution.residuals.total_error), "of their size, own motion")
    new = () if validation is None else (
        KeyNumber("Torques predicted to", percent(validation.total_error), "of their size, another motion"),
    )  # fmt: skip
    condition = KeyNumber("Condition number", significant(solution.base.condition, 3), "of the scaled columns")
    return Headline(
        name=name,
        numbers=(*parameter_numbers(estimates, usable=grade.value > 0), own, *new, condition),
        doubts=tuple(doubt.sentence for doubt in grade.doubts),
        status=solution.estimate.status.replace("_", " "),
        advice=solution.estimate.advice,
    )


def _verdict(solution: RigidSolution, validation: RigidValidation | None, grade: Grade, *, named: bool) -> str:
    known = int(solution.estimate.identified.sum())
    found = [grade.sentence, f"{known} of {len(solution.estimate.names)} base parameters are identified."]
    if validation is None:
        found.append("Not validated: no campaign was named to hold it against." if not named else "Not validated.")
    elif validation.outcome.ok:
        found.append(f"The model {validation.outcome.verdict}.")
    return " ".join(found)


def _summary(
    solution: RigidSolution, estimates: Estimates, validation: RigidValidation | None, grade: Grade
) -> dict[str, float]:
    checks, estimate = solution.checks, solution.estimate
    found = {
        "grade": float(grade.value),
        "converged": float(estimate.status == "converged"),
        "trust": float(checks.trust),
        "condition": solution.base.condition,
        "unscaled_condition": solution.base.unscaled_condition,
        "relative_error": solution.residuals.total_error,
        "largest_variation_from_huber": float(checks.huber_variation.max()),
        "cut_hz": solution.filtered.cut_hz,
        "identifiable": float(estimate.identifiable.sum()),
        **parameter_summary(estimates.rows),
    }
    if checks.instrument_variation is not None:
        found["largest_variation_from_instruments"] = float(checks.instrument_variation.max())
    covered = [row.covered for row in estimates.rows if row.covered is not None]
    if covered:
        found["coverage"] = float(np.mean(covered))
    if validation is not None:
        found |= {
            "validation.ok": float(validation.outcome.ok),
            "validation.relative_error": validation.total_error,
            "validation.worst_error_ratio": float(validation.error_ratio.max()),
        }
    if validation is not None and validation.forward_error is not None:
        found["validation.worst_forward_error"] = float(validation.forward_error.max())
    return found
