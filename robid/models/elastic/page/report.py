"""What of an elastic fit stands on its page and at the end of a run, its figures, and the comparison of fits."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from statistics import fmean, median

from rich.console import Group

from robid.models.elastic.files import validation_from_artifact
from robid.models.elastic.judge.grading import COST_RATIO_LIMIT
from robid.models.elastic.judge.validating import Validation
from robid.models.elastic.page.fitted import Peak
from robid.models.elastic.page.gather import FitContent, NuisanceRow, fit_content
from robid.models.elastic.page.gears import gear_section
from robid.models.elastic.page.known import known_section
from robid.models.elastic.page.middles import middle_section
from robid.models.elastic.page.modes import mode_section
from robid.models.elastic.page.power import power_section, power_summary
from robid.models.elastic.page.resonances import (
    repeat_summary,
    resonance_errors,
    resonance_number,
    resonance_section,
    resonance_table,
)
from robid.models.elastic.page.signals import Signals, signal_section, signals_of
from robid.models.family import Shown
from robid.models.parameters import basis_of, parameter_summary
from robid.report.charts import BodeMatrix, BodeResponse, Mark
from robid.report.correlation import correlation_section
from robid.report.costs import (
    average_and_worst,
    campaign_title,
    cost_number,
    cost_section,
    effort,
    start_number,
    start_section,
)
from robid.report.numbers import MINUS, MISSING, number_of, percent, significant
from robid.report.page import FitReport, Headline
from robid.report.parameter_section import (
    count_identified,
    identified_phrase,
    parameter_numbers,
    parameter_section,
    parameter_table,
)
from robid.report.parameters import misfit_sentence
from robid.report.residuals import ResidualData, residual_section
from robid.report.section import Folded, Notes, Part, Section, Table
from robid.results.outcome import recovery_sentence
from robid.robot.parameters import NUISANCE_KIND

_FEW_MOTORS = 2
_CONVENTIONS = "Stiffness and damping are arm side."
_OF_LOADS = "Dampers of gears with `load_damping` are those without load."
_DEVIATION = (
    "A deviation is that of the fit's weights: of noise as the covariance has it, and of the assumed model error. The"
    " response is the mean over the realizations, as the fit takes it."
)
_OF_BRISTLES = (
    "`hysteresis` is the torque at which bristles beside a gear slip, a tenth as stiff as it: as this campaign swings"
    " the gear. It is valid for this amplitude; what sticks there is part of the spring. Dampers of these gears come"
    " out low, and their intervals hold less than they say."
)


def headline(fit: FitContent) -> Headline:
    """Picks what decides whether a fit can be used."""
    return Headline(
        name=fit.name,
        numbers=(
            *parameter_numbers(fit.estimates, usable=fit.usable),
            *resonance_number(fit.resonances),
            *cost_number(fit.estimation_costs, fit.validation_costs),
            *start_number(fit.starts),
        ),
        findings=() if fit.grade is None else tuple(finding.sentence for finding in fit.grade.findings),
        status=fit.status,
        advice=fit.advice,
    )


def sections(fit: FitContent, told: tuple[str, ...] = (), signals: tuple[Signals, ...] = ()) -> tuple[Section, ...]:
    """Lays out a fit: its responses, signals, parameters, nuisances, resonances, costs and starts."""
    return (
        _response(fit, told),
        *signal_section(signals),
        *parameter_section(fit.estimates, _conventions(fit)),
        *known_section(fit.known),
        *gear_section(fit.gears, fit.estimates.level),
        *middle_section(fit.middles),
        *nuisance_section(fit.nuisance_rows, fit.estimates.level),
        *correlation_section(fit.estimates),
        *power_section(fit.power, fit.estimates.level),
        *resonance_section(fit.resonances, fit.frf, fit.estimates.level, fit.views.modes, fit.name),
        *mode_section(fit.views.modes, fit.views.springs, fit.frf, fit.name, fit.resonances),
        *residual_section(tuple(_residuals(fit)), _DEVIATION),
        *cost_section(fit.estimation_costs, fit.validation_costs, element_sentence(fit)),
        *start_section(fit.starts),
    )


def _conventions(fit: FitContent) -> str:
    """What values are to be understood as."""
    kinds = {row.name.rpartition(".")[2] for row in fit.estimates.rows if row.kind == NUISANCE_KIND}
    more = [text for kind, text in (("load_damping", _OF_LOADS), ("hysteresis", _OF_BRISTLES)) if kind in kinds]
    return " ".join((_CONVENTIONS, *more))


def nuisance_section(rows: tuple[NuisanceRow, ...], level: float) -> tuple[Section, ...]:
    """Lays out what the data say of the robot file; nothing without nuisances."""
    if not rows:
        return ()
    off = [row for row in rows if row.is_off]
    lead = (
        f"Estimated with the parameters, from how far the robot file says that it may be off. {percent(level)} "
        f"intervals exclude that it is right in {len(off)} of {len(rows)} nuisance parameters."
    )
    parts: list[Part] = [_nuisance_table(off)] if off else []
    parts.append(Folded(f"All nuisance parameters, {len(rows)}", (_nuisance_table(rows),)))
    return (Section("What the robot file may have wrong", lead, tuple(parts), "nuisance-parameters"),)


def _nuisance_table(rows: Sequence[NuisanceRow]) -> Table:
    return Table(
        ("Nuisance parameter", "Off by", "±", "Known beforehand ±", "Unit"),
        tuple((row.name, *map(_written, (row.amount, row.half_width, row.known)), row.unit) for row in rows),
        caption="Off by: what is true less what the file says, to first order where no robot could be moved along.",
        styles=("name", "strong", "number", "number", "text"),
    )


def _written(value: float) -> str:
    return f"{value:.3g}".replace("-", MINUS) if math.isfinite(value) else MISSING


def fit_tables(fit: FitContent) -> Iterator[Group]:
    """Yields what the end of a run shows of a fit: its parameters and, of a small drive, its resonances."""
    yield parameter_table(fit.estimates)
    if fit.resonances and len(fit.frf.input_names) <= _FEW_MOTORS:
        yield resonance_table(fit)


def element_sentence(fit: FitContent) -> str:
    """Says what the residuals hold beyond their covariance; empty where that is unknown."""
    errors = fit.model_error
    if errors is None:
        return ""
    level = f", where the model is off by {percent(errors.median_level)} (median)" if errors.median_level > 0 else ""
    return (
        f"Beyond their covariance are {percent(errors.share_above)} of the elements{level}; the residuals of "
        f"{percent(errors.share_correlated)} are correlated over frequency. Of an exact model 5 % would be either."
    )


def _residuals(fit: FitContent) -> Iterator[ResidualData]:
    """The residuals of the fit's own data, and of its validation's."""
    own = campaign_title("Estimation", fit.campaign), fit.frf, fit.views.own, fit.views.peaks
    new = campaign_title("Validation", fit.validation_campaign), fit.validation_frf, fit.views.new, fit.views.new_peaks
    for name, frf, lines, peaks in (own, new):
        if frf is not None and lines is not None:
            marks = tuple((peak.channel, peak.frequency_hz, _mark(peak)) for peak in peaks)
            yield ResidualData(name, frf.frequency_hz, frf.output_names, frf.input_names, lines, marks)


def _mark(peak: Peak) -> str:
    place = f"configuration {number_of(peak.configuration)}"
    return f"{peak.channel}, {place}: {significant(peak.frequency_hz, 4)} Hz"


def _response(fit: FitContent, told: tuple[str, ...]) -> Section:
    marks = tuple(Mark(row.configuration, row.channel, row.measured_hz) for row in fit.resonances if row.measured_hz)
    title = "measured resonances and antiresonances of this channel"
    label = campaign_title("Estimation", fit.campaign)
    responses = [BodeResponse(label, fit.frf, (("model", fit.model_response),), marks, title)]
    if fit.validation_frf is not None and fit.validation_model is not None:
        label = campaign_title("Validation", fit.validation_campaign)
        responses.append(BodeResponse(label, fit.validation_frf, (("model", fit.validation_model),)))
    notes = [note for note in fit.frf.notes if note not in told]
    parts: list[Part] = [BodeMatrix("", tuple(responses), fit.estimates.level)]
    parts += [Notes(tuple(notes))] if notes else []
    lead = (
        "Torque to acceleration, both motor side, measured against model. Every column is one input, every row one"
        " output; select an element to enlarge it."
    )
    return Section("Frequency response", lead, tuple(parts), "response")


_CLOSE = 0.02
_MODEL_ERROR = ("share_above", "share_correlated", "median_level")
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
    if fit.model_error is not None:
        found |= {f"model_error.{key}": getattr(fit.model_error, key) for key in _MODEL_ERROR}
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
    for row in fit.nuisance_rows:
        found |= {f"doubts.{row.name}.amount": row.amount, f"doubts.{row.name}.half_width": row.half_width}
    for gear in fit.gears:
        alone = dict(zip(("lower", "upper"), gear.alone, strict=True))
        found |= {f"gears.{gear.name}.alone_{end}": value for end, value in alone.items()}
    return found | power_summary(fit.power) | _modes(fit) | _recovery(fit)


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
    found: dict[str, float] = {"identified": float(count_identified(fit.estimates.rows))}
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
    worst = ("", "") if validation is None else worst_error(validation)
    fit = fit_content(shown)
    found = fit_report(fit, validation, shown.told, signals_of(shown, fit))
    return replace(found, basis=basis_of(shown, worst))


def worst_error(validation: Validation) -> tuple[str, str]:
    """Writes the largest error over what noise and the assumed model error allow, with where, and its limit."""
    place = number_of(validation.worst_configuration)
    return f"{significant(validation.cost_ratio, 2)} of allowed, configuration {place}", significant(COST_RATIO_LIMIT)


def compare(every: Sequence[Shown]) -> dict[str, float]:
    """Returns the numbers that compare elastic fits, by dotted name."""
    return comparison([fit_content(shown) for shown in every])


def fit_report(
    fit: FitContent,
    validation: Validation | None = None,
    told: tuple[str, ...] = (),
    signals: tuple[Signals, ...] = (),
) -> FitReport:
    """Puts together all that is shown of a fit."""
    return FitReport(
        headline=headline(fit),
        verdict=_verdict(fit, validation),
        grade=None if fit.grade is None else fit.grade.value,
        sections=sections(fit, told, signals),
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
        found.append("Not validated: no campaign was named to validate it on.")
    else:
        # What fails the validation stands in the grade's sentence.
        found.append(f"The model {validation.outcome.verdict}." if validation.outcome.ok else "")
        found.append(recovery_sentence(validation.outcome.recovery))
    return " ".join(sentence for sentence in found if sentence)
