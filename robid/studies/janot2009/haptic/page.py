"""The haptic device: Tables 1 to 6 and Figs 2 to 5 of the paper beside ours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from robid.artifacts.artifact import Artifact
from robid.pipeline.graph import Run
from robid.report.numbers import MISSING, percent, significant
from robid.report.section import Beside, Section, Table
from robid.studies.janot2009.section import study_of
from robid.studies.janot2009.seeded.chunks import BENDS, FILTERS, Judged, gather
from robid.studies.janot2009.seeded.figures import (
    VERDICTS,
    cuts,
    error_table,
    errors_of,
    or_missing,
    outlier_share,
    residual_figures,
    verdict_figures,
    verdict_parts,
)
from robid.studies.paper import paper_figures
from robid.studies.part import Asked, PartFound
from robid.studies.settings.study import SeededCase

_PLAIN, _HUBER, _PAPERS_BEND = range(3)
_SIGMA = "sigma"


def conclude_haptic(run: Run, results: Sequence[Artifact]) -> PartFound | None:
    """Turns the device's seeds into figures, tables beside the paper's, and what is asked of them."""
    study = study_of(run.loaded)
    case = study.haptic
    if case is None:
        return None
    found = {filters: gather(results, filters) for filters in FILTERS}
    paper = paper_figures(study.paper, run.loaded)
    figures = verdict_figures("haptic", found) | _error_figures(found["bad"]) | _table_figures(found)
    return PartFound(figures, _ASKED, (_tables(found, case, paper), _figures(found, case), _seeds(found, case)))


_ASKED = {
    "haptic.good.sigma": Asked(0.008, 0.012),
    "haptic.bad.sigma": Asked(0.031, 0.047),
    **{f"haptic.{filters}.verdict_share": asked for filters, asked in VERDICTS.items()},
    "haptic.iv.max_error_percent": Asked(upper=5.0),
    "haptic.iv.max_excess": Asked(upper=1.0),
    "haptic.ls.max_error_percent": Asked(lower=20.0),
}


def _error_figures(bad: Judged) -> dict[str, float]:
    errors = errors_of(bad)
    return {
        "haptic.iv.max_error_percent": float(errors.instruments.max()),
        "haptic.iv.max_excess": errors.excess,
        "haptic.ls.max_error_percent": float(errors.least_squares.max()),
    }


def _table_figures(found: Mapping[str, Judged]) -> dict[str, float]:
    """The first seed's variations of eq. 22, sigma among them, and Huber's passes."""
    figures: dict[str, float] = {}
    for filters, judged in found.items():
        figures |= {f"haptic.{filters}.e.{name}": value for name, value in variations(judged, _HUBER).items()}
        figures[f"haptic.{filters}.huber_iterations"] = float(judged.iterations[_HUBER])
    return figures


def variations(judged: Judged, row: int) -> dict[str, float]:
    """Relative variations (eq. 22) of one of Huber's estimates from least squares, by parameter and `sigma` [%]."""
    plain = np.append(judged.value[_PLAIN], judged.sigma[_PLAIN])
    other = np.append(judged.value[row], judged.sigma[row])
    relative = 100 * np.abs((plain - other) / plain)
    return dict(zip((*judged.names, _SIGMA), relative.tolist(), strict=True))


def _tables(found: Mapping[str, Judged], case: SeededCase, paper: Mapping[str, Any]) -> Section:
    good, bad = (found[filters] for filters in FILTERS)
    nominal = paper.get("nominal", {})
    first, second = f"{case.good_cut_hz:g} Hz", f"{case.bad_cut_hz:g} Hz"
    tables = (
        _estimates(f"Table 1: least squares, {first}", good, _PLAIN, paper.get("table_1", {}), nominal),
        _estimates(f"Table 2: Huber, {first}", good, _HUBER, paper.get("table_2", {}), nominal),
        _estimates(f"Table 3: least squares, {second}", bad, _PLAIN, paper.get("table_3", {}), nominal),
        _estimates(f"Table 4: Huber, {second}", bad, _HUBER, paper.get("table_4", {}), nominal),
        _estimates(f"Table 5: Huber with H = 0.2, {second}", bad, _PAPERS_BEND, paper.get("table_5", {}), nominal),
        _variation_table(found, case, paper),
    )
    lead = (
        f"The device of the paper, simulated with its nominal values (MY1 as identified); seed {case.first_seed}."
        " Deviations are relative (eq. 9), by eq. 8 and 19 as the paper has them, which takes residuals for"
        " independent."
    )
    return Section("Haptic device: Tables 1 to 6", lead, (Beside(tables, columns=2), *_limits(found, case)))


def _estimates(title: str, judged: Judged, row: int, paper: Mapping[str, Any], nominal: Mapping[str, float]) -> Table:
    value, deviation = paper.get("value", {}), paper.get("deviation", {})
    own = np.abs(judged.std[row] / judged.value[row]).tolist()
    rows = tuple(
        (
            f"{name} [{unit}]",
            or_missing(nominal.get(name)),
            or_missing(value.get(name)),
            or_missing(deviation.get(name), fraction=True),
            significant(estimate),
            percent(relative),
        )
        for name, unit, estimate, relative in zip(
            judged.names, judged.units, judged.value[row].tolist(), own, strict=True
        )
    )
    sigma = ("sigma [N m]", "", or_missing(paper.get(_SIGMA)), "", significant(float(judged.sigma[row, 0])), "")
    passes = ("passes", "", str(paper.get("iterations", MISSING)), "", str(int(judged.iterations[row])), "")
    heads = ("Parameter", "Nominal", "Paper", "Deviation", "Ours", "Deviation")
    return Table(heads, (*rows, sigma, *([passes] if row else [])), title=title)


def _variation_table(found: Mapping[str, Judged], case: SeededCase, paper: Mapping[str, Any]) -> Table:
    printed, below = paper.get("table_6", {}), paper.get("table_6_below", {})
    good, bad = (variations(found[filters], _HUBER) for filters in FILTERS)
    rows = tuple(
        (
            f"%e({name})",
            f"< {percent(below[name])}" if name in below else or_missing(printed.get(name), fraction=True),
            percent(bad[name] / 100),
            percent(good[name] / 100),
        )
        for name in bad
    )
    heads = ("Variation", f"Paper, {case.bad_cut_hz:g} Hz", f"Ours, {case.bad_cut_hz:g} Hz", f"{case.good_cut_hz:g} Hz")
    caption = (
        "Least squares against Huber (eq. 22). Of the paper's own figures eq. 22 gives 26 % for sigma; its 34 % is"
        " relative to Huber's."
    )
    return Table(heads, rows, title="Table 6: relative variations", caption=caption)


def _limits(found: Mapping[str, Judged], case: SeededCase) -> tuple[Table, ...]:
    """Huber's estimates with H towards infinity and towards 0."""
    order = np.argsort(BENDS)[::-1]
    tables = []
    for filters, cut in zip(FILTERS, cuts(case), strict=True):
        judged = found[filters]
        each = [variations(judged, 1 + index) for index in order]
        rows = [(name, *(percent(round(one[name] / 100, 6)) for one in each)) for name in each[0]]
        rows.append(("passes", *(str(int(judged.iterations[1 + index])) for index in order)))
        heads = ("Variation", *(f"H = {BENDS[index]:g}" for index in order))
        tables.append(Table(heads, tuple(rows), title=f"Limits of H, {cut:g} Hz"))
    caption = (
        "Distance from least squares (eq. 22). Towards infinity Huber's estimator is least squares, towards 0 it"
        " minimises magnitudes: in the paper within 2 % at 20 Hz."
    )
    return (*tables[:-1], replace(tables[-1], caption=caption))


def _figures(found: Mapping[str, Judged], case: SeededCase) -> Section:
    good, bad = (found[filters] for filters in FILTERS)
    first, second = f"{case.good_cut_hz:g} Hz", f"{case.bad_cut_hz:g} Hz"
    second_and_third = residual_figures(
        good, 0, (f"Fig. 2: residuals, {first}", f"Fig. 3: Huber's weights, {first}", "")
    )
    others = residual_figures(
        bad, 0, (f"Fig. 4: residuals, {second}", "", f"Fig. 5: course of the residuals, {second}")
    )
    lead = (
        f"Least squares of seed {case.first_seed}. In the paper Fig. 2 is close to a Gaussian of 0.01 N m with few"
        " outliers, Fig. 3 is 1 in the middle and falls as one over the residual, Fig. 4 is no Gaussian, and Fig. 5"
        " often leaves the band of three deviations. Of ours"
        f" {percent(outlier_share(good))} lie beyond three deviations at {first}, {percent(outlier_share(bad))} at"
        f" {second}; of a Gaussian 0.27 %."
    )
    return Section(
        "Haptic device: Figs 2 to 5", lead, (Beside((*second_and_third[:2], others[0], others[2]), columns=2),)
    )


def _seeds(found: Mapping[str, Judged], case: SeededCase) -> Section:
    lead = (
        "Verdicts, and what the paper does not have: instrumental variables, whose instrument is the device simulated"
        " without noise, on the badly filtered data."
    )
    parts = (*verdict_parts(found, case), error_table(found["bad"], case.bad_cut_hz))
    return Section(f"Haptic device over {case.seeds} seeds", lead, parts)
