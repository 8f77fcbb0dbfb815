"""What the seeds of a simulated machine say: figures, verdicts, errors against the truth, residuals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.models.rigid.fit.solution import RowResiduals
from robid.models.rigid.page import course, histogram, weights
from robid.report.numbers import MISSING, percent, significant
from robid.report.section import Beside, Figure, Notes, Part, Table
from robid.studies.janot2009.seeded import FILTERS, TESTS, Judged
from robid.studies.settings.parts import SeededCase
from robid.studies.study import Asked

VERDICTS = {"good": Asked(lower=0.95), "bad": Asked(lower=0.95)}
_BIAS_ALLOWED = 2.0  # per cent
_DEVIATIONS = 3.0


@dataclass(frozen=True)
class Errors:
    """Errors of the means over the seeds, in per cent of the truth, of a vector's parts of its norm."""

    least_squares: FloatArray  # (n_param,) of least squares
    instruments: FloatArray  # (n_param,) of the instrumental variables
    standard: FloatArray  # (n_param,) standard errors of these

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


def verdict_parts(found: Mapping[str, Judged], case: SeededCase) -> tuple[Table, Notes]:
    """Shares of the seeds that were trusted, and of those that each test spoke against; the words on the first seed."""
    rows = [
        ("Trusted", *(percent(float(found[filters].trust.mean())) for filters in FILTERS)),
        *(
            (f"Alarm: {test}", *(percent(float(found[filters].alarms[:, index].mean())) for filters in FILTERS))
            for index, test in enumerate(TESTS)
        ),
    ]
    heads = (f"{case.seeds} seeds", *(f"{cut:g} Hz" for cut in cuts(case)))
    said = tuple(
        f"Seed {case.first_seed}, {cut:g} Hz: {found[filters].sentence}"
        for filters, cut in zip(FILTERS, cuts(case), strict=True)
    )
    return Table(heads, tuple(rows), title="Verdict on least squares", fit="compact"), Notes(said)


def cuts(case: SeededCase) -> tuple[float, float]:
    """Returns the cut-offs in the order of `FILTERS` [Hz]."""
    return case.good_cut_hz, case.bad_cut_hz


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


def estimate_tables(found: Mapping[str, Judged], case: SeededCase) -> tuple[Table, ...]:
    """The first seed's estimates with either filter against the truth."""
    tables = []
    for filters, cut in zip(FILTERS, cuts(case), strict=True):
        judged = found[filters]
        values = np.stack([judged.truth, judged.plain[0], judged.value[1], judged.instrumental[0]], axis=1)
        rows = tuple(
            (f"{name} [{unit}]", *(significant(each) for each in row))
            for name, unit, row in zip(judged.names, judged.units, values.tolist(), strict=True)
        )
        heads = ("Base parameter", "Truth", "Least squares", "Huber", "Instruments")
        tables.append(Table(heads, rows, title=f"Estimates of seed {case.first_seed} at {cut:g} Hz", fit="compact"))
    return tuple(tables)


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
        for filters, cut in zip(FILTERS, cuts(case), strict=True)
        for index, joint in enumerate(joints)
    ]
    return Beside(tuple(shown), columns=len(joints))


def outlier_share(judged: Judged) -> float:
    """Returns the share of the first seed's residuals beyond three deviations."""
    residual = judged.residual[np.isfinite(judged.residual)]
    return float(np.mean(np.abs(residual) > _DEVIATIONS * residual.std()))


def or_missing(value: float | None, *, fraction: bool = False) -> str:
    """Writes a figure that may be unknown."""
    if value is None:
        return MISSING
    return percent(value) if fraction else significant(value)
