"""What the study of trust found: its figures, what is asked of them, and its page."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from robid.artifacts.kinds import TASK
from robid.artifacts.store import read_artifact
from robid.pipeline.graph import Run
from robid.report.numbers import percent, significant
from robid.report.section import Section
from robid.studies.page import Asked, Conclusion, PartFound, by_name, concluded, table
from robid.studies.settings.trust import FILE, LINEAR, Individual, TrustStudy, individuals
from robid.studies.simulated import REFUSAL, kept_solution, kept_truth
from robid.studies.study import Earlier, seconds_of, study_of
from robid.studies.trust.figures import (
    RobotRow,
    Springs,
    cause_figures,
    effective_held,
    largest,
    physical_held,
    set_figures,
    spring_rows,
    springs_of,
)
from robid.studies.trust.responses import DESIGNED, FRESH, RANDOM
from robid.studies.trust.singles import single_bars, single_figures, single_robots, single_sections

ASKED: Mapping[str, Asked] = {
    "effective.coverage_95": Asked(lower=0.92),
    "light.effective.coverage_95": Asked(lower=0.90),
    "listed.physical.coverage_95": Asked(lower=0.90),
    "listed.physical.worst": Asked(lower=0.75),
    "unlisted.trusted_wrong": Asked(upper=0.05),
    "width_ratio": Asked(upper=2.0),
    "linear.coverage_95": Asked(0.92, 0.98),
    "linear.file.coverage_95": Asked(lower=0.92),
    "causes.first": Asked(lower=0.8),
    "causes.first_three": Asked(lower=0.9),
}

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
    every = list(_robot_rows(individuals(study), results))
    rows, singles = {one.key: row for one, row in every}, single_robots(study.single, every, *results[3:])
    summary = {**summarise(study, rows, results), **known(single_figures(singles) if singles else {})}
    judged = study.use == "judge" and study.chosen.robots is None
    warnings = () if judged else ("These robots are for choosing: their figures say nothing.",)
    part = PartFound(summary, bars(study), (*_sections(study, rows, summary), *single_sections(singles)), warnings)
    found = concluded([part], "intervals hold, and what is wrong is named")
    return found if judged else replace(found, verdict=replace(found.verdict, level="warn"))


def _sections(study: TrustStudy, rows: Mapping[str, RobotRow], summary: Mapping[str, float]) -> list[Section]:
    """What the page shows of sets and causes."""
    causes = (
        ("Defect", lambda name: name.replace("_", " ")),
        ("Right", lambda name: ", ".join(study.causes[name].named)),
        ("Named first", lambda name: percent(summary.get(f"causes.{name}.first"))),
    )
    caption = (
        "Springs that the data were to determine, decided before the fit. Effective: compared with the same fit in"
        " fresh places, within the root of both half widths squared. Width ratio: median half width over the 95 %"
        " quantile of the absolute error, median over the springs."
    )

    columns = [("Set", lambda name: name)]
    for key, title in _TITLES.items():
        columns.append(by_name(summary, title, key, significant if key.endswith("ratio") else percent))
    columns.append(("Robots", lambda name: f"{summary[f'{name}.robots']:.0f}"))
    sections = [Section("Sets of robots", "", (table(columns, study.sets, caption=caption),))] if study.sets else []
    sections += [Section("Causes", "", (table(causes, study.causes),))] if study.causes else []
    for name in study.sets:
        cells = table(_OF_SPRINGS, spring_rows([rows[one.key] for one in _of(study, name)]))
        sections.append(Section(f"Springs of set {name}", "Half width and error: physical, medians.", (cells,)))
    return sections


_OF_SPRINGS = (
    ("Spring", lambda row: row[0].removesuffix(".stiffness")),
    ("Counted", lambda row: percent(row[1])),
    ("Effective covered", lambda row: percent(row[2])),
    ("Physical covered", lambda row: percent(row[3])),
    ("Half width", lambda row: percent(row[4])),
    ("Error", lambda row: percent(row[5])),
)


def summarise(study: TrustStudy, rows: Mapping[str, RobotRow], results: Earlier) -> dict[str, float]:
    """Returns the figures of summary.json; what is not known is left out."""
    found: dict[str, float] = {}
    heavy, ratios = [], []
    for name, defects in study.sets.items():
        own = [rows[one.key] for one in _of(study, name)]
        found |= set_figures(name, own, listed=defects.listed)
        if defects.robot == "heavy":
            heavy += own
            ratios.append(found[f"{name}.width_ratio"])
        referenced = [rows[one.key].fresh for one in _of(study, name) if one.referenced]
        found[f"{name}.references_refused"] = float(sum(fit is None for fit in referenced))
    pooled = effective_held([(row.random, row.fresh) for row in heavy])
    found |= {"effective.coverage_95": pooled.coverage, "effective.coverage_std": pooled.coverage_std}
    for group, name in ((LINEAR, "linear"), (FILE, "linear.file")):
        fits = [rows[one.key].random for one in _of(study, group)]
        held = physical_held([fit for fit in fits if fit is not None])
        found |= {f"{name}.{key}": getattr(held, key) for key in ("coverage_std", "width_ratio", "worst")}
        found[f"{name}.coverage_95"] = held.coverage
        found[f"{name}.refused"] = sum(fit is None for fit in fits) / len(fits) if fits else math.nan
    if study.linear is not None and study.linear.drawn > 0:
        ratios.append(found["linear.width_ratio"])
    found["width_ratio"] = largest(ratios)
    grades = results[3].by_name
    told = {name: [read_artifact(grades[one.key], TASK) for one in _of(study, name)] for name in study.causes}
    causes = {name: [tuple(held.datasets["causes"].values.tolist()) for held in own] for name, own in told.items()}
    found |= cause_figures({name: (study.causes[name].named, own) for name, own in causes.items()})
    for name, done in zip(("place", "fit", "linear_fit", "grade", "effect"), results, strict=True):
        spans = [seconds_of(held.provenance) for held in done]
        found[f"cost.{name}_seconds"] = sum(spans) / len(spans) if spans else math.nan
    return known(found)


def known(figures: Mapping[str, float]) -> dict[str, float]:
    """Leaves out what is not known."""
    return {name: value for name, value in figures.items() if math.isfinite(value)}


def bars(study: TrustStudy) -> dict[str, Asked]:
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
    heavy = any(defects.robot == "heavy" for defects in study.sets.values())
    named = ["effective.coverage_95"] * heavy
    named += ["width_ratio"] * (heavy or (study.linear is not None and study.linear.drawn > 0))
    if study.linear is not None:
        named += ["linear.coverage_95"] * (study.linear.drawn > 0)
        named += ["linear.file.coverage_95"] * (study.linear.file > 0)
    named += ["causes.first", "causes.first_three"] * bool(study.causes)
    return found | {name: ASKED[name] for name in named} | single_bars(study.single)


def _of(study: TrustStudy, group: str) -> list[Individual]:
    return [one for one in individuals(study) if one.group == group]


def _robot_rows(robots: Sequence[Individual], results: Earlier) -> Iterator[tuple[Individual, RobotRow]]:
    _, models, linear, grades, _ = (done.by_name for done in results)
    for one in robots:
        if one.kind == "linear":
            yield one, RobotRow(_springs(linear[one.key]))
        elif one.kind in ("set", "single"):
            found = [_springs(models.get(f"{one.key}_{use}")) for use in (RANDOM, FRESH, DESIGNED)]
            grade = read_artifact(grades[one.key], TASK).attributes.get("grade")
            own = int(grade) if isinstance(grade, int | float) else None
            yield one, RobotRow(found[0], found[1], found[2], own)


def _springs(path: Path | None) -> Springs | None:
    held = None if path is None else read_artifact(path, TASK)
    if held is None or REFUSAL in held.attributes:
        return None
    return springs_of(kept_solution(held), kept_truth(held))
