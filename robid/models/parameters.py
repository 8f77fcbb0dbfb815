"""What every family shows of a fit alike: its parameters, headline, verdict and summary."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from statistics import NormalDist
from typing import TYPE_CHECKING, Any

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.artifacts.results import grade_from_artifact
from robid.report.page import Basis, FitReport, Headline, KeyNumber
from robid.report.parameter_section import count_identified, identified_phrase, parameter_numbers, parameter_table
from robid.report.parameters import Estimates, ParameterRow
from robid.report.section import Curve, Section
from robid.results.estimate import Estimate
from robid.results.grade import Grade
from robid.results.outcome import Outcome
from robid.robot.parameters import PARAMETER_KINDS, name_of, owner_of

if TYPE_CHECKING:
    from robid.models.family import Shown

MOST_POINTS = 1500
"""Points of a curve that a page can draw."""
MEASURED, MODEL, ERROR, GREY = 0, 1, 3, 4
"""Shades of what figures show: what was commanded or measured, what a model says, differences, and limits."""


def fit_report(
    shown: Shown,
    estimate: Estimate,
    estimates: Estimates,
    outcome: Outcome | None,
    *,
    found: str,
    numbers: Iterable[KeyNumber],
    sections: tuple[Section, ...],
    summary: Mapping[str, float],
    terminal: Estimates | None = None,
    unknown: str = "",
    worst: tuple[str, str] = ("", ""),
) -> FitReport:
    """Lays out a fit for page, terminal and summary.

    `unknown` is a sentence on what its data cannot show, `worst` its worst error on new data and the limit of that.
    """
    grade = grade_from_artifact(shown.model) if outcome is None else outcome.grade
    common = {
        "grade": float(grade.value),
        "converged": float(estimate.status == "converged"),
        "identified": float(count_identified(estimates.rows)),
    }
    return FitReport(
        headline=Headline(
            name=shown.data.name,
            numbers=(*parameter_numbers(estimates, usable=grade.value > 0), *numbers),
            findings=tuple(finding.sentence for finding in grade.findings),
            status=estimate.status.replace("_", " "),
            advice=estimate.advice,
        ),
        verdict=" ".join(
            text
            for text in (grade.sentence, _told(found, estimates, grade), unknown, _validated(shown, outcome))
            if text
        ),
        grade=grade.value,
        sections=sections,
        parameters=estimates.rows,
        summary={**common, **summary, **parameter_summary(estimates.rows)},
        terminal=(parameter_table(estimates if terminal is None else terminal),),
        basis=basis_of(shown, worst),
    )


def _validated(shown: Shown, outcome: Outcome | None) -> str:
    """Says what the validation found where there is one; what fails it stands in the grade's sentence."""
    if outcome is not None:
        return f"The model {outcome.verdict}." if outcome.ok else ""
    named = shown.data.settings.validate_on is not None
    return "Not validated." if named else "Not validated: no campaign was named to validate it on."


def basis_of(shown: Shown, worst: tuple[str, str]) -> Basis:
    """Says what a fit's grade rests on; `worst` is its worst error on new data, and the limit of that."""
    settings = shown.data.settings
    validated = "" if shown.validation is None else settings.validate_on or ""
    return Basis(settings.campaigns, validated, *worst)


def _told(found: str, estimates: Estimates, grade: Grade) -> str:
    """Says what was found, and how many of the parameters are identified."""
    counted = identified_phrase(estimates, usable=grade.value > 0) if estimates.rows else ""
    told = ", ".join(text for text in (found, counted) if text)
    return f"{told}." if told else ""


def estimates_of(
    shown: Shown, estimate: Estimate, assumed: Collection[str] = (), torque_unit: str = "N m"
) -> Estimates:
    """Returns the parameters of a fit as rows, with what holds for all of them; arguments as of `parameter_rows`."""
    return Estimates(
        rows=parameter_rows(estimate, shown.true, assumed, torque_unit),
        level=estimate.confidence,
        torque_unit=torque_unit,
        undetermined=estimate.undetermined,
        identifiable_relative_std=estimate.identifiable_relative_std,
        interval_rule=estimate.interval_rule,
        covariance=estimate.covariance,
    )


def quantile(confidence: float) -> float:
    """Returns how many standard deviations lie on either side at a level of confidence."""
    return NormalDist().inv_cdf(0.5 + 0.5 * confidence)


def curve(
    name: str,
    x: FloatArray,
    y: FloatArray,
    shade: int | None = None,
    half: FloatArray | None = None,
    *,
    points: bool = False,
) -> Curve:
    """Returns a curve (n,), dashed where a model says it, in a band of half a width (n,) on either side, if known."""
    known = half is not None and np.isfinite(half).any()
    lower, upper = (tuple((y + sign * half).tolist()) if half is not None and known else () for sign in (-1, 1))
    look: dict[str, Any] = {"points": points, "symbol": "small", "shade": shade, "dashed": shade == MODEL}
    return Curve(name, tuple(x.tolist()), tuple(y.tolist()), lower=lower, upper=upper, **look)


def thinned(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Returns as many of the points (n,) of a curve as a page can draw."""
    step = max(1, -(-x.size // MOST_POINTS))
    return x[::step], y[::step]


def extremes(x: FloatArray, y: FloatArray, most: int = MOST_POINTS) -> tuple[FloatArray, FloatArray]:
    """Thins a curve (n,) to the smallest and the largest value of each stretch: no peak is lost."""
    kept = extreme_places(y, most)
    return x[kept], y[kept]


def extreme_places(y: FloatArray, most: int = MOST_POINTS) -> IntArray:
    """Returns where values (n,) are the smallest and the largest of each stretch, in their order; all of a few.

    A value of each stretch that is not finite stays, too: gaps do not close.
    """
    if y.size <= most:
        return np.arange(y.size)
    ends = np.linspace(0, y.size, most // 2 + 1).astype(int)
    kept: list[int] = []
    for first, end in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True):
        part = y[first:end]
        known = np.isfinite(part)
        places = set() if known.all() else {int(np.argmin(known))}
        if known.any():
            places |= {int(np.nanargmin(part)), int(np.nanargmax(part))}
        kept += [first + each for each in sorted(places)]
    return np.array(kept)


def over_time(
    name: str, time_s: FloatArray, y: FloatArray, shade: int, most: int = MOST_POINTS, half: FloatArray | None = None
) -> Curve:
    """Returns a solid curve (n,) over time whose peaks stay: what is measured is wide, so that it shows beneath others.

    Args:
        name: Its name.
        time_s (n,): Time [s].
        y (n,): Values; NaN makes a gap.
        shade: One of `MEASURED`, `MODEL`, `ERROR` and `GREY`.
        most: Points that are left of it.
        half (n,): Half the width of a band around it, or None.
    """
    kept = extreme_places(y, most)
    drawn = curve(name, time_s[kept], y[kept], shade, None if half is None else half[kept])
    return replace(drawn, dashed=False, width=2.8 if shade == MEASURED else 1.2)


def with_torque_unit(unit: str, torque_unit: str) -> str:
    """Writes a unit with what stands for N m where the torque constant is unknown."""
    if torque_unit == "N m":
        return unit
    unit = {"kg": "N m s^2/m^2", "kg m": "N m s^2/m", "N/m": "N m/m^2", "N s/m": "N m s/m^2", "N/m^3": "N m/m^4"}.get(
        unit, unit
    )
    return unit.replace("kg m^2", "N m s^2/rad").replace("N m", torque_unit)


def parameter_rows(
    estimate: Estimate, truth: Mapping[str, float], assumed: Collection[str] = (), torque_unit: str = "N m"
) -> tuple[ParameterRow, ...]:
    """Turns estimated parameters into rows."""
    return tuple(_row(estimate, index, truth, assumed, torque_unit) for index in range(len(estimate.names)))


def parameter_summary(rows: Sequence[ParameterRow]) -> dict[str, float]:
    """Returns what is known of each parameter in numbers, by dotted name."""
    return {
        f"parameters.{name_of(row.name, row.kind)}.{key}": value for row in rows for key, value in _numbers(row).items()
    }


def _row(
    estimate: Estimate, index: int, truth: Mapping[str, float], assumed: Collection[str], torque_unit: str
) -> ParameterRow:
    name, kind, unit = estimate.names[index], estimate.kinds[index], estimate.units[index]
    owner, known = owner_of(name, kind), float(estimate.prior_relative_std[index])
    true, lower, upper = truth.get(name), float(estimate.lower[index]), float(estimate.upper[index])
    followers = zip(estimate.tied.names, estimate.tied.to, strict=True)
    shared = [owner_of(tied, kind) for tied, leader in followers if leader == name]
    return ParameterRow(
        name=owner,
        kind=kind,
        unit="" if unit == "1" else with_torque_unit(unit, torque_unit),
        nominal=float(estimate.nominal[index]),
        estimate=float(estimate.value[index]),
        lower=lower,
        upper=upper,
        relative_std=float(estimate.relative_std[index]),
        truth=true,
        identifiable=bool(estimate.identifiable[index]),
        identified=bool(estimate.identified[index]),
        predicted_relative_std=float(estimate.predicted_relative_std[index]),
        known_relative_std=known if np.isfinite(known) else None,
        covered=None if true is None else lower <= true <= upper,
        assumed=any(f"{owner}.{field}" in assumed for field in PARAMETER_KINDS[kind].fields),
        physical=None if estimate.physical_value is None else float(estimate.physical_value[index]),
        effective=_effective(estimate, index),
        note=f"shared by {', '.join(shared)}" if shared else "",
    )


def _effective(estimate: Estimate, index: int) -> tuple[float, float, float] | None:
    value, lower, upper = estimate.effective_value, estimate.effective_lower, estimate.effective_upper
    if value is None or lower is None or upper is None:
        return None
    return float(value[index]), float(lower[index]), float(upper[index])


def _numbers(row: ParameterRow) -> dict[str, float]:
    values = {
        "nominal": row.nominal,
        "estimate": row.estimate,
        "lower": row.lower,
        "upper": row.upper,
        "relative_std": row.relative_std,
        "identifiable": float(row.identifiable),
        "physical_value": row.physical,
        **dict(zip(("effective_value", "effective_lower", "effective_upper"), row.effective or (), strict=False)),
        "realization_relative_std": row.realization_relative_std,
        **dict(zip(("bootstrap_lower", "bootstrap_upper"), row.bootstrap or (), strict=False)),
        "truth": row.truth,
        "covered": None if row.covered is None else float(row.covered),
    }
    return {name: value for name, value in values.items() if value is not None}
