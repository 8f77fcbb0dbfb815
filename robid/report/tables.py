"""Rows of the page's tables: numbers written out, reasons said."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import groupby
from statistics import median

from robid.report.content import (
    CostRow,
    ExcitationRow,
    FitContent,
    ParameterRow,
    ResonanceRow,
    StartRow,
)
from robid.report.numbers import MISSING, Scale, number_of, percent, pretty_unit, scale_for, significant
from robid.report.summary import average_and_worst, effort, resonance_errors

KIND_TITLES = {
    "stiffness": "Springs",
    "damping": "Dampers",
    "viscous": "Equivalent viscous friction",
    "motor_inertia": "Motor inertias",
    "link_inertia": "Link inertias",
    "cubic": "Cubic stiffness",
    "location": "Locations of springs",
    "delay": "Delay",
    "friction": "Torque nonlinearities (nuisance)",
}
NUISANCE = "friction"
_SYMBOLS = {
    "stiffness": "k",
    "cubic": "k3",
    "damping": "d",
    "viscous": "d",
    "motor_inertia": "J1",
    "link_inertia": "J2",
}


@dataclass(frozen=True)
class ParameterLine:
    """A parameter as text; the numbers share one scale."""

    name: str
    unit: str
    nominal: str
    estimate: str
    lower: str
    upper: str
    half_width: str
    change: str
    truth: str
    off_truth: str
    covered: bool | None
    assumed: bool
    identifiable: bool
    note: str
    bootstrap: str = ""


@dataclass(frozen=True)
class CampaignCosts:
    """The costs of one campaign as text: configuration, cost, expected, excess."""

    role: str
    lines: tuple[tuple[str, str, str, str], ...]
    average: str
    worst: str


def kind_title(kind: str, torque_unit: str = "N m") -> str:
    """Names a kind of parameters, as a ratio where the torque constant is unknown: `Springs, k/K_t`."""
    title = KIND_TITLES.get(kind, kind)
    return f"{title}, {_SYMBOLS[kind]}/K_t" if torque_unit != "N m" and kind in _SYMBOLS else title


def ratio_sentence(torque_unit: str) -> str:
    """Says what the values are where the torque constant is unknown; empty where it is known."""
    if torque_unit == "N m":
        return ""
    return f"The torque constant K_t is unknown: {torque_unit} stands for N m, and every value is its ratio to K_t."


def rule_sentence(fit: FitContent) -> str:
    """Says what set the width of the intervals; empty where that is unknown."""
    return f"The intervals' width is set by {fit.interval_rule}." if fit.interval_rule else ""


def widened_sentence(fit: FitContent) -> str:
    """Says by how much the intervals are widened; empty where they are not."""
    if fit.misfit <= 1:
        return ""
    return (
        f"Intervals are widened {significant(math.sqrt(fit.misfit), 2)} times: the residual is so much larger "
        "than noise and the assumed model error explain."
    )


def bootstrap_sentence(fit: FitContent) -> str:
    """Compares the bootstrap's intervals with the tabled ones; empty without a bootstrap."""
    ratios = [
        (row.bootstrap[1] - row.bootstrap[0]) / (row.upper - row.lower)
        for row in fit.parameters
        if row.bootstrap is not None and row.identifiable and row.upper > row.lower
    ]
    if not ratios:
        return ""
    return (
        f"The bootstrap over realizations gives intervals {significant(median(ratios), 2)} times as wide (median; "
        f"{significant(min(ratios), 2)} to {significant(max(ratios), 2)})."
    )


def element_sentence(fit: FitContent) -> str:
    """Says what the residuals hold beyond their covariance; empty where that is unknown."""
    errors = fit.element_errors
    if errors is None:
        return ""
    level = f", where the model is off by {percent(errors.median_level)} (median)" if errors.median_level > 0 else ""
    return (
        f"Beyond their covariance are {percent(errors.share_above)} of the elements{level}; the residuals of "
        f"{percent(errors.share_correlated)} are correlated over frequency. Of an exact model 5 % would be either."
    )


def parameter_line(row: ParameterRow, threshold: float | None = None) -> ParameterLine:
    """Writes a parameter; a row that is not identifiable says why."""
    if row.kind == NUISANCE:
        return _nuisance_line(row, threshold)
    half_width = (row.upper - row.lower) / 2
    scale = scale_for(row.estimate or row.nominal, row.unit, half_width)
    return ParameterLine(
        name=row.name,
        unit=scale.unit,
        nominal=scale.text(row.nominal),
        estimate=scale.text(row.estimate),
        lower=scale.text(row.lower),
        upper=scale.text(row.upper),
        half_width=percent(_relative_half_width(row)),
        change=percent(row.estimate / row.nominal - 1, signed=True) if row.nominal else MISSING,
        truth=scale.text(row.truth),
        off_truth=percent(row.estimate / row.truth - 1, signed=True) if row.truth else MISSING,
        covered=row.covered,
        assumed=row.assumed,
        identifiable=row.identifiable,
        note=_note(row, threshold),
        bootstrap=f"{scale.text(row.bootstrap[0])} … {scale.text(row.bootstrap[1])}" if row.bootstrap else "",
    )


def _relative_half_width(row: ParameterRow) -> float:
    """Half the interval over the estimate, or as it is for what the robot file's value is the zero of."""
    size = 1.0 if row.kind == NUISANCE else abs(row.estimate)
    return (row.upper - row.lower) / 2 / size if size else float("nan")


def _nuisance_line(row: ParameterRow, threshold: float | None) -> ParameterLine:
    """Writes a deviation from the robot file, in percentage points or samples; there is nothing to relate it to."""
    factor, unit = (1, row.unit) if row.unit else (100, "%")
    half_width = factor * (row.upper - row.lower) / 2
    known = half_width > 0 and math.isfinite(half_width)
    decimals = min(max(1 - math.floor(math.log10(half_width)), 0), 3) if known else 3

    def text(value: float | None) -> str:
        rounded = None if value is None else round(factor * value, decimals)
        return Scale(0, unit, decimals).text(rounded)

    return ParameterLine(
        name=row.name,
        unit=unit,
        nominal="",
        estimate=text(row.estimate),
        lower=text(row.lower),
        upper=text(row.upper),
        half_width="",
        change="",
        truth=text(row.truth),
        off_truth="",
        covered=row.covered,
        assumed=False,
        identifiable=row.identifiable,
        note=_note(row, threshold),
    )


def parameter_groups(fit: FitContent) -> list[tuple[str, list[ParameterLine]]]:
    """Groups a fit's parameters by kind, in the order given; nuisances are apart."""
    shown = [row for row in fit.parameters if row.kind != NUISANCE]
    order = list(dict.fromkeys(row.kind for row in shown))
    rows = sorted(shown, key=lambda row: order.index(row.kind))
    return [
        (
            kind_title(kind, fit.frf.torque_unit),
            [parameter_line(row, fit.identifiable_relative_std) for row in group],
        )
        for kind, group in groupby(rows, key=lambda row: row.kind)
    ]


def nuisance_lines(fit: FitContent) -> list[ParameterLine]:
    """Writes what the fit estimates only to get it out of the way: errors of the compensated torque."""
    return [parameter_line(row, fit.identifiable_relative_std) for row in fit.parameters if row.kind == NUISANCE]


def _note(row: ParameterRow, threshold: float | None) -> str:
    """Says why a row is not to be relied on, with the figure that decided, before what else there is to know."""
    reason = _reason(row, threshold)
    return "; ".join(text for text in (reason, row.note) if text)


def _reason(row: ParameterRow, threshold: float | None) -> str:
    limit = 0.0 if threshold is None else threshold
    if row.identifiable:
        if row.identified:
            return ""
        return f"not identified: the interval came out at ±{percent(_relative_half_width(row))}"
    decided = row.relative_std if row.predicted_relative_std is None else row.predicted_relative_std
    if decided > limit > 0:
        return f"not identifiable: predicted deviation {percent(decided)}, above {percent(limit)}"
    if row.known_relative_std is None:
        return f"not identifiable: predicted deviation {percent(decided)}"
    known = "known beforehand" if row.known_relative_std <= limit else "not identifiable: known beforehand"
    return f"{known} to {percent(row.known_relative_std)}, and the data were predicted to leave {percent(decided)}"


@dataclass(frozen=True)
class ResonanceLine:
    """A resonance as text."""

    configuration: int
    number: str
    channel: str
    kind: str
    measured: str
    interval: str
    model: str
    error: str
    within: bool | None
    mode: str
    mode_interval: str
    damping: str


def resonance_line(row: ResonanceRow) -> ResonanceLine:
    """Writes a resonance with what it can be judged by."""
    errors = resonance_errors((row,))
    low_high, own = row.interval_hz, row.mode_interval_hz
    return ResonanceLine(
        configuration=row.configuration,
        number=number_of(row.configuration),
        channel=row.channel,
        kind=row.kind,
        measured=significant(row.measured_hz, 4) if row.measured_hz is not None else "not seen",
        interval=interval_text(low_high),
        model=significant(row.model_hz, 4) if row.model_hz is not None else "none",
        error=percent(errors[0][0], signed=True) if errors else MISSING,
        within=low_high[0] <= row.model_hz <= low_high[1] if low_high and row.model_hz is not None else None,
        mode=significant(row.mode_hz, 4),
        mode_interval=interval_text(own),
        damping=percent(row.damping),
    )


def interval_text(low_high: tuple[float, float] | None) -> str:
    """Writes an interval to four digits, or more where its ends would look the same."""
    if low_high is None:
        return MISSING
    for digits in (4, 5):
        low, high = (significant(value, digits) for value in low_high)
        if low != high:
            break
    return f"{low} … {high}"


def resonance_sentence(rows: tuple[ResonanceRow, ...]) -> str:
    """Says how far the model's resonances are from the measured ones."""
    errors = resonance_errors(rows)
    if not errors:
        return ""
    worst, row = max(errors, key=lambda item: abs(item[0]))
    middle = median(abs(error) for error, _ in errors)
    return (
        f"{len(errors)} pairs; the model is off by {percent(middle)} in the median and by {percent(abs(worst))} "
        f"at worst, the {row.kind} of {row.channel} at {significant(row.measured_hz, 4)} Hz in configuration "
        f"{number_of(row.configuration)}."
    )


def campaign_title(role: str, campaign: str) -> str:
    """Names a campaign by its role, and by its name where that says more."""
    return role if campaign.lower() in {"", role.lower()} else f"{role}: {campaign}"


def cost_tables(fit: FitContent) -> list[CampaignCosts]:
    """Writes the costs of estimation and validation."""
    named = (("Estimation", fit.estimation_costs), ("Validation", fit.validation_costs))
    return [_cost_table(role, rows) for role, rows in named if rows]


def _cost_table(role: str, rows: tuple[CostRow, ...]) -> CampaignCosts:
    found = average_and_worst(rows)
    average, worst = found if found is not None else (float("nan"), rows[0])
    lines = tuple(
        (
            number_of(row.configuration),
            significant(row.cost, 4),
            significant(row.expected_cost, 4),
            significant(row.excess, 3),
        )
        for row in rows
    )
    worst_text = f"{significant(worst.cost, 4)} (configuration {number_of(worst.configuration)})"
    return CampaignCosts(campaign_title(role, rows[0].campaign), lines, significant(average, 4), worst_text)


def effort_text(rows: tuple[StartRow, ...]) -> str:
    """Says how often the starts computed the cost and how many the iteration limit ended; nothing if not counted."""
    found = effort(rows)
    if found is None:
        return ""
    return (
        f"They computed the cost {found.median:.0f} times (median), at most {found.most} times;"
        f" {percent(found.cap_share)} ended at the iteration limit."
    )


def start_lines(rows: tuple[StartRow, ...]) -> list[tuple[str, str, str, str, str, str]]:
    """Writes the starts by cost: start, cost, minimum, iterations, evaluations, status."""
    return [
        (
            number_of(row.index),
            significant(row.cost, 7),
            number_of(row.minimum_index),
            str(row.iterations),
            MISSING if row.evaluations is None else str(row.evaluations),
            row.status,
        )
        for row in sorted(rows, key=lambda row: (row.minimum_index, row.cost))
    ]


@dataclass(frozen=True)
class PeakLine:
    """A predicted peak as text, with its share of the limit."""

    channel: str
    quantity: str
    rms: str
    predicted: str
    limit: str
    share: float

    @property
    def share_text(self) -> str:
        """The share in percent."""
        return percent(self.share)


def peak_lines(row: ExcitationRow) -> list[PeakLine]:
    """Writes the predicted peaks of one campaign."""
    return [
        PeakLine(
            channel=peak.channel,
            quantity=peak.quantity,
            rms=MISSING if peak.rms is None else f"{significant(peak.rms, 3)} {pretty_unit(peak.unit)}",
            predicted=f"{significant(peak.predicted, 3)} {pretty_unit(peak.unit)}",
            limit=f"{significant(peak.limit, 3)} {pretty_unit(peak.unit)}",
            share=peak.predicted / peak.limit if peak.limit else float("nan"),
        )
        for peak in row.peaks
    ]


def rms_text(row: ExcitationRow) -> str:
    """Writes the RMS of an excitation: once when all channels have the same."""
    values = sorted(set(row.rms))
    unit = pretty_unit(row.rms_unit)
    if not values:
        return MISSING
    if len(values) == 1:
        return f"{significant(values[0], 3)} {unit}"
    return f"{significant(values[0], 3)} … {significant(values[-1], 3)} {unit}"
