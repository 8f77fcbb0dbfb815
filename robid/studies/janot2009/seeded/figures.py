"""What the seeds of a simulated machine say: figures, verdicts, errors against the truth, residuals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.families.rigid.page.charts import course, histogram, weights
from robid.fit.rigid.solution import RowResiduals
from robid.report.numbers import MISSING, percent, significant
from robid.report.section import Beside, Figure, Part, Table
from robid.settings.study import SeededCase
from robid.studies.janot2009.part import Asked
from robid.studies.janot2009.seeded.chunks import FILTERS, TESTS, Judged

VERDICTS = {"good": Asked(lower=0.95), "bad": Asked(lower=0.95)}
_BIAS_ALLOWED = 2.0  # per cent
_DEVIATIONS = 3.0


@dataclass(frozen=True)
class Errors:
    """Errors of the means over the seeds, in per cent of the truth, of a vector's parts of its norm.

    Attributes:
        least_squares (n_param,): Of least squares.
        instruments (n_param,): Of the instrumental variables.
        standard (n_param,): Standard errors of these.
    """

    least_squares: FloatArray
    instruments: FloatArray
    standard: FloatArray

    @property
    def excess(self) -> float:
        """Largest error of the instrumental variables over what is allowed: 3 standard errors, or 2 %."""
        allowed = np.maximum(_DEVIATIONS * self.standard, _BIAS_ALLOWED)
        return float(np.max(self.instruments / allowed))


def errors_of(judged: Judged) -> Errors:
    """Compares the means over the seeds with the truth."""
    relative = 100 / judged.size
    scatter = judged.instrumental.std(axis=0, ddof=1) / np.sqrt(len(judged.instrumental))
    return Errors(
        np.abs(judged.plain.mean(axis=0) - judged.truth) * relative,
        np.abs(judged.instrumental.mean(axis=0) - judged.truth) * relative,
        scatter * relative,
    )


def verdict_figures(name: str, found: Mapping[str, Judged]) -> dict[str, float]:
    """Returns shares of right verdicts and of alarms, and the residuals' mean deviation, by filter."""
    figures: dict[str, float] = {f"{name}.seeds": len(found["good"].trust)}
    for filters, judged in found.items():
        trusted = float(judged.trust.mean())
        figures[f"{name}.{filters}.verdict_share"] = trusted if filters == "good" else 1 - trusted
        figures[f"{name}.{filters}.sigma"] = float(np.sqrt((judged.deviation**2).mean(axis=1)).mean())
        for test, share in zip(TESTS, judged.alarms.mean(axis=0).tolist(), strict=True):
            figures[f"{name}.{filters}.alarms.{test.lower()}"] = share
    return figures


def verdict_table(found: Mapping[str, Judged], case: SeededCase) -> Table:
    """Shares of the seeds that were trusted, and of those that each test spoke against."""
    rows = [
        ("Trusted", *(percent(float(found[filters].trust.mean())) for filters in FILTERS)),
        *(
            (f"Alarm: {test}", *(percent(float(found[filters].alarms[:, index].mean())) for filters in FILTERS))
            for index, test in enumerate(TESTS)
        ),
    ]
    sentences = tuple(
        (f"Seed {case.first_seed}, {cut:g} Hz", found[filters].sentence)
        for filters, cut in zip(FILTERS, (case.good_cut_hz, case.bad_cut_hz), strict=True)
    )
    heads = (f"{case.seeds} seeds", f"{case.good_cut_hz:g} Hz", f"{case.bad_cut_hz:g} Hz")
    return Table(heads, tuple(rows), title="Verdict on least squares", footer=sentences, fit="compact")


def error_table(judged: Judged, cut_hz: float) -> Table:
    """Errors of the means over the seeds."""
    errors = errors_of(judged)
    rows = tuple(
        (name, unit, significant(truth), *(percent(value / 100) for value in values))
        for name, unit, truth, *values in zip(
            judged.names,
            judged.units,
            judged.truth.tolist(),
            errors.least_squares.tolist(),
            errors.instruments.tolist(),
            errors.standard.tolist(),
            strict=True,
        )
    )
    heads = ("Parameter", "Unit", "Truth", "Least squares", "Instruments", "Standard error")
    caption = (
        "Distance of the mean over the seeds from the truth, of first moments over their norm; the standard error is"
        " that of the instruments' mean."
    )
    return Table(heads, rows, title=f"Errors at {cut_hz:g} Hz", caption=caption)


def estimate_table(found: Mapping[str, Judged], case: SeededCase) -> Table:
    """The first seed's estimates with either filter against the truth."""
    good, bad = (found[filters] for filters in FILTERS)
    rows = []
    for index, (name, unit, truth) in enumerate(zip(good.names, good.units, good.truth.tolist(), strict=True)):
        cells = [
            significant(float(values[0, index])) if row is None else significant(float(values[row, index]))
            for judged in (good, bad)
            for values, row in ((judged.plain, None), (judged.value, 1), (judged.instrumental, None))
        ]
        rows.append((name, unit, significant(truth), *cells))
    heads = (
        *("Base parameter", "Unit", "Truth"),
        *(f"{kind}, {cut:g} Hz" for cut in (case.good_cut_hz, case.bad_cut_hz) for kind in _KINDS),
    )
    return Table(heads, tuple(rows), title=f"Estimates of seed {case.first_seed}")


_KINDS = ("least squares", "Huber", "instruments")


def residual_figures(judged: Judged, joint: int, names: tuple[str, str, str]) -> tuple[Figure, Figure, Figure]:
    """Histogram, weights and course of one joint's residuals of the first seed."""
    rows = RowResiduals(judged.time_s, judged.residual, judged.residual, judged.weight)
    return (
        histogram(rows, joint, names[0], "N m"),
        weights(rows, joint, names[1], "N m"),
        course(rows, joint, names[2], "N m"),
    )


def joint_figures(found: Mapping[str, Judged], case: SeededCase, joints: tuple[str, ...]) -> Part:
    """Histograms of all joints' residuals with either filter, good ones first."""
    shown = [
        residual_figures(found[filters], index, (f"{joint}, {cut:g} Hz", "", ""))[0]
        for filters, cut in zip(FILTERS, (case.good_cut_hz, case.bad_cut_hz), strict=True)
        for index, joint in enumerate(joints)
    ]
    return Beside(tuple(shown), columns=len(joints))


def or_missing(value: float | None, *, fraction: bool = False) -> str:
    """Writes a figure that may be unknown."""
    if value is None:
        return MISSING
    return percent(value) if fraction else significant(value)
