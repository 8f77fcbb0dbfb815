"""How often intervals of sets of robots hold what they are to hold, how wide they are, and what is named.

Springs are compared by their logarithms: half an interval from `lower` to `upper` is `log(upper / lower) / 2` wide.
Arrays are (n_robot, n_spring); NaN is a spring that is not counted for a robot.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.models.elastic.fit.solution import ElasticSolution

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
TRUST = 2
"""The best grade, as the tasks keep it."""


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

    @property
    def worst(self) -> float:
        """Largest distance of a true spring from the middle of its physical interval, in half widths; NaN of none."""
        own = self.random
        return np.nan if own is None else float(worst_half_widths(own.physical, own.truth[None], own.counted[None])[0])


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
        "trusted": share([row.grade == TRUST for row in rows if row.grade is not None and row.random is not None]),
        "trusted_wrong": trusted_wrong(rows),
        "robots": float(len(rows)),
        "refused": share([row.random is None for row in rows]),
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
    return share([is_trusted_wrong(row) for row in rows if row.grade is not None and row.random is not None])


def is_trusted_wrong(row: RobotRow) -> bool:
    """Tells whether a robot is graded trust though a spring is off by more than three half widths."""
    return row.grade == TRUST and row.worst > _HALF_WIDTHS


def cause_figures(kinds: Mapping[str, tuple[tuple[str, ...], Sequence[tuple[str, ...]]]]) -> dict[str, float]:
    """Returns how often what is wrong is named."""
    found, first, three = {}, [], []
    for name, (right, told) in kinds.items():
        ranks = [tuple(dict.fromkeys(each)) for each in told]
        hits = [bool(rank) and rank[0] in right for rank in ranks]
        first += hits
        three += [bool(set(rank[:3]) & set(right)) for rank in ranks]
        found[f"causes.{name}.first"] = share(hits)
    return {"causes.first": share(first), "causes.first_three": share(three), **found}


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


def share(said: Sequence[bool]) -> float:
    """How many of some are so; NaN of none."""
    return float(np.mean(said)) if said else np.nan
