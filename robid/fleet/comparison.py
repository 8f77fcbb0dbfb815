"""What the rows of a fleet found, and the rows against each other: populations, who is off them, who changes."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from scipy.stats import norm

from robid.arrays import FloatArray, IntArray
from robid.fleet.drift import Drift, find_drifts, followed
from robid.fleet.folders import PAGE
from robid.fleet.ledger import Ledger, causes
from robid.fleet.manifest import Robots
from robid.fleet.population import Outlier, Population, Trait, find_outliers, populations
from robid.report.section import Cell
from robid.robot.parameters import FRICTION_KIND, LOGARITHMIC, NUISANCE_KIND, PARAMETER_KINDS

Key = tuple[str, str]
"""Name of a fit, and of a parameter or misfit."""


def _numbers() -> array[float]:
    return array("d")


@dataclass
class Collected:
    """A parameter, or misfit, of one fit over the rows."""

    kind: str  # kind of the parameter; empty for a misfit
    unit: str
    confidence: float  # level of the intervals
    rows: array[int] = field(default_factory=lambda: array("q"))  # index of each row that has it
    # What the robot file says; not a number where it says nothing, as below.
    nominal: array[float] = field(default_factory=_numbers)
    middle: array[float] = field(default_factory=_numbers)  # the parameter itself; a misfit's value
    low: array[float] = field(default_factory=_numbers)  # lower end of its interval
    high: array[float] = field(default_factory=_numbers)  # upper end
    # What rows are compared by: the effective value where there is one, of an identified parameter, as a logarithm
    # where the kind is one.
    compared: array[float] = field(default_factory=_numbers)
    std: array[float] = field(default_factory=_numbers)  # standard deviation of that

    @property
    def is_misfit(self) -> bool:
        """Whether it says how badly a model fits."""
        return not self.kind

    @property
    def only_large(self) -> bool:
        """Whether a small value is nothing to worry about: of a misfit, and of what grows with wear."""
        return self.is_misfit or PARAMETER_KINDS[self.kind].wears

    @property
    def is_logarithmic(self) -> bool:
        """Whether rows are compared by its logarithm."""
        return self.is_misfit or self.kind in LOGARITHMIC

    @property
    def known(self) -> tuple[IntArray, FloatArray, FloatArray]:
        """Rows (n,) that can be compared, what they are compared by, and its standard deviations."""
        value, std = np.array(self.compared), np.array(self.std)
        kept = np.isfinite(value) & np.isfinite(std)
        return np.array(self.rows, int)[kept], value[kept], std[kept]

    def add(self, row: int, entry: Mapping[str, Any]) -> None:
        """Adds what a row found."""
        value, std = _compared(entry)
        middle = entry.get("physical")
        self.rows.append(row)
        self.nominal.append(_known(entry["nominal"]))
        self.middle.append(_known(entry["estimate"] if middle is None else middle))
        self.low.append(_known(entry["physical_low"]))
        self.high.append(_known(entry["physical_high"]))
        self.compared.append(value)
        self.std.append(std)

    def add_misfit(self, row: int, value: float) -> None:
        """Adds the misfit of a row; nobody knows its error."""
        self.rows.append(row)
        self.middle.append(value)
        self.compared.append(math.log(value))
        self.std.append(0.0)


def collect(ledgers: Iterable[Ledger | None]) -> dict[Key, Collected]:
    """Collects the parameters of all rows, those that are nuisances apart, and their misfits."""
    found: dict[Key, Collected] = {}
    misfits: dict[Key, Collected] = {}
    for row, ledger in enumerate(ledgers):
        if ledger is None:
            continue
        for entry in ledger.results:
            key = entry["fit"], entry["parameter"]
            if key not in found and entry["kind"] not in (NUISANCE_KIND, FRICTION_KIND):
                found[key] = Collected(entry["kind"], entry["unit"], entry["confidence"])
            if key in found:
                found[key].add(row, entry)
        for fit, told in ledger.misfits.items():
            for name, value in told.items():
                misfits.setdefault((fit, name), Collected("", "1", 0.0)).add_misfit(row, value)
    return found | misfits


def _compared(entry: Mapping[str, Any]) -> tuple[float, float]:
    """What a row is compared by in a parameter, and its standard deviation; not numbers where it is not."""
    if not entry["identified"] or entry["tied_to"]:
        return math.nan, math.nan
    value, low, high = (_known(entry.get(f"effective{end}")) for end in ("", "_low", "_high"))
    std = (high - low) / (2 * _quantile(entry["confidence"]))
    if not (math.isfinite(value) and math.isfinite(std)):
        value, std = _known(entry["estimate"]), _known(entry.get("standard_deviation"))
        low = high = math.nan
    if entry["kind"] not in LOGARITHMIC:
        return value, std
    if value <= 0:
        return math.nan, math.nan
    return math.log(value), math.log(high / low) / (2 * _quantile(entry["confidence"])) if low > 0 else std / value


@cache
def _quantile(confidence: float) -> float:
    return float(norm.ppf(0.5 + 0.5 * confidence))


def _known(value: float | None) -> float:
    return math.nan if value is None else float(value)


_QUANTILE = 1.96


@dataclass(frozen=True)
class Compared:
    """A trait of one population, by name."""

    fit: str
    name: str  # the parameter, or the misfit
    group: int  # number of the population
    of: Collected  # its values over all populations
    trait: Trait  # its values in this one
    population: Population | None  # what the population is like in it; None where too few robots tell

    def natural(self, value: float) -> float:
        """Returns a value in its unit."""
        return math.exp(value) if self.of.is_logarithmic else value

    def change(self, difference: float) -> float:
        """Returns a difference as what it changes: relative where the values are compared by logarithms."""
        return math.expm1(difference) if self.of.is_logarithmic else difference

    def interval(self, row: int) -> tuple[float, float, float]:
        """Returns a row's value in its unit and the ends of its interval, of 95 %."""
        place = int(np.searchsorted(self.trait.rows, row))
        value, half = float(self.trait.value[place]), _QUANTILE * float(self.trait.std[place])
        return self.natural(value), self.natural(value - half), self.natural(value + half)


@dataclass(frozen=True)
class Comparison:
    """The rows of a fleet against each other."""

    robots: Robots  # whose measurements the rows are
    compared: tuple[Compared, ...]  # all traits of all populations
    outliers: tuple[Outlier, ...]  # rows that are off, the clearest first, once for each trait
    drifts: tuple[Drift, ...]  # robots that change, the clearest first, once for each trait
    followed: IntArray  # numbers of the robots that have values at different times, so that a change would be seen

    @cached_property
    def off(self) -> dict[int, list[Outlier]]:
        """The rows that are off, the clearest first, each with all that it is off in."""
        found: dict[int, list[Outlier]] = {}
        for outlier in self.outliers:
            found.setdefault(outlier.row, []).append(outlier)
        return found

    @cached_property
    def changing(self) -> dict[int, list[Drift]]:
        """The robots that change, the clearest first, each with all that changes."""
        found: dict[int, list[Drift]] = {}
        for drift in self.drifts:
            found.setdefault(drift.robot, []).append(drift)
        return found

    @cached_property
    def untold(self) -> tuple[int, ...]:
        """Populations in which too few robots tell who is off."""
        told = {each.group for each in self.compared if each.population is not None}
        return tuple(sorted({each.group for each in self.compared} - told))

    @cached_property
    def away(self) -> dict[Key, FloatArray]:
        """By how many deviations each row (n_row,) is off in a parameter; not a number where that is not told."""
        found: dict[Key, FloatArray] = {}
        for each in self.compared:
            if each.population is not None and not each.of.is_misfit:
                whole = found.setdefault((each.fit, each.name), np.full(len(self.robots.robot), np.nan))
                whole[each.trait.rows] = each.population.away(each.trait.value, each.trait.std)
        return found

    @cached_property
    def accused(self) -> frozenset[tuple[int, str, str]]:
        """Row, fit and parameter, or misfit, of all outliers."""
        return frozenset((each.row, *self.names(each.trait)) for each in self.outliers)

    def names(self, trait: int) -> Key:
        """Returns fit and name of a trait."""
        return self.compared[trait].fit, self.compared[trait].name


def compare(found: Mapping[Key, Collected], robots: Robots) -> Comparison:
    """Compares what the rows of a fleet found, each population by itself, all at the level of one fleet."""
    named = [
        (*key, int(robots.group[trait.rows[0]]), of, trait)
        for key, of in found.items()
        for trait in _by_group(of, robots.group)
    ]
    traits = [trait for *_, trait in named]
    about = populations(traits, robots.robot)
    compared = tuple(Compared(*each, each_about) for each, each_about in zip(named, about, strict=True))
    repeated = np.bincount(robots.robot, minlength=1)[robots.robot] > 1
    kept = [(repeated & np.isfinite(robots.time))[trait.rows] for trait in traits]
    lasting = [
        Trait(trait.rows[own], trait.value[own], trait.std[own], trait.only_large)
        for trait, own in zip(traits, kept, strict=True)
    ]
    over_time = lasting, robots.robot, robots.time
    return Comparison(robots, compared, find_outliers(traits, about), find_drifts(*over_time), followed(*over_time))


def _by_group(of: Collected, group: IntArray) -> Iterator[Trait]:
    """The values that can be compared, those of each population by themselves."""
    rows, value, std = of.known
    order = np.argsort(group[rows], kind="stable")
    ends = np.flatnonzero(np.diff(group[rows][order])) + 1
    for part in np.split(order, ends):
        if part.size:
            yield Trait(rows[part], value[part], std[part], of.only_large)


Pages = Literal["all", "none", "flagged"]
MOST_SHOWN = 200
"""Outliers, and failures of one cause, that the page names and that get pages of their own unless asked for."""
_SHOWN_ROWS = 12


@dataclass(frozen=True)
class Found:
    """What a fleet found."""

    name: str  # name of the experiment
    ledgers: Sequence[Ledger]  # what became of each row, in the order of the manifest, in outline
    comparison: Comparison  # the rows against each other
    collected: Mapping[Key, Collected]  # parameters and misfits over the rows
    rows: Path | None = None  # folder of the rows' folders; None where no page leads to them

    def cell(self, row: int) -> Cell:
        """Names a row, with a link to its page where it has one."""
        name = self.ledgers[row].id
        has_page = self.rows is not None and (self.rows / name / PAGE).exists()
        return Cell(name, link=f"{self.rows.name}/{name}/{PAGE}" if has_page and self.rows else "")


def flagged(found: Found) -> list[int]:
    """Returns the rows that get pages: outliers and failures, the first of very many."""
    numbers = {ledger.id: row for row, ledger in enumerate(found.ledgers)}
    failed = [numbers[name] for *_, ids in causes(found.ledgers) for name in ids[:MOST_SHOWN]]
    return [*list(found.comparison.off)[:MOST_SHOWN], *failed]


def listed(ids: Sequence[str], shown: int = _SHOWN_ROWS) -> str:
    """Names some rows, the first of many."""
    more = f" and {len(ids) - shown} more" if len(ids) > shown else ""
    return ", ".join(ids[:shown]) + more
