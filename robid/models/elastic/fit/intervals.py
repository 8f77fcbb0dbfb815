"""How far the parameters of a fit may be off, as what predicts and as what is there, and what set the widths."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm, t

from robid.arrays import FloatArray
from robid.clusters.evidence import group_places
from robid.clusters.pooling import Pooled
from robid.models.elastic.fit.nuisance.named import Named, Suspicion, name_doubts
from robid.models.elastic.fit.physical import LONGEST_STEP, Settled, find_physical, lean, settle, weigh_few
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.fit.solution import Between, NamedDoubts
from robid.models.elastic.fit.uncertainty import Influence, influence, load_doubt, structured_covariance

FEWEST_PLACES = 4
"""Number of places from which on their differences say how far a parameter may be off."""
LEARNT_SHARE = 0.5
"""Of what was known of a parameter beforehand, as much may stay unknown."""
_BEYOND = 1.5  # times what was known of doubts beforehand: of many, chance makes a tenth of it


@dataclass(frozen=True)
class Spread:
    """Internal parameters and how far they may be off.

    Attributes:
        values (n_param,): Middle of their intervals.
        covariance (n_param, n_param): Their covariance, without any quantile.
        degrees_of_freedom (n_param,): What the quantile of each interval follows, infinite for the normal one.
        rule: What set the width, in words.
        beside: The same from where data say as good as the same; intervals hold both.
    """

    values: FloatArray
    covariance: FloatArray
    degrees_of_freedom: FloatArray
    rule: str
    beside: Spread | None = None

    @property
    def std(self) -> FloatArray:
        """Standard deviation (n_param,) of each."""
        return np.sqrt(np.diag(self.covariance))

    def reach(self, confidence: float) -> FloatArray:
        """Half width (n_param,) of the intervals of a level."""
        return np.asarray(t.ppf(0.5 + 0.5 * confidence, self.degrees_of_freedom) * self.std)

    def ends(self, confidence: float, prior_std: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Lower and upper ends (n_param,) of the intervals of a level.

        Where a parameter has run off to where data say no more of it than was known beforehand, around zero, its
        interval holds what was known as well: there, nothing leads back.

        Args:
            confidence: The level.
            prior_std (n_param,): Deviation known beforehand, infinite where nothing is known.
        """
        reach, known = self.reach(confidence), norm.ppf(0.5 + 0.5 * confidence) * prior_std
        lower, upper = self.values - reach, self.values + reach
        untold = self.std > np.maximum(LONGEST_STEP, LEARNT_SHARE * prior_std)
        lower = np.where(untold, np.minimum(lower, -known), lower)
        upper = np.where(untold, np.maximum(upper, known), upper)
        if self.beside is None:
            return lower, upper
        least, most = self.beside.ends(confidence, prior_std)
        return np.minimum(lower, least), np.maximum(upper, most)


@dataclass(frozen=True)
class Spreads:
    """How far the parameters of a fit may be off.

    Attributes:
        effective: As what infinitely many places of this robot would give: they predict.
        physical: As springs, dampers and inertias themselves.
        assumed (n_param, n_param): Covariance by noise and assumed errors alone: what the data do not determine.
        between: How places differ; None where they are too few to tell.
        doubts: What places say of the doubts; None where there are none.
    """

    effective: Spread
    physical: Spread
    assumed: FloatArray
    between: Between | None = None
    doubts: NamedDoubts | None = None


def find_spreads(
    problem: Problem,
    internal: FloatArray,
    found: Influence,
    excess: float,
    confidence: float,
    suspicion: Suspicion | None = None,
) -> Spreads:
    """Finds how far a fit's parameters may be off.

    Args:
        problem: The problem, at its minimum.
        internal (n_param,): The minimum.
        found: The estimator linearised there.
        excess: Cost over what noise and the assumed model error give; above 1 it widens the covariance of few places.
        confidence: Level of the intervals.
        suspicion: What the robot file may have wrong; nothing when not given.
    """
    places = len(group_places(problem.frf.configurations))
    rule = _errors(model_error=bool(problem.model_error.any()))
    if places < FEWEST_PLACES:
        return _of_few_places(problem, internal, found, (excess, rule), confidence, suspicion)
    differing = f"what {places} places differ by"
    near = settle(problem, internal, found)
    differ = f"{rule}, and {differing}"
    leaning = _spread(lean(problem, internal, found, near), differ, confidence)
    effective = replace(_spread(near, differ, confidence), beside=leaning)
    between = between_places(near.pooled)
    far = None if suspicion is None else find_physical(problem, (near.values, internal), suspicion, confidence)
    if far is None:
        return Spreads(effective, effective, near.pooled.assumed, between)
    known = f"{_errors(model_error=far.model_error)}, {differing}"
    told = f"{known}, and {_told(len(far.doubts.names), rigid=far.rigid)}{_beyond(far.further)}"
    physical = Spread(far.values, far.covariance, far.degrees_of_freedom, told)
    return Spreads(effective, physical, near.pooled.assumed, between, far.doubts)


def _of_few_places(
    problem: Problem,
    internal: FloatArray,
    found: Influence,
    widened: tuple[float, str],
    confidence: float,
    suspicion: Suspicion | None,
) -> Spreads:
    """What noise and assumed errors give, widened by the misfit: too few places to see what they differ by."""
    excess, rule = widened
    covariance = structured_covariance(problem, found) + load_doubt(problem, internal, found.inverse, found.weighted)
    covariance *= max(1.0, excess)
    told = rule if excess <= 1 else f"{rule}, widened by the misfit"
    spread = Spread(internal, covariance, np.full(internal.size, np.inf), told)
    doubts = None if suspicion is None or not suspicion.rested else name_doubts(problem, (internal,), suspicion)
    if doubts is None:
        return Spreads(spread, spread, covariance)
    far = weigh_few(doubts, influence(doubts.problem, internal), max(1.0, excess))
    told = f"{told}, and {_told(len(doubts.doubts), rigid=doubts.rigid)}"
    size = internal.size
    physical = Spread(far.values, far.pooled.assumed[:size, :size], spread.degrees_of_freedom, told)
    return Spreads(spread, physical, covariance, doubts=_carried(doubts, far, confidence))


def _carried(named: Named, far: Settled, confidence: float) -> NamedDoubts:
    """What few places say of the doubts, by the covariance that carries them along."""
    std = np.sqrt(np.diag(far.pooled.assumed))[far.values.size :]
    return NamedDoubts(
        names=tuple(doubt.name for doubt in named.doubts),
        causes=tuple(doubt.cause for doubt in named.doubts),
        units=tuple(doubt.unit for doubt in named.doubts),
        prior_std=named.common_std,
        place_std=named.place_std,
        value=far.amounts,
        half_width=np.asarray(norm.ppf(0.5 + 0.5 * confidence) * std),
    )


def _errors(*, model_error: bool) -> str:
    return "noise and assumed model error" if model_error else "noise"


def _told(count: int, *, rigid: bool) -> str:
    source = "what the rigid fit leaves open among " if rigid else ""
    return f"{source}{count} doubts of the robot file"


def _beyond(further: float) -> str:
    return f", which are {further:.1f} times as far off as stated" if further > _BEYOND else ""


def _spread(settled: Settled, rule: str, confidence: float) -> Spread:
    size = settled.values.size
    covariance, freedom = settled.pooled.spread(confidence)
    return Spread(settled.values, covariance[:size, :size], freedom[:size], rule)


def between_places(pooled: Pooled) -> Between:
    """Takes what places say of each parameter's differences."""
    return Between(np.sqrt(pooled.between), pooled.degrees_of_freedom, pooled.dependence)
