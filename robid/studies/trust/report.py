"""What the study of trust found: how often intervals hold what they are to hold, how wide they are, what is named.

Springs are compared by their logarithms: half an interval from `lower` to `upper` is `log(upper / lower) / 2` wide.
Arrays are (n_robot, n_spring); NaN is a spring that is not counted for a robot.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.artifacts.kinds import TASK
from robid.artifacts.store import read_artifact
from robid.models.elastic.fit.solution import ElasticSolution
from robid.pipeline.graph import Run
from robid.report.numbers import percent, significant
from robid.report.section import Section
from robid.studies.page import Asked, Conclusion, PartFound, by_name, concluded, table
from robid.studies.settings.defects import FILE, LINEAR, Individual, TrustStudy, individuals
from robid.studies.simulated import REFUSAL, kept_solution, kept_truth
from robid.studies.study import Earlier, seconds_of, study_of
from robid.studies.trust.responses import DESIGNED, FRESH, RANDOM

_QUANTILE = 0.95
_LEAST = 1e-300


@dataclass(frozen=True)
class Intervals:
    """Intervals of springs."""

    value: FloatArray  # (n_robot, n_spring) the values that they belong to
    lower: FloatArray  # (n_robot, n_spring) lower ends
    upper: FloatArray  # (n_robot, n_spring) upper ends

    @property
    def half_width(self) -> FloatArray:
        """Half widths (n_robot, n_spring), relative."""
        return np.asarray(0.5 * np.log(np.maximum(self.upper, _LEAST) / np.maximum(self.lower, _LEAST)))


@dataclass(frozen=True)
class Held:
    """Errors of springs against the half widths that are to hold them."""

    inside: BoolArray  # (n_robot, n_spring) whether an interval holds what it is to hold
    counted: BoolArray  # (n_robot, n_spring) which of them count
    error: FloatArray  # (n_robot, n_spring) errors, relative
    half_width: FloatArray  # (n_robot, n_spring) half widths

    @property
    def coverage(self) -> float:
        """Share of all counted springs of all robots inside their intervals; NaN where none is counted."""
        return float(self.inside[self.counted].mean()) if self.counted.any() else np.nan

    @property
    def coverage_std(self) -> float:
        """Monte Carlo deviation of `coverage`, robots being independent and the springs of one robot not."""
        known = self.counted.sum(axis=1)
        robots = int((known > 0).sum())
        if robots < 2:
            return np.nan
        off = np.where(self.counted, self.inside - self.coverage, 0.0).sum(axis=1)
        return float(np.sqrt(robots / (robots - 1) * (off**2).sum()) / known.sum())

    @property
    def each_spring(self) -> FloatArray:
        """Share of the robots (n_spring,) inside; NaN for springs that are never counted."""
        count = self.counted.sum(axis=0)
        inside = (self.inside & self.counted).sum(axis=0)
        return np.asarray(np.divide(inside, count, out=np.full(count.shape, np.nan), where=count > 0))

    @property
    def worst(self) -> float:
        """The lowest share of any spring; NaN where none is counted."""
        known = self.each_spring[np.isfinite(self.each_spring)]
        return float(known.min()) if known.size else np.nan

    @property
    def width_ratio(self) -> float:
        """Median over the springs of the median half width over the 95 % quantile of the absolute error."""
        ratios = []
        for column in np.flatnonzero(self.counted.any(axis=0)):
            rows = self.counted[:, column]
            quantile = float(np.quantile(np.abs(self.error[rows, column]), _QUANTILE))
            ratios.append(float(np.median(self.half_width[rows, column])) / max(quantile, _LEAST))
        return float(np.median(ratios)) if ratios else np.nan


def physical(found: Intervals, truth: FloatArray, counted: BoolArray) -> Held:
    """Holds intervals against true springs, of which some count, both (n_robot, n_spring)."""
    known = counted & np.isfinite(truth) & np.isfinite(found.lower)
    inside = (found.lower <= truth) & (truth <= found.upper)
    return Held(inside & known, known, _log_ratio(found.value, truth, known), found.half_width)


def effective(found: Intervals, reference: Intervals, counted: BoolArray) -> Held:
    """Holds intervals against those of the same robots in other configurations, the root of both half widths squared.

    Counted are some springs of each robot (n_robot, n_spring).
    """
    known = counted & np.isfinite(found.lower) & np.isfinite(reference.lower)
    error = _log_ratio(found.value, reference.value, known)
    half_width = np.hypot(found.half_width, reference.half_width)
    return Held((np.abs(error) <= half_width) & known, known, error, half_width)


def worst_half_widths(found: Intervals, truth: FloatArray, counted: BoolArray) -> FloatArray:
    """Largest distance (n_robot,) of a true spring from the middle of its interval, in half widths; NaN without any."""
    known = counted & np.isfinite(truth) & np.isfinite(found.lower)
    middle = np.sqrt(np.maximum(found.lower, _LEAST)) * np.sqrt(np.maximum(found.upper, _LEAST))
    off = np.abs(_log_ratio(middle, truth, known)) / np.maximum(found.half_width, _LEAST)
    return np.asarray(np.where(known.any(axis=1), np.where(known, off, 0.0).max(axis=1, initial=0.0), np.nan))


def _log_ratio(value: FloatArray, other: FloatArray, known: BoolArray) -> FloatArray:
    ratio = np.divide(value, other, out=np.ones_like(value), where=known)
    return np.asarray(np.where(known, np.log(np.maximum(ratio, _LEAST)), np.nan))


_HALF_WIDTHS = 3.0
_TRUST = 2
_Row = TypeVar("_Row")

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


@dataclass(frozen=True)
class Springs:
    """The springs of one fit."""

    names: tuple[str, ...]  # Names of the fit's springs
    counted: BoolArray  # (n_spring,) whether the data were to determine them, decided before the fit
    truth: FloatArray  # (n_spring,) true values; NaN where none is known
    physical: Intervals  # Intervals of the springs themselves (1, n_spring), around their middles
    effective: Intervals  # Intervals of the values that predict (1, n_spring), around their middles; NaN without any


@dataclass(frozen=True)
class RobotRow:
    """What the study found of one robot."""

    random: Springs | None  # Springs of the fit in random configurations; None where it was refused
    fresh: Springs | None = None  # Those of the reference; None without one
    designed: Springs | None = None  # Those in designed configurations; None without them
    grade: int | None = None  # The grade that it got; None where it was not graded


def springs_of(solution: ElasticSolution, truth: Mapping[str, float]) -> Springs:
    """Returns the springs of a fit with the true values by name; what predicts is NaN where a fit has none."""
    estimate = solution.estimate
    rows = [row for row, kind in enumerate(estimate.kinds) if kind == "stiffness"]
    names = tuple(estimate.names[row] for row in rows)

    def around_middles(*ends: FloatArray | None) -> Intervals:
        lower, upper = (np.full((1, len(rows)), np.nan) if each is None else each[rows][None] for each in ends)
        return Intervals(np.sqrt(np.maximum(lower, 0.0)) * np.sqrt(np.maximum(upper, 0.0)), lower, upper)

    return Springs(
        names=names,
        counted=estimate.identifiable[rows],
        truth=np.array([truth.get(name, np.nan) for name in names]),
        physical=around_middles(estimate.lower, estimate.upper),
        effective=around_middles(estimate.effective_lower, estimate.effective_upper),
    )


def set_figures(name: str, rows: Sequence[RobotRow], *, listed: bool) -> dict[str, float]:
    """Returns the figures of a set of robots, whose defects are listed or not; NaN where something is not known."""
    fitted = [row.random for row in rows if row.random is not None]
    own = physical_held(fitted)
    places = {use: effective_held([(getattr(row, use), row.fresh) for row in rows]) for use in ("random", "designed")}
    found = {"effective.designed": places["designed"].coverage}
    for values, held in (("effective", places["random"]), ("physical", own)):
        found |= {f"{values}.{key}": getattr(held, key) for key in ("coverage_std", "worst", "width_ratio")}
        found[f"{values}.coverage_95"] = held.coverage
        found[f"{values}.half_width"] = _middle(held.half_width[held.counted])
    found |= {
        "trusted": _share([row.grade == _TRUST for row in rows if row.grade is not None and row.random is not None]),
        "trusted_wrong": trusted_wrong(rows),
        "robots": float(len(rows)),
        "refused": _share([row.random is None for row in rows]),
        "pairs": float(sum(row.random is not None and row.fresh is not None for row in rows)),
        "springs_counted": float(np.mean([each.counted.mean() for each in fitted])) if fitted else np.nan,
    }
    found["width_ratio"] = largest([found[f"{key}.width_ratio"] for key in ("effective", "physical")[: 1 + listed]])
    return {f"{name}.{key}": value for key, value in found.items()}


def physical_held(fits: Sequence[Springs]) -> Held:
    """Holds the intervals of some fits against the springs themselves."""
    return physical(_joined([fit.physical for fit in fits]), _rows(fits, "truth"), _rows(fits, "counted").astype(bool))


def effective_held(pairs: Sequence[tuple[Springs | None, Springs | None]]) -> Held:
    """Holds the intervals of fits against those of the same robots in fresh configurations, where both are known."""
    known = [(one, other) for one, other in pairs if one is not None and other is not None]
    counted = _rows([one for one, _ in known], "counted").astype(bool)
    found, reference = (_joined([pair[side].effective for pair in known]) for side in (0, 1))
    return effective(found, reference, counted)


def spring_rows(rows: Sequence[RobotRow]) -> list[tuple[str, float, float, float, float, float]]:
    """Returns each spring's name, how often it counts, its effective and physical coverage, half width and error.

    Half width and error are physical, medians over the robots; NaN where it never counts.
    """
    fits = [row.random for row in rows if row.random is not None]
    if not fits:
        return []
    own, pairs = physical_held(fits), effective_held([(row.random, row.fresh) for row in rows])
    found = []
    for column, name in enumerate(fits[0].names):
        counted = own.counted[:, column]
        shared = float(pairs.each_spring[column]) if pairs.inside.size else np.nan
        width, error = (_middle(each[counted, column]) for each in (own.half_width, np.abs(own.error)))
        found.append((name, float(counted.mean()), shared, float(own.each_spring[column]), width, error))
    return found


def trusted_wrong(rows: Sequence[RobotRow]) -> float:
    """Share of the fitted robots that are graded trust though a spring is off by more than three half widths."""
    graded = [(row.grade, row.random) for row in rows if row.grade is not None and row.random is not None]
    off = [worst_half_widths(one.physical, one.truth[None], one.counted[None])[0] for _, one in graded]
    return _share([grade == _TRUST and float(far) > _HALF_WIDTHS for (grade, _), far in zip(graded, off, strict=True)])


def cause_figures(kinds: Mapping[str, tuple[tuple[str, ...], Sequence[tuple[str, ...]]]]) -> dict[str, float]:
    """Returns how often what is wrong is named."""
    found, first, three = {}, [], []
    for name, (right, told) in kinds.items():
        ranks = [tuple(dict.fromkeys(each)) for each in told]
        hits = [bool(rank) and rank[0] in right for rank in ranks]
        first += hits
        three += [bool(set(rank[:3]) & set(right)) for rank in ranks]
        found[f"causes.{name}.first"] = _share(hits)
    return {"causes.first": _share(first), "causes.first_three": _share(three), **found}


def largest(values: Sequence[float]) -> float:
    """The largest; NaN where one of them is not known, or there is none."""
    return float(np.max(values)) if len(values) else np.nan


def _rows(fits: Sequence[Springs], key: str) -> FloatArray:
    rows = np.array([getattr(fit, key) for fit in fits], dtype=float)
    return rows.reshape(len(fits), len(fits[0].names) if fits else 0)


def _joined(parts: Sequence[Intervals]) -> Intervals:
    if not parts:
        return Intervals(*(np.zeros((0, 0)) for _ in range(3)))
    return Intervals(*(np.concatenate([getattr(part, key) for part in parts]) for key in ("value", "lower", "upper")))


def _middle(values: FloatArray) -> float:
    return float(np.median(values)) if values.size else np.nan


def _share(said: Sequence[bool]) -> float:
    return float(np.mean(said)) if said else np.nan


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
    rows = {one.key: row for one, row in _robot_rows(individuals(study), results)}
    summary = summarise(study, rows, results)
    judged = study.use == "judge" and study.chosen.robots is None
    warnings = () if judged else ("These robots are for choosing: their figures say nothing.",)
    causes = (
        ("Defect", lambda name: name.replace("_", " ")),
        ("Right", lambda name: ", ".join(study.causes[name].named)),
        ("Named first", lambda name: percent(summary.get(f"causes.{name}.first"))),
    )
    caption = (
        "Springs that the data were to determine, decided before the fit. Effective: held against the same fit in fresh"
        " places, within the root of both half widths squared. Width ratio: median half width over the 95 % quantile of"
        " the absolute error, median over the springs."
    )

    columns = [("Set", lambda name: name)]
    for key, title in _TITLES.items():
        columns.append(by_name(summary, title, key, significant if key.endswith("ratio") else percent))
    columns.append(("Robots", lambda name: f"{summary[f'{name}.robots']:.0f}"))
    sections = [Section("Sets of robots", "", (table(columns, study.sets, caption=caption),))]
    sections += [Section("Causes", "", (table(causes, study.causes),))] if study.causes else []
    for name in study.sets:
        cells = table(_OF_SPRINGS, spring_rows([rows[one.key] for one in _of(study, name)]))
        sections.append(Section(f"Springs of set {name}", "Half width and error: physical, medians.", (cells,)))
    part = PartFound(summary, bars(study), tuple(sections), warnings)
    found = concluded([part], "intervals hold, and what is wrong is named")
    return found if judged else replace(found, verdict=replace(found.verdict, level="warn"))


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
    for name, done in zip(("place", "fit", "linear_fit", "grade"), results, strict=True):
        spans = [seconds_of(held.provenance) for held in done]
        found[f"cost.{name}_seconds"] = sum(spans) / len(spans) if spans else math.nan
    return {name: value for name, value in found.items() if math.isfinite(value)}


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
    named = ["effective.coverage_95", "width_ratio"]
    if study.linear is not None:
        named += ["linear.coverage_95"] * (study.linear.drawn > 0)
        named += ["linear.file.coverage_95"] * (study.linear.file > 0)
    named += ["causes.first", "causes.first_three"] * bool(study.causes)
    return found | {name: ASKED[name] for name in named}


def _of(study: TrustStudy, group: str) -> list[Individual]:
    return [one for one in individuals(study) if one.group == group]


def _robot_rows(robots: Sequence[Individual], results: Earlier) -> Iterator[tuple[Individual, RobotRow]]:
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
    held = None if path is None else read_artifact(path, TASK)
    if held is None or REFUSAL in held.attributes:
        return None
    return springs_of(kept_solution(held), kept_truth(held))
