"""What a choice of configurations may spend, and the numbers of experiments that make most of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.design.criteria import worth
from robid.design.exchange import Exchange, best_exchange, efficient_rounding, merged
from robid.design.options import DesignOptions
from robid.design.relaxed import Relaxed, relaxed_design
from robid.design.seen import is_regular
from robid.errors import SettingsError

_POOL = 400
"""Candidates of the largest slopes at the optimum that exchange looks at."""
_FLOOR = 1e-9
"""Share of the optimal information that keeps few experiments' worth comparable while they do not see everything."""


@dataclass(frozen=True)
class Plan:
    """A choice to be made.

    Attributes:
        options: Criterion, numbers and limits.
        matrices (n_draw, n_cand, n_param, n_param): Information of one experiment in each candidate.
        parts (n_draw, n_cand, n_part, n_param, n_param): What adds up over experiments: the information alone, or
            bread and meat of a fit with its own weights.
        prior (n_param, n_param): What is known beforehand.
        cost (n_cand,): Cost of one experiment.
        experiments: Number of experiments.
        budget: What they may cost together.
    """

    options: DesignOptions
    matrices: FloatArray
    parts: FloatArray
    prior: FloatArray
    cost: FloatArray
    experiments: int
    budget: float

    def totals(self, counts: IntArray) -> FloatArray:
        """Total information (n_draw, n_param, n_param) of some numbers of experiments, a fit's own included."""
        used = np.flatnonzero(counts)
        return merged(self.prior + np.tensordot(self.parts[:, used], counts[used], (1, 0)))

    def worth(self, counts: IntArray) -> float:
        """Worth of some numbers of experiments."""
        return float(worth(self.options.criterion, self.totals(counts)))

    def bound(self, found: Relaxed) -> float:
        """What no numbers of experiments within the weights' limits are worth more than."""
        return float(self.budget * found.worth * (1 + found.gap))

    def relaxed(self, candidates: IntArray | None = None, limit: float = 1.0) -> Relaxed:
        """Optimal shares of the cost among all candidates, or some."""
        chosen = slice(None) if candidates is None else candidates
        return relaxed_design(
            self.matrices[:, chosen] / self.cost[chosen][:, None, None],
            criterion=self.options.criterion,
            gap=self.options.gap,
            iterations=self.options.iterations,
            prior=self.prior / self.budget,
            limit=limit,
        )


def checked_plan(options: DesignOptions, cost: FloatArray) -> tuple[int, float]:
    """Number of experiments and what they may cost.

    Raises:
        SettingsError: If there are too few candidates, or the budget does not pay the cheapest.
    """
    if options.count > cost.size:
        raise SettingsError(
            f"{options.count} configurations cannot be chosen from {cost.size} candidates.",
            where="design.count",
            remedy="Lower count, or give the campaign more candidates.",
        )
    experiments = options.experiments or options.count
    budget = options.budget or experiments * float(cost.mean())
    cheapest = np.sort(cost)[: options.count].sum() if options.experiments is None else experiments * cost.min()
    if cheapest > budget * (1 + 1e-12):
        raise SettingsError(
            f"The budget of {budget:g} does not pay {experiments} experiments: the cheapest cost {cheapest:g}.",
            where="design.budget",
            remedy="Raise budget, or ask for fewer experiments.",
        )
    return experiments, budget


def choose_counts(plan: Plan, relaxed: Relaxed) -> IntArray:
    """Numbers of experiments (n_cand,): different candidates by exchange, then shares of repeats among them."""
    order = np.argsort(-relaxed.slopes, kind="stable")
    pool = np.union1d(order[:_POOL], np.flatnonzero(relaxed.weights))
    visits = relaxed.weights / plan.cost
    problem = _exchange(plan, relaxed, pool)
    distinct = min(problem.distinct, problem.experiments)
    once = replace(problem, experiments=distinct, distinct=distinct, repeats=False)
    counts = best_exchange(once, visits[pool], plan.options.restarts, plan.options.seed)
    whole = np.zeros(plan.cost.size, int)
    whole[pool] = counts
    seen = plan.prior + np.tensordot(plan.matrices, whole, (1, 0))
    if problem.repeats and all(is_regular(total) for total in seen):
        used = np.flatnonzero(whole)
        own = np.zeros(plan.cost.size)
        own[used] = plan.relaxed(used).weights / plan.cost[used]
        starts = [counts, *(_rounded(problem, each[pool]) for each in (own, visits))]
        ends = [problem.improved(start) for start in starts]
        whole[pool] = ends[int(np.argmax([problem.worth(end) for end in ends]))]
    return whole


def _exchange(plan: Plan, relaxed: Relaxed, pool: IntArray) -> Exchange:
    optimal = np.einsum("i,dijk->djk", relaxed.weights / plan.cost, plan.matrices)
    return Exchange(
        criterion=plan.options.criterion,
        parts=plan.parts[:, pool],
        base=plan.prior + _FLOOR * np.repeat(optimal[:, None], plan.parts.shape[2], axis=1),
        experiments=plan.experiments,
        distinct=plan.options.count,
        repeats=plan.options.experiments is not None,
        cost=plan.cost[pool],
        budget=plan.budget,
    )


def _rounded(problem: Exchange, visits: FloatArray) -> IntArray:
    """Most experiments that efficient rounding of the weights makes affordable; none if it makes too many kinds."""
    kinds = int((visits > 0).sum())
    for experiments in range(problem.experiments, kinds - 1, -1):
        counts = efficient_rounding(visits, experiments)
        if kinds <= problem.distinct and counts @ problem.cost <= problem.budget * (1 + 1e-12):
            return counts
    return np.zeros(visits.size, int)
