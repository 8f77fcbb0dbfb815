"""What an external fit adds to page, terminal and summary."""

from __future__ import annotations

import numpy as np

from robid.artifacts.grade import grade_from_artifact
from robid.families.external.files import solution_from_artifact, validation_from_artifact
from robid.families.family import Shown
from robid.families.parameters import parameter_rows, parameter_summary
from robid.fit.external.solution import ExternalSolution
from robid.report.content import FitReport, Headline, KeyNumber
from robid.report.numbers import significant
from robid.report.parameter_section import parameter_numbers, parameter_section
from robid.report.parameters import Estimates
from robid.report.terminal import parameter_table
from robid.validation.external.validating import ExternalValidation
from robid.validation.grade import Grade


def report(shown: Shown) -> FitReport:
    """Lays out an external fit for page, terminal and summary."""
    solution = solution_from_artifact(shown.model)
    validation = None if shown.validation is None else validation_from_artifact(shown.validation)
    grade = grade_from_artifact(shown.model) if validation is None else validation.outcome.grade
    estimates = _estimates(shown, solution)
    return FitReport(
        headline=_headline(shown.data.name, solution, estimates, validation, grade),
        verdict=_verdict(solution, validation, grade, named=shown.data.settings.validate_on is not None),
        grade=grade.value,
        sections=parameter_section(estimates, "Poles and zeros are rates, or natural frequencies and damping ratios."),
        parameters=estimates.rows,
        summary=_summary(solution, estimates, validation, grade),
        terminal=(parameter_table(estimates),),
    )


def _estimates(shown: Shown, solution: ExternalSolution) -> Estimates:
    estimate = solution.estimate
    return Estimates(
        rows=parameter_rows(estimate, shown.true),
        level=estimate.confidence,
        torque_unit="N m",
        undetermined=estimate.undetermined,
        identifiable_relative_std=estimate.identifiable_relative_std,
        interval_rule=estimate.interval_rule,
    )


def _headline(
    name: str,
    solution: ExternalSolution,
    estimates: Estimates,
    validation: ExternalValidation | None,
    grade: Grade,
) -> Headline:
    own = KeyNumber("NRMSE, own motions", significant(float(solution.quality.nrmse.min()), 4), "worst channel")
    new = () if validation is None else (
        KeyNumber(
            "NRMSE, new motions", significant(min(one.nrmse for one in validation.agreements), 4), "worst channel"
        ),
    )  # fmt: skip
    apart = KeyNumber("Decoupled up to", f"{significant(solution.coupling.overall_hz, 3)} Hz", "all channels")
    return Headline(
        name=name,
        numbers=(*parameter_numbers(estimates, usable=grade.value > 0), own, *new, apart),
        doubts=tuple(doubt.sentence for doubt in grade.doubts),
        status=solution.estimate.status.replace("_", " "),
        advice=solution.estimate.advice,
    )


def _verdict(solution: ExternalSolution, validation: ExternalValidation | None, grade: Grade, *, named: bool) -> str:
    known = int(solution.estimate.identified.sum())
    found = [grade.sentence, f"{known} of {len(solution.estimate.names)} parameters are identified."]
    if validation is None:
        found.append("Not validated: no campaign was named to hold it against." if not named else "Not validated.")
    elif validation.outcome.ok:
        found.append(f"The model {validation.outcome.verdict}.")
    return " ".join(found)


def _summary(
    solution: ExternalSolution, estimates: Estimates, validation: ExternalValidation | None, grade: Grade
) -> dict[str, float]:
    own, estimate = solution.transfers, solution.estimate
    found = {
        "grade": float(grade.value),
        "converged": float(estimate.status == "converged"),
        "identifiable": float(estimate.identifiable.sum()),
        "decoupled_up_to_hz": solution.coupling.overall_hz,
        **parameter_summary(estimates.rows),
    }
    for block, name in enumerate(own.blocks):
        found[f"{name}.poles"] = float(own.poles[block])
        found[f"{name}.zeros"] = float(own.zeros[block])
        found[f"{name}.delay_samples"] = float(own.delay_samples[block])
        found[f"{name}.fpe"] = float(solution.quality.fpe[block])
    for name, value in zip(solution.quality.output_names, solution.quality.nrmse.tolist(), strict=True):
        found[f"{name}.nrmse"] = value
    if validation is None:
        return found
    found["validation.ok"] = float(validation.outcome.ok)
    found["validation.nrmse"] = float(np.min([one.nrmse for one in validation.agreements]))
    for one, bounds in zip(validation.agreements, validation.bounds, strict=True):
        key = f"validation.{one.output}"
        found[f"{key}.nrmse"] = min(one.nrmse, found.get(f"{key}.nrmse", 1.0))
        found[f"{key}.inside"] = min(bounds.inside, found.get(f"{key}.inside", 1.0))
    return found
