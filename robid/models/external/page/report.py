"""What an external fit adds to page, terminal and summary."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from robid.artifacts.results import grade_from_artifact
from robid.models.external.files import solution_from_artifact, validation_from_artifact
from robid.models.external.fit.agreement import Agreement
from robid.models.external.fit.solution import ExternalSolution
from robid.models.external.judge.validating import ExternalValidation
from robid.models.external.page.data import new_section, own_section
from robid.models.external.page.sections import sections
from robid.models.external.settings import external_fit
from robid.models.family import Shown
from robid.models.parameters import parameter_rows, parameter_summary
from robid.report.numbers import significant
from robid.report.page import FitReport, Headline, KeyNumber
from robid.report.parameter_section import parameter_numbers, parameter_table
from robid.report.parameters import Estimates
from robid.results.grade import Grade


def report(shown: Shown) -> FitReport:
    """Lays out an external fit for page, terminal and summary."""
    solution = solution_from_artifact(shown.model)
    validation = None if shown.validation is None else validation_from_artifact(shown.validation)
    grade = grade_from_artifact(shown.model) if validation is None else validation.outcome.grade
    estimates = _estimates(shown, solution)
    data = own_section(solution) if validation is None else new_section(solution, validation)
    options = external_fit(shown.data.loaded.experiment, shown.data.name).coupling
    return FitReport(
        headline=_headline(shown.data.name, solution, estimates, validation, grade),
        verdict=_verdict(solution, validation, grade, named=shown.data.settings.validate_on is not None),
        grade=grade.value,
        sections=sections(solution, estimates, data, options),
        parameters=estimates.rows,
        summary=_summary(solution, estimates, validation, grade),
        terminal=(parameter_table(estimates),),
    )


def _estimates(shown: Shown, solution: ExternalSolution) -> Estimates:
    estimate = solution.estimate
    return Estimates(
        rows=parameter_rows(estimate, shown.true),
        level=estimate.confidence,
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
    return Headline(
        name=name,
        numbers=(*parameter_numbers(estimates, usable=grade.value > 0), *_numbers(solution, validation)),
        doubts=tuple(doubt.sentence for doubt in grade.doubts),
        status=solution.estimate.status.replace("_", " "),
        advice=solution.estimate.advice,
    )


def _numbers(solution: ExternalSolution, validation: ExternalValidation | None) -> Iterator[KeyNumber]:
    yield _worst("NRMSE, own data", solution.agreements)
    if validation is not None:
        yield _worst("NRMSE, new data", validation.agreements)
    if not solution.coupling.own.all():
        yield KeyNumber("Decoupled up to", f"{significant(solution.coupling.overall_hz, 3)} Hz")


def _worst(label: str, every: Sequence[Agreement]) -> KeyNumber:
    worst = min(every, key=lambda each: each.nrmse)
    return KeyNumber(label, f"{worst.nrmse:.3f}", f"worst: {worst.output}" if len(every) > 1 else "")


def _verdict(solution: ExternalSolution, validation: ExternalValidation | None, grade: Grade, *, named: bool) -> str:
    estimate = solution.estimate
    count = len(solution.transfers.names)
    found = [
        grade.sentence,
        f"{count} transfer function{'s' if count > 1 else ''}, {int(estimate.identified.sum())} of"
        f" {len(estimate.names)} parameters are identified.",
    ]
    if validation is None:
        found.append("Not validated: no campaign was named to hold it against." if not named else "Not validated.")
    elif validation.outcome.ok:
        found.append(f"The model {validation.outcome.verdict}.")
    return " ".join(found)


def _summary(
    solution: ExternalSolution, estimates: Estimates, validation: ExternalValidation | None, grade: Grade
) -> dict[str, float]:
    estimate = solution.estimate
    found = {
        "grade": float(grade.value),
        "converged": float(estimate.status == "converged"),
        "identifiable": float(estimate.identifiable.sum()),
        "decoupled_up_to_hz": solution.coupling.overall_hz,
        **parameter_summary(estimates.rows),
    }
    for row, name in enumerate(solution.quality.output_names):
        found[f"{name}.nrmse"] = float(solution.quality.nrmse[row])
    transfers = solution.transfers
    for block, name in enumerate(transfers.blocks):
        found |= {
            f"{name}.poles": float(transfers.poles[block]),
            f"{name}.zeros": float(transfers.zeros[block]),
            f"{name}.delay_samples": float(transfers.delay_samples[block]),
            f"{name}.fpe": float(solution.quality.fpe[block]),
        }
    return found | ({} if validation is None else _validated(validation))


def _validated(validation: ExternalValidation) -> dict[str, float]:
    """Numbers of each output, in the place where it is worst."""
    found = {
        "validation.ok": float(validation.outcome.ok),
        "validation.nrmse": min(each.nrmse for each in validation.agreements),
    }
    pairs = sorted(zip(validation.agreements, validation.bounds, strict=True), key=lambda pair: -pair[0].nrmse)
    for each, bounds in pairs:
        found |= {
            f"validation.{each.output}.nrmse": each.nrmse,
            f"validation.{each.output}.r_squared": each.r_squared,
            f"validation.{each.output}.fpe": bounds.fpe,
            f"validation.{each.output}.inside": bounds.inside,
        }
    return found
