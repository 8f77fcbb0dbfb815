"""What a position-dependent fit adds to page, terminal and summary."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robid.artifacts.results import grade_from_artifact
from robid.models.family import Shown
from robid.models.lpv.files import solution_from_artifact, validation_from_artifact
from robid.models.lpv.fit.agreement import expected_share
from robid.models.lpv.fit.blocks import block_names
from robid.models.lpv.fit.solution import Held, LpvSolution
from robid.models.lpv.judge.validating import LpvValidation
from robid.models.lpv.page.sections import sections
from robid.models.parameters import parameter_rows, parameter_summary
from robid.report.content import FitReport, Headline, KeyNumber
from robid.report.numbers import percent
from robid.report.parameter_section import parameter_numbers
from robid.report.parameters import Estimates
from robid.report.terminal import parameter_table
from robid.results.grade import Grade


def report(shown: Shown) -> FitReport:
    """Lays out a position-dependent fit for page, terminal and summary."""
    solution = solution_from_artifact(shown.model)
    validation = None if shown.validation is None else validation_from_artifact(shown.validation)
    grade = grade_from_artifact(shown.model) if validation is None else validation.outcome.grade
    estimates = _estimates(shown, solution)
    frf = shown.data.frf
    notes = () if frf is None else tuple(note for note in frf.notes if note not in shown.told)
    return FitReport(
        headline=_headline(shown.data.name, solution, estimates, validation, grade),
        verdict=_verdict(solution, validation, grade, named=shown.data.settings.validate_on is not None),
        grade=grade.value,
        sections=sections(solution, estimates, validation, notes),
        parameters=estimates.rows,
        summary=_summary(solution, estimates, validation, grade),
        terminal=(parameter_table(estimates),),
    )


def _estimates(shown: Shown, solution: LpvSolution) -> Estimates:
    estimate = solution.estimate
    return Estimates(
        rows=parameter_rows(estimate, shown.true),
        level=estimate.confidence,
        undetermined=estimate.undetermined,
        identifiable_relative_std=estimate.identifiable_relative_std,
        interval_rule=estimate.interval_rule,
    )


def _headline(
    name: str, solution: LpvSolution, estimates: Estimates, validation: LpvValidation | None, grade: Grade
) -> Headline:
    return Headline(
        name=name,
        numbers=(*parameter_numbers(estimates, usable=grade.value > 0), *_numbers(solution, validation)),
        doubts=tuple(doubt.sentence for doubt in grade.doubts),
        status=solution.estimate.status.replace("_", " "),
        advice=solution.estimate.advice,
    )


def _numbers(solution: LpvSolution, validation: LpvValidation | None) -> Iterator[KeyNumber]:
    yield _error("Beyond noise, own data", solution.own)
    if validation is not None:
        yield _error("Beyond noise, new data", validation.held)
    kept = solution.blocks.kept
    yield KeyNumber(
        "Blocks", f"{int(kept.sum())} of {kept.size}", f"dropped: {', '.join(block_names(~kept)) or 'none'}"
    )


def _error(label: str, held: Held) -> KeyNumber:
    share, expected = _mean(held), expected_share(held.degrees_of_freedom)
    known = np.isfinite(share) and np.isfinite(expected)
    detail = (
        f"{percent(share)} of the lines within 2 deviations; {percent(expected)} of a perfect model" if known else ""
    )
    return KeyNumber(label, percent(_worst(held)), detail)


def _worst(held: Held) -> float:
    return float(np.nanmax(held.agreement.excess, initial=0.0))


def _mean(held: Held) -> float:
    """Share of all lines within two deviations; NaN where these are unknown."""
    share = held.agreement.share_within
    return float(np.nanmean(share)) if np.isfinite(share).any() else float("nan")


def _verdict(solution: LpvSolution, validation: LpvValidation | None, grade: Grade, *, named: bool) -> str:
    kept = solution.blocks.kept
    found = [
        grade.sentence,
        f"{solution.core.n_state} states at {len(solution.own.points)} positions,"
        f" {int(kept.sum())} of {kept.size} blocks.",
    ]
    if validation is None:
        found.append("Not validated." if named else "Not validated: no campaign was named to hold it against.")
    elif validation.outcome.ok:
        found.append(f"The model {validation.outcome.verdict}.")
    return " ".join(found)


def _summary(
    solution: LpvSolution, estimates: Estimates, validation: LpvValidation | None, grade: Grade
) -> dict[str, float]:
    kept = solution.blocks.kept
    found = {
        "grade": float(grade.value),
        "converged": float(solution.estimate.status == "converged"),
        "blocks": float(kept.size),
        "blocks_dropped": float(kept.size - kept.sum()),
        "largest_pole": solution.largest_pole,
        "misfit": solution.misfit,
        "gamma": float(solution.path.gamma[solution.path.chosen]),
        **_agreement("local", solution.own),
        **_agreement("choosing", solution.choosing),
        **parameter_summary(estimates.rows),
    }
    if validation is not None:
        found |= {"validation.ok": float(validation.outcome.ok), **_agreement("validation", validation.held)}
    return found


def _agreement(name: str, held: Held) -> dict[str, float]:
    found = {f"{name}.excess": _worst(held), f"{name}.error_db": float(np.nanmax(held.agreement.error_db))}
    return found | ({f"{name}.share_within_2std": _mean(held)} if np.isfinite(_mean(held)) else {})
