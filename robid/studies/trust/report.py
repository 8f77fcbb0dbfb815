"""What the study of trust found: coverage of effective and physical springs, and which causes are named."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from robid.artifacts.kinds import TASK
from robid.artifacts.store import read_artifact
from robid.pipeline.graph import Run
from robid.report.numbers import MISSING, percent, significant
from robid.report.page import Verdict
from robid.report.section import Section, Table
from robid.studies.settings.trust import FILE, LINEAR, Individual, TrustStudy, individuals
from robid.studies.simulated import REFUSAL, kept_solution, kept_truth
from robid.studies.study import Conclusion, Earlier, seconds_of, study_of
from robid.studies.trust.figures import (
    ASKED,
    RobotRow,
    Springs,
    cause_figures,
    effective_held,
    is_reached,
    largest,
    physical_held,
    set_figures,
    spring_rows,
    springs_of,
)
from robid.studies.trust.responses import DESIGNED, FRESH, RANDOM

_TITLES = {
    "effective.coverage_95": "Effective values covered",
    "effective.designed": "The same in designed places",
    "effective.worst": "Worst spring",
    "effective.half_width": "Half width",
    "effective.width_ratio": "Width ratio",
    "physical.coverage_95": "Springs covered",
    "physical.worst": "Worst spring",
    "physical.half_width": "Half width",
    "physical.width_ratio": "Width ratio",
    "trusted": "Graded trust",
    "trusted_wrong": "Trusted and wrong",
}


def conclude(run: Run, results: Earlier) -> Conclusion:
    """Turns intervals, grades and causes into figures, tables and the verdict."""
    study = study_of(run.loaded, TrustStudy)
    rows = {one.key: row for one, row in _rows(individuals(study), results)}
    summary = summarise(study, rows, results)
    asked = bars(study)
    reached = [is_reached(summary.get(name, math.nan), limits) for name, limits in asked.items()]
    judged = study.use == "judge" and study.chosen.robots is None
    text = f"{sum(reached)} of {len(reached)} figures are within what is asked."
    missed = [name for name, good in zip(asked, reached, strict=True) if not good]
    if missed:
        text = f"{text} Missed: {', '.join(missed)}."
    warnings = () if judged else ("These robots are for choosing: their figures say nothing.",)
    springs = [_spring_section(name, [rows[one.key] for one in _of(study, name)]) for name in study.sets]
    tables = _asked_section(summary, asked), _set_section(study, summary), *_cause_section(study, summary)
    return Conclusion(
        Verdict(text, "ok" if all(reached) and judged else "warn"), summary, (*tables, *springs), warnings
    )


def summarise(study: TrustStudy, rows: Mapping[str, RobotRow], results: Earlier) -> dict[str, float]:
    """Returns the figures of summary.json; what is not known is left out."""
    robots = individuals(study)
    found: dict[str, float] = {}
    heavy = []
    for name, defects in study.sets.items():
        own = [rows[one.key] for one in _of(study, name)]
        found |= set_figures(name, own, listed=defects.listed)
        heavy += own if defects.robot == "heavy" else []
        referenced = [rows[one.key].fresh for one in _of(study, name) if one.referenced]
        found[f"{name}.references_refused"] = float(sum(fit is None for fit in referenced))
    pooled = effective_held([(row.random, row.fresh) for row in heavy])
    found |= {"effective.coverage_95": pooled.coverage, "effective.coverage_std": pooled.coverage_std}
    found |= _linear_figures(robots, rows)
    ratios = [found[f"{name}.width_ratio"] for name, defects in study.sets.items() if defects.robot == "heavy"]
    drawn = study.linear is not None and study.linear.drawn > 0
    found["width_ratio"] = largest([*ratios, *([found["linear.width_ratio"]] if drawn else [])])
    found |= _named(study, robots, results)
    for name, done in zip(("place", "fit", "linear_fit", "grade"), results, strict=True):
        spans = [seconds_of(held.provenance) for held in done]
        found[f"cost.{name}_seconds"] = sum(spans) / len(spans) if spans else math.nan
    return {name: value for name, value in found.items() if math.isfinite(value)}


def bars(study: TrustStudy) -> dict[str, tuple[float, float]]:
    """Returns what is asked of a study's figures, by their names; a figure that could not be computed is missed."""
    found = {}
    for name, defects in study.sets.items():
        light = "light." if defects.robot == "light" else ""
        found[f"{name}.effective.coverage_95"] = ASKED[f"{light}effective.coverage_95"]
        if defects.robot == "light":
            continue
        if defects.listed:
            found |= {f"{name}.physical.{key}": ASKED[f"listed.physical.{key}"] for key in ("coverage_95", "worst")}
        else:
            found[f"{name}.trusted_wrong"] = ASKED["unlisted.trusted_wrong"]
    named = ["effective.coverage_95", "width_ratio"]
    if study.linear is not None:
        named += ["linear.coverage_95"] * (study.linear.drawn > 0) + ["linear.file.coverage_95"] * (
            study.linear.file > 0
        )
    named += ["causes.first", "causes.first_three"] * bool(study.causes)
    return found | {name: ASKED[name] for name in named}


def _of(study: TrustStudy, group: str) -> list[Individual]:
    return [one for one in individuals(study) if one.group == group]


def _rows(robots: Sequence[Individual], results: Earlier) -> Iterator[tuple[Individual, RobotRow]]:
    _, models, linear, grades = (done.by_name for done in results)
    for one in robots:
        if one.kind == "linear":
            yield one, RobotRow(_springs(linear[one.key]))
        elif one.kind == "set":
            found = [_springs(models.get(f"{one.key}_{use}")) for use in (RANDOM, FRESH, DESIGNED)]
            grade = read_artifact(grades[one.key], TASK).attributes.get("grade")
            own = int(grade) if isinstance(grade, int | float) else None
            yield one, RobotRow(found[0], found[1], found[2], own)


def _springs(path: Path | None) -> Springs | None:
    """Springs of a fit; None where it was refused, or there is none."""
    held = None if path is None else read_artifact(path, TASK)
    if held is None or REFUSAL in held.attributes:
        return None
    return springs_of(kept_solution(held), kept_truth(held))


def _linear_figures(robots: Sequence[Individual], rows: Mapping[str, RobotRow]) -> dict[str, float]:
    found: dict[str, float] = {}
    for group, name in ((LINEAR, "linear"), (FILE, "linear.file")):
        fits = [rows[one.key].random for one in robots if one.group == group]
        held = physical_held([fit for fit in fits if fit is not None])
        found |= {
            f"{name}.coverage_95": held.coverage,
            f"{name}.coverage_std": held.coverage_std,
            f"{name}.width_ratio": held.width_ratio,
            f"{name}.worst": held.worst,
            f"{name}.refused": sum(fit is None for fit in fits) / len(fits) if fits else math.nan,
        }
    return found


def _named(study: TrustStudy, robots: Sequence[Individual], results: Earlier) -> dict[str, float]:
    grades, kinds = results[3].by_name, {}
    for name, kind in study.causes.items():
        own = [read_artifact(grades[one.key], TASK) for one in robots if one.group == name]
        kinds[name] = kind.named, [tuple(held.datasets["causes"].values.tolist()) for held in own]
    return cause_figures(kinds)


def _asked_section(summary: Mapping[str, float], asked: Mapping[str, tuple[float, float]]) -> Section:
    rows = []
    for name, (least, most) in asked.items():
        said = f"at most {significant(most)}" if least == 0 else f"at least {significant(least)}"
        if least > 0 and most < 1:
            said = f"{significant(least)} to {significant(most)}"
        deviation = summary.get(name.replace("coverage_95", "coverage_std")) if "coverage_95" in name else None
        value = summary.get(name)
        good = "reached" if value is not None and is_reached(value, (least, most)) else "missed"
        rows.append((name, significant(value), significant(deviation), said, good))
    table = Table(("Figure", "Found", "Monte Carlo deviation", "Asked", ""), tuple(rows))
    return Section("What is asked", "Fixed before any of these robots was looked at.", (table,))


def _set_section(study: TrustStudy, summary: Mapping[str, float]) -> Section:
    rows = tuple(
        (name, *(_cell(key, summary.get(f"{name}.{key}")) for key in _TITLES), f"{summary[f'{name}.robots']:.0f}")
        for name in study.sets
    )
    caption = (
        "Springs that the data were to determine, decided before the fit. Effective: held against the same fit in fresh"
        " places, within the root of both half widths squared. Width ratio: median half width over the 95 % quantile of"
        " the absolute error, median over the springs."
    )
    return Section("Sets of robots", "", (Table(("Set", *_TITLES.values(), "Robots"), rows, caption=caption),))


def _spring_section(name: str, rows: Sequence[RobotRow]) -> Section:
    cells = tuple(
        (spring.removesuffix(".stiffness"), *(_cell("", value if math.isfinite(value) else None) for value in values))
        for spring, *values in spring_rows(rows)
    )
    heads = ("Spring", "Counted", "Effective covered", "Physical covered", "Half width", "Error")
    return Section(f"Springs of set {name}", "Half width and error: physical, medians.", (Table(heads, cells),))


def _cause_section(study: TrustStudy, summary: Mapping[str, float]) -> tuple[Section, ...]:
    if not study.causes:
        return ()
    rows = tuple(
        (name.replace("_", " "), ", ".join(kind.named), _cell("", summary.get(f"causes.{name}.first")))
        for name, kind in study.causes.items()
    )
    return (Section("Causes", "", (Table(("Defect", "Right", "Named first"), rows),)),)


def _cell(key: str, value: float | None) -> str:
    if value is None:
        return MISSING
    return significant(value) if key.endswith("ratio") else percent(value)
