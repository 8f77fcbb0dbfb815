"""What a fit of gears adds to page, terminal and summary."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from robid.artifacts.results import grade_from_artifact
from robid.models.family import Shown
from robid.models.parameters import estimates_of, fit_report
from robid.models.transmission.files import solution_from_artifact, validation_from_artifact
from robid.models.transmission.fit.solution import TransmissionSolution
from robid.models.transmission.judge.plausible import remedies
from robid.models.transmission.judge.validating import ERROR_LIMIT, TransmissionValidation
from robid.models.transmission.page.curves import deflection_section, loop_section
from robid.models.transmission.page.tables import gears_section, motions_section, sums_section
from robid.report.numbers import percent, significant
from robid.report.page import FitReport, KeyNumber

_SHOWN = ("stiffness", "cubic", "lost_motion", "hysteresis", "encoder_lag")


def report(shown: Shown) -> FitReport:
    """Lays out a fit of gears for page, terminal and summary."""
    solution = solution_from_artifact(shown.model)
    validation = None if shown.validation is None else validation_from_artifact(shown.validation)
    grade = grade_from_artifact(shown.model) if validation is None else validation.outcome.grade
    estimates = estimates_of(shown, solution.estimate, shown.data.loaded.robot.to_robot(0.0).assumed)
    chosen = tuple(row for row in estimates.rows if row.kind in _SHOWN and (row.identified or row.kind == "stiffness"))
    return fit_report(
        shown,
        solution.estimate,
        estimates,
        None if validation is None else validation.outcome,
        found="",
        numbers=_key_numbers(solution, validation),
        sections=(
            gears_section(solution, validation, grade),
            loop_section(solution),
            sums_section(solution),
            motions_section(solution, validation),
            deflection_section(solution, validation),
        ),
        summary=_summary(solution, validation),
        unknown=_unknown(solution),
        worst=("", "") if validation is None else _worst(solution, validation),
        terminal=replace(estimates, rows=chosen),
    )


def _unknown(solution: TransmissionSolution) -> str:
    """Says which stiffnesses are not identified and what would tell them, and what one motion cannot show."""
    told = [] if solution.determined.all() or not solution.determined.any() else remedies(solution)
    sentences = [f"{each[0].upper()}{each[1:]}." for each in told]
    if len(solution.motions) == 1:
        sentences.append("One motion does not show what differs between motions.")
    return " ".join(sentences)


def _worst(solution: TransmissionSolution, validation: TransmissionValidation) -> tuple[str, str]:
    """Writes the worst error of a deflection and its limit."""
    if not solution.determined.any():
        return "", ""
    worst = int(np.argmax(np.where(solution.determined, validation.relative_error, -np.inf)))
    return f"{percent(validation.relative_error[worst])} of the deflection of {solution.joints[worst]}", percent(
        ERROR_LIMIT
    )


def _key_numbers(solution: TransmissionSolution, validation: TransmissionValidation | None) -> Iterator[KeyNumber]:
    yield KeyNumber(
        "Gears", f"{int(solution.determined.sum())} of {len(solution.joints)}", "whose stiffness is identified"
    )
    if solution.determined.any():
        share = (solution.residual / np.maximum(solution.size, 1e-300))[solution.determined].max()
        yield KeyNumber("Residual", percent(share), "of the deflection's size, the worst gear")
        lag_ms = 1e3 * solution.lag_s[solution.determined]
        text = significant(float(np.mean(lag_ms)), 3)
        yield KeyNumber("Encoder lag", f"{text} ms", "mean of the gears")
    if validation is not None and solution.determined.any():
        worst = validation.relative_error[solution.determined].max()
        yield KeyNumber("Deflection error", percent(worst), "another motion, the worst gear")


def _summary(solution: TransmissionSolution, validation: TransmissionValidation | None) -> dict[str, float]:
    found: dict[str, float] = {
        "gears": float(len(solution.joints)),
        "gears_identified": float(solution.determined.sum()),
    }
    for gear, joint in enumerate(solution.joints):
        found |= {
            f"{joint}.lag_sum_s": float(solution.lag_s[gear]),
            f"{joint}.damping_sum_s": float(solution.damping_s[gear]),
            f"{joint}.loop_sum": float(solution.loop[gear]),
            f"{joint}.agreement": float(solution.agreement[gear]),
            f"{joint}.residual": float(solution.residual[gear]),
            f"{joint}.identified": float(solution.determined[gear]),
        }
        if validation is not None:
            found[f"{joint}.validation.relative_error"] = float(validation.relative_error[gear])
    if validation is not None:
        found["validation.ok"] = float(validation.outcome.ok)
    return found
