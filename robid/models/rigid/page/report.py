"""What a rigid fit adds to page, terminal and summary."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from robid.artifacts.results import grade_from_artifact
from robid.models.family import Shown
from robid.models.parameters import estimates_of, fit_report
from robid.models.rigid.files import solution_from_artifact, validation_from_artifact
from robid.models.rigid.fit.gains import describe_gains
from robid.models.rigid.fit.solution import RigidSolution
from robid.models.rigid.judge.motors import MOTOR_ERROR_LIMIT, Motors, motors_of
from robid.models.rigid.judge.validating import RigidValidation
from robid.models.rigid.page.bodies import body_sections
from robid.models.rigid.page.content import RigidContent
from robid.models.rigid.page.estimators import estimators_section
from robid.models.rigid.page.friction import friction_section
from robid.models.rigid.page.motors import motors_section
from robid.models.rigid.page.residuals import residual_section
from robid.models.rigid.page.torques import torque_section
from robid.models.rigid.settings import rigid_fit
from robid.report.numbers import percent, significant
from robid.report.page import FitReport, KeyNumber
from robid.report.parameters import Estimates
from robid.report.section import Section


def sections(content: RigidContent) -> tuple[Section, ...]:
    """Lays out a rigid fit, what decides first: errors, torques over time, friction; then all else."""
    return (
        motors_section(content),
        torque_section(content),
        *friction_section(content),
        *body_sections(content),
        estimators_section(content),
        residual_section(content),
    )


def report(shown: Shown) -> FitReport:
    """Lays out a rigid fit for page, terminal and summary."""
    solution, settings = solution_from_artifact(shown.model), rigid_fit(shown.data.loaded.experiment, shown.data.name)
    robot = shown.data.loaded.robot.to_robot(0.0)
    validation = None if shown.validation is None else validation_from_artifact(shown.validation)
    estimates = estimates_of(shown, solution.estimate, robot.assumed, solution.torque_unit)
    joints = tuple(joint.name for joint in robot.joints)
    motors = motors_of(solution, joints, settings.judge)
    content = RigidContent(
        solution=solution,
        estimates=estimates,
        motors=motors,
        joints=robot.joints,
        validation=validation,
        grade=grade_from_artifact(shown.model) if validation is None else validation.outcome.grade,
        tests=settings.verdict,
    )
    return fit_report(
        shown,
        solution.estimate,
        estimates,
        None if validation is None else validation.outcome,
        found="",
        numbers=_key_numbers(solution, validation),
        sections=sections(content),
        summary=_summary(solution, joints, estimates, validation),
        unknown=_gains(solution, joints),
        worst=("", "") if validation is None else _worst_error(validation, motors),
        # What is not identified is told in one sentence.
        terminal=replace(estimates, rows=tuple(row for row in estimates.rows if row.identified)),
    )


def _worst_error(validation: RigidValidation, motors: Motors) -> tuple[str, str]:
    """Writes the error of the worst motor's torque over its size, and its limit."""
    name, _, worst = motors.worst(validation.relative_error)
    return f"{percent(worst)} of the torque of {name}", percent(MOTOR_ERROR_LIMIT)


def _gains(solution: RigidSolution, joints: Sequence[str]) -> str:
    """Says by what the torques were multiplied; nothing where they are as recorded."""
    if solution.gains is None:
        return ""
    told = describe_gains(solution.gains, joints, solution.estimate.confidence)
    return f"{told[0].upper()}{told[1:]}."


def _key_numbers(solution: RigidSolution, validation: RigidValidation | None) -> Iterator[KeyNumber]:
    yield KeyNumber("Torque residual", percent(solution.residuals.total_error), "of the torques' size, own motion")
    if validation is not None:
        yield KeyNumber("Torque error", percent(validation.total_error), "of the torques' size, another motion")
    yield KeyNumber("Condition number", significant(solution.base.condition, 3), "of the scaled columns")


def _summary(
    solution: RigidSolution, joints: Sequence[str], estimates: Estimates, validation: RigidValidation | None
) -> dict[str, float]:
    checks = solution.checks
    found = {
        "trust": float(checks.trust),
        "condition": solution.base.condition,
        "unscaled_condition": solution.base.unscaled_condition,
        "relative_error": solution.residuals.total_error,
        "largest_variation_from_huber": float(checks.huber_variation.max()),
        "cut_hz": solution.filtered.cut_hz,
    }
    if checks.instrument_variation is not None:
        found["largest_variation_from_instruments"] = float(checks.instrument_variation.max())
    if solution.gains is not None:
        found |= {f"gain.{name}": gain for name, gain in zip(joints, solution.gains.gain.tolist(), strict=True)}
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
