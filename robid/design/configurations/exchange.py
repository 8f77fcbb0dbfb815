"""Whole numbers of experiments by exchange, whatever they are worth, and by rounding."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from robid.arrays import BoolArray, FloatArray, IntArray
from robid.design.configurations.criteria import Criterion, tangent, worth
from robid.design.configurations.visits import Visits, merged

_GAIN = 1e-10
_SMOOTHING = 1e-6  # Smoothing of `e` over the smallest eigenvalue, where slopes screen candidates


class Objective(Protocol):
    """What numbers of experiments (n_cand,) are worth; positive, the more the better."""

    def worth(self, counts: IntArray) -> float:
        """Worth of some numbers of experiments."""

    def with_each(self, counts: IntArray, indices: IntArray) -> FloatArray:
        """Worth (n_some,) with one experiment more of each of some candidates."""

    def slopes(self, counts: IntArray) -> tuple[FloatArray, FloatArray]:
        """What one more of each (n_cand,) adds at most, and what one less takes at least."""


@dataclass(frozen=True)
class Information:
    """Worth by what experiments tell about the parameters."""

    criterion: Criterion
    visits: Visits  # What experiments of each candidate add, see `merged`
    base: FloatArray  # (n_draw, n_part, n_all, n_all) What is there without any
    wanted: int | None = None  # Number of parameters that the choice is about, the first ones; all when not given

    def worth(self, counts: IntArray) -> float:
        """Worth of some numbers of experiments."""
        return float(worth(self.criterion, merged(self._total(counts), self.wanted)))

    def with_each(self, counts: IntArray, indices: IntArray) -> FloatArray:
        """Worth (n_some,) with one experiment more of each of some candidates."""
        # All candidates at once: totals with one experiment more of each.
        together = self._total(counts)[:, None] + self.visits.more(indices, counts)
        return worth(self.criterion, merged(together, self.wanted))

    def slopes(self, counts: IntArray) -> tuple[FloatArray, FloatArray]:
        """What one more of each (n_cand,) adds at most, and what one less takes at least, by the worth's slopes.

        Nothing is known of a fit's own.
        """
        size = counts.size
        if self.visits.alone.shape[2] > 1:
            return np.full(size, np.inf), np.zeros(size)
        totals = self._total(counts)[:, 0]
        smoothing = _SMOOTHING * float(np.linalg.eigvalsh(totals)[..., 0].min()) if self.criterion == "e" else 0.0
        # Concavity: worth(M + H) <= worth(M) + slope, so slopes screen what cannot gain.
        bound = tangent(self.criterion, totals, smoothing)
        used = np.flatnonzero(counts)
        adding = _traces(self.visits.more(np.arange(size), counts), bound.factors)
        leaving = np.zeros(size)
        leaving[used] = _traces(self.visits.more(used, counts - (counts > 0)), bound.factors)
        return adding + bound.excess, leaving

    def _total(self, counts: IntArray) -> FloatArray:
        return np.asarray(self.base + self.visits.total(counts))


@dataclass(frozen=True)
class Exchange:
    """What may be measured, and what it is worth."""

    objective: Objective
    experiments: int
    distinct: int  # Number of different candidates at most
    repeats: bool
    cost: FloatArray  # (n_cand,) Cost of one experiment
    budget: float

    def worth(self, counts: IntArray) -> float:
        """Worth of some numbers of experiments."""
        return self.objective.worth(counts)

    def addable(self, counts: IntArray) -> BoolArray:
        """Which candidates may be measured (once more) beside some numbers of experiments."""
        # Rounding of prices shall not forbid the last experiment.
        affordable = counts @ self.cost + self.cost <= self.budget * (1 + 1e-12)
        used = counts > 0
        if used.sum() >= self.distinct:
            affordable = affordable & used
        return np.asarray(affordable if self.repeats else affordable & ~used)

    def completed(self, counts: IntArray, order: IntArray) -> IntArray:
        """Adds the candidates of an order one by one, as long as the cheapest others can still follow."""
        counts = counts.copy()
        for index in order.tolist():
            if counts.sum() == self.experiments:
                break
            if self.addable(counts)[index] and self._leaves_enough(counts, index):
                counts[index] += 1
        return counts

    def greedy(self, counts: IntArray) -> IntArray:
        """Adds the best one after the other, as long as the cheapest others can still follow."""
        counts = counts.copy()
        while counts.sum() < self.experiments:
            allowed = self.addable(counts)
            allowed[allowed] = [self._leaves_enough(counts, index) for index in np.flatnonzero(allowed).tolist()]
            best, _ = self._best(counts, allowed)
            if best < 0:
                break
            counts[best] += 1
        return counts

    def improved(self, counts: IntArray) -> IntArray:
        """Moves one experiment at a time, or adds one that is affordable, until nothing gains."""
        counts, current = counts.copy(), self.worth(counts)
        adding, leaving = self.objective.slopes(counts)
        while True:
            begun = current
            for position in np.flatnonzero(counts):
                if counts[position] == 0:
                    continue
                rest = counts.copy()
                rest[position] -= 1
                # Where worth is concave, what adds no more by its slopes than what it replaces cannot gain.
                promising = self.addable(rest) & (adding > leaving[position])
                best, value = self._best(rest, promising)
                if best >= 0 and value > current * (1 + _GAIN):
                    rest[best] += 1
                    counts, current = rest, value
                    adding, leaving = self.objective.slopes(counts)
            more = self.greedy(counts)
            if more.sum() > counts.sum():
                counts, current = more, self.worth(more)
                adding, leaving = self.objective.slopes(counts)
            if current == begun:
                return counts

    def _best(self, counts: IntArray, allowed: BoolArray) -> tuple[int, float]:
        indices = np.flatnonzero(allowed)
        if indices.size == 0:
            return -1, 0.0
        values = self.objective.with_each(counts, indices)
        return int(indices[np.argmax(values)]), float(values.max())

    def _leaves_enough(self, counts: IntArray, index: int) -> bool:
        left = self.experiments - int(counts.sum()) - 1
        free = self.cost if self.repeats else np.delete(self.cost, np.append(np.flatnonzero(counts), index))
        needed = left * free.min() if self.repeats else np.sort(free)[:left].sum()
        return bool(counts @ self.cost + self.cost[index] + needed <= self.budget * (1 + 1e-12))


def _traces(parts: FloatArray, factors: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("dcij,dij->c", parts[:, :, 0], factors, optimize=True))


def best_exchange(problem: Exchange, weights: FloatArray, restarts: int, seed: int) -> IntArray:
    """Numbers of experiments (n_cand,) of the best of several exchanges.

    They start from the greedy choice, from the largest relaxed weights (n_cand,), and from so many random ones, by a
    seed, that the weights favour.
    """
    generator = np.random.default_rng(seed)
    nothing = np.zeros(weights.size, int)
    # Half by the relaxed weights, half even: starts differ, and none is impossible.
    favour = 0.5 * weights / weights.sum() + 0.5 / weights.size
    orders = [np.argsort(-weights, kind="stable")]
    orders += [generator.choice(weights.size, weights.size, replace=False, p=favour) for _ in range(restarts)]
    starts = [problem.greedy(nothing), *(problem.completed(nothing, order) for order in orders)]
    ends = [problem.improved(start) for start in starts]
    return ends[int(np.argmax([problem.worth(end) for end in ends]))]


def efficient_rounding(weights: FloatArray, experiments: int) -> IntArray:
    """Rounds weights (n,) to numbers of experiments so that each weight loses the least share of itself.

    There is at least one experiment for each positive weight; those at 0 get nothing.

    Source:
        Pukelsheim and Rieder (1992), "Efficient rounding of approximate designs".
    """
    used = np.flatnonzero(weights > 0)
    if used.size > experiments:
        raise ValueError(f"Argument `experiments` must be at least {used.size}, one per weight, but is {experiments}.")
    share = weights[used] / weights[used].sum()
    # Pukelsheim and Rieder: start at ceil((n - l / 2) w), then adjust where the share suffers least.
    counts = np.ceil((experiments - used.size / 2) * share).astype(int)
    while counts.sum() < experiments:
        counts[np.argmin(counts / share)] += 1
    while counts.sum() > experiments:
        counts[np.argmax((counts - 1) / share)] -= 1
    whole = np.zeros(weights.size, int)
    whole[used] = counts
    return whole
