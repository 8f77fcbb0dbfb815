"""The page of a fit, its figures for the summary, and the comparison of fits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from statistics import fmean, median

from robid.models.elastic.files import validation_from_artifact
from robid.models.elastic.judge.validating import Validation
from robid.models.elastic.page.content import FitContent
from robid.models.elastic.page.gather import fit_content
from robid.models.elastic.page.resonances import repeat_summary, resonance_errors
from robid.models.elastic.page.sections import fit_tables, headline, sections
from robid.models.family import Shown
from robid.models.parameters import parameter_summary
from robid.report.costs import average_and_worst, effort
from robid.report.page import FitReport
from robid.report.parameter_section import identified_phrase
from robid.report.parameters import misfit_sentence
from robid.results.outcome import recovery_sentence

_CLOSE = 0.02
_VALIDATION = (
    "cost_ratio",
    "average_cost",
    "worst_cost",
    "median_error_db",
    "worst_error_db",
    "motor_error_db",
    "motor_error_deg",
)


def fit_summary(fit: FitContent, validation: Validation | None) -> dict[str, float]:
    """Returns everything that a fit says in numbers, in SI units."""
    found = _fit(fit)
    if validation is None:
        return found
    found |= {"validation.ok": float(validation.outcome.ok)}
    found |= {f"validation.{key}": float(getattr(validation, key)) for key in _VALIDATION}
    if validation.resonance_shift is not None:
        found["validation.resonance_shift"] = validation.resonance_shift
    return found


def comparison(fits: Sequence[FitContent]) -> dict[str, float]:
    """What cubic springs are worth: excess cost over that of a linear fit in the same campaign, and the worst of all.

    A ratio below zero says that the cubic model costs less than noise alone gives.
    """
    excess = {fit.name: sum(row.excess or 0.0 for row in fit.validation_costs) for fit in fits if fit.validation_costs}
    cubic = {fit.name for fit in fits if any(row.kind == "cubic" for row in fit.estimates.rows)}
    campaign = {fit.name: fit.validation_campaign for fit in fits}
    ratios: dict[str, float] = {}
    for name in sorted(cubic & excess.keys()):
        linear = [excess[other] for other in excess.keys() - cubic if campaign[other] == campaign[name]]
        if linear and min(linear) > 0:
            ratios[f"fits.{name}.cubic.cost_ratio"] = excess[name] / min(linear)
    errors = [value for fit in fits for key, value in _recovery(fit).items() if key == "cubic.max_relative_error"]
    worst = {"cubic.max_relative_error": errors, "cubic.cost_ratio": list(ratios.values())}
    return ratios | {key: max(values) for key, values in worst.items() if values}


def _fit(fit: FitContent) -> dict[str, float]:
    found: dict[str, float] = {"converged": float(fit.status == "converged"), "misfit": fit.estimates.misfit}
    if fit.grade is not None:
        found["grade"] = fit.grade.value
    found |= parameter_summary(fit.estimates.rows)
    found["undetermined"] = len(fit.estimates.undetermined)
    if fit.element_errors is not None:
        found |= {f"model_error.{key}": value for key, value in asdict(fit.element_errors).items()}
    for role, rows in (("estimation", fit.estimation_costs), ("validation", fit.validation_costs)):
        costs = average_and_worst(rows)
        if costs is not None:
            found |= {f"{role}.average_configuration_cost": costs[0], f"{role}.worst_configuration_cost": costs[1].cost}
        ratios = [row.cost / row.expected_cost for row in rows if row.expected_cost]
        if ratios:
            found |= {f"{role}.average_cost_over_noise": fmean(ratios), f"{role}.worst_cost_over_noise": max(ratios)}
    found |= {"starts": len(fit.starts), "starts_at_best": sum(row.minimum_index == 0 for row in fit.starts)}
    used = effort(fit.starts)
    if used is not None:
        found |= {"evaluations.median": used.median, "evaluations.max": used.most, "cap_share": used.cap_share}
    distances = [abs(error) for error, _ in resonance_errors(fit.resonances)]
    if distances:
        found |= {"resonances.median_relative_error": median(distances), "resonances.count": len(distances)}
    for row in fit.file_doubts:
        found |= {f"doubts.{row.name}.amount": row.amount, f"doubts.{row.name}.half_width": row.half_width}
    return found | _modes(fit) | _recovery(fit)


def _modes(fit: FitContent) -> dict[str, float]:
    """Peaks and dips, poles and zeros, measured and of the model, numbered by rising frequency.

    `measured_hz` and `model_hz` are poles or zeros, `peak_hz` and `model_peak_hz` are peaks or dips; `mean_...` are
    those of several measurements.
    """
    found: dict[str, float] = {}
    counts: Counter[str] = Counter()
    for row in fit.resonances:
        place = f"resonances.configuration_{row.configuration + 1}.{row.channel}.{row.kind}"
        counts[place] += 1
        values = {"measured_hz": row.pole_hz, "model_hz": row.mode_hz}
        values |= {"peak_hz": row.measured_hz, "model_peak_hz": row.model_hz}
        intervals = {"measured": row.pole_interval_hz, "model": row.mode_interval_hz, "peak": row.interval_hz}
        for key, ends in intervals.items():
            values |= {} if ends is None else {f"{key}_lower_hz": ends[0], f"{key}_upper_hz": ends[1]}
        values |= {} if row.repeat is None else repeat_summary(row.repeat)
        found |= {f"{place}_{counts[place]}.{key}": value for key, value in values.items() if value is not None}
    return found


def _recovery(fit: FitContent) -> dict[str, float]:
    found: dict[str, float] = {"identifiable": sum(row.identifiable for row in fit.estimates.rows)}
    springs = [row for row in fit.estimates.rows if row.kind == "stiffness"]
    widths = [(row.upper - row.lower) / 2 / abs(row.middle) for row in springs if row.identifiable and row.middle]
    if widths:
        found["springs.median_half_width"] = median(widths)
    errors = [abs(row.estimate / row.truth - 1) for row in springs if row.truth]
    if errors:
        found |= {
            "springs.median_error": median(errors),
            "springs.worst_error": max(errors),
            "springs.within_2_percent": sum(error <= _CLOSE for error in errors),
        }
    cubic = [row for row in fit.estimates.rows if row.kind == "cubic" and row.identifiable and row.truth]
    if cubic:
        found["cubic.max_relative_error"] = max(abs(row.estimate / row.truth - 1) for row in cubic if row.truth)
    covered = [row.covered for row in fit.estimates.rows if row.identifiable and row.covered is not None]
    if covered:
        found["coverage"] = fmean(covered)
    repeated = [
        row.bootstrap[0] <= row.truth <= row.bootstrap[1]
        for row in fit.estimates.rows
        if row.identifiable and row.bootstrap is not None and row.truth is not None
    ]
    if repeated:
        found["coverage_bootstrap"] = fmean(repeated)
    return found


def report(shown: Shown) -> FitReport:
    """Lays out an elastic fit for page, terminal and summary."""
    validation = None if shown.validation is None else validation_from_artifact(shown.validation)
    return fit_report(fit_content(shown), validation, shown.told)


def compare(every: Sequence[Shown]) -> dict[str, float]:
    """Returns the numbers that compare elastic fits, by dotted name."""
    return comparison([fit_content(shown) for shown in every])


def fit_report(fit: FitContent, validation: Validation | None = None, told: tuple[str, ...] = ()) -> FitReport:
    """Puts together all that is shown of a fit.

    Args:
        fit: The fit.
        validation: Its validation, if any.
        told: What the page warns of anyway.
    """
    return FitReport(
        headline=headline(fit),
        verdict=_verdict(fit, validation),
        grade=None if fit.grade is None else fit.grade.value,
        sections=sections(fit, told),
        parameters=fit.estimates.rows,
        summary=fit_summary(fit, validation),
        terminal=tuple(fit_tables(fit)),
    )


def _verdict(fit: FitContent, validation: Validation | None) -> str:
    """Says what is identified, whether the model holds, and what is known of the truth."""
    found = [] if fit.grade is None else [fit.grade.sentence]
    found.append(f"{identified_phrase(fit.estimates, usable=fit.usable)}.")
    if fit.usable:
        found.append(misfit_sentence(fit.estimates))
    if validation is None:
        found.append("Not validated: no campaign was named to hold it against.")
    else:
        # What fails the validation stands in the grade's sentence.
        found.append(f"The model {validation.outcome.verdict}." if validation.outcome.ok else "")
        found.append(recovery_sentence(validation.outcome.recovery))
    return " ".join(sentence for sentence in found if sentence)
