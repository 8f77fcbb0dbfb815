"""What a choice of configurations may spend, its optimal weights, and the numbers of experiments that they lead to."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.design.configurations.criteria import is_regular, worth
from robid.design.configurations.exchange import Exchange, Information, best_exchange, efficient_rounding
from robid.design.configurations.options import DesignOptions
from robid.design.configurations.relaxed import Relaxed, relaxed_design
from robid.design.configurations.visits import Visits, merged, reduced, slopes
from robid.errors import SettingsError

_POOL = 400  # Candidates of the largest slopes at the optimum that exchange looks at
# Share of the optimal information that keeps few experiments' worth comparable while they do not see everything.
_FLOOR = 1e-9


@dataclass(frozen=True)
class ConfigurationPlan:
    """A choice to be made."""

    options: DesignOptions
    # (n_draw, n_cand, n_param, n_param) Information of one experiment in each candidate, or for a fit with its own
    # weights what its sums never exceed. So many times it, no number of experiments tells more
    matrices: FloatArray
    # What adds up over experiments: the information alone, or bread and meat of a fit with its own weights, nuisances
    # last
    visits: Visits
    prior: FloatArray  # (n_param, n_param) What is known beforehand, beside `matrices`; may be one for each draw
    base: FloatArray  # (n_part, n_all, n_all) The same beside `visits`
    cost: FloatArray  # (n_cand,) Cost of one experiment
    experiments: int
    budget: float

    def totals(self, counts: IntArray) -> FloatArray:
        """Total information (n_draw, n_param, n_param) of some numbers of experiments, a fit's own included."""
        return merged(self.sums(counts), self.wanted)

    def sums(self, counts: IntArray) -> FloatArray:
        """Sums (n_draw, n_part, n_all, n_all) of the parts."""
        return np.asarray(self.base + self.visits.total(counts))

    def seen(self, counts: IntArray) -> FloatArray:
        """What some numbers of experiments see (n_draw, n_param, n_param), by the weights that are used."""
        used = np.flatnonzero(counts)
        whole = self.base + np.tensordot(self.visits.alone[:, used], counts[used], (1, 0))
        return reduced(whole, self.wanted)[:, 0]

    @property
    def wanted(self) -> int:
        """Number of parameters that the choice is about."""
        return int(self.matrices.shape[-1])

    def worth(self, counts: IntArray) -> float:
        """Worth of some numbers of experiments."""
        return float(worth(self.options.of_information, self.totals(counts)))

    def bound(self, found: Relaxed) -> float:
        """What no numbers of experiments within the weights' limits are worth more than."""
        return float(self.budget * found.worth * (1 + found.gap))

    def relaxed(self, candidates: IntArray | None = None, limit: float = 1.0) -> Relaxed:
        """Optimal shares of the cost among all candidates, or some."""
        chosen = slice(None) if candidates is None else candidates
        return self._relaxed(self.matrices[:, chosen] / self.cost[chosen][:, None, None], self.prior, limit)

    def shared_out(self, counts: IntArray) -> Relaxed:
        """Optimal shares of the cost among the candidates that have numbers of experiments (n_cand,).

        Where configurations differ, what further experiments tell falls with their number; it stays below its tangent
        at the given numbers, so the bound holds for all others.
        """
        used = np.flatnonzero(counts)
        if not self.visits.between.any() or self.visits.alone.shape[2] > 1:
            return self.relaxed(used)
        # Concave in the number of visits: the tangent at the given numbers bounds all others from above.
        slope = slopes(self.visits.alone[:, used, 0], counts[used], self.visits.between)
        beside = self.visits.total(counts)[:, 0] - np.tensordot(slope, counts[used], ((1,), (0,)))
        return self._relaxed(slope / self.cost[used][:, None, None], self.prior + beside, 1.0)

    def most(self) -> float:
        """What as many candidates as are allowed are worth at most, each with all that could be paid there."""
        count = self.options.count
        # Each candidate with all the visits that it could have bounds what any choice makes of it.
        times = np.minimum(np.floor(self.budget * (1 + 1e-12) / self.cost), self.experiments).astype(int)
        matrices = self.visits.of(np.arange(self.cost.size), times)[:, :, 0]
        found = self._relaxed(matrices * count / self.budget, self.prior, 1 / count)
        return self.bound(found)

    def _relaxed(self, matrices: FloatArray, prior: FloatArray, limit: float) -> Relaxed:
        wanted, prior = self.options, prior / self.budget
        ends = {"gap": wanted.gap, "limit": limit}
        return relaxed_design(
            matrices, criterion=wanted.of_information, iterations=wanted.iterations, prior=prior, **ends
        )


def checked_plan(options: DesignOptions, cost: FloatArray) -> tuple[int, float]:
    """Number of experiments and what they may cost.

    Raises:
        SettingsError: If there are too few candidates, or the budget does not pay the cheapest.
    """
    if options.count > cost.size:
        message = f"S023 {options.count} configurations cannot be chosen from {cost.size} candidates."
        remedy = "Lower count, or give the campaign more candidates."
        raise SettingsError(message, where="design.count", remedy=remedy)
    experiments = options.experiments or options.count
    budget = options.budget or experiments * float(cost.mean())
    cheapest = np.sort(cost)[: options.count].sum() if options.experiments is None else experiments * cost.min()
    if cheapest > budget * (1 + 1e-12):
        message = (
            f"S024 The budget of {budget:g} does not pay {experiments} experiments: the cheapest cost {cheapest:g}."
        )
        raise SettingsError(message, where="design.budget", remedy="Raise budget, or ask for fewer experiments.")
    return experiments, budget


def choose_counts(plan: ConfigurationPlan, relaxed: Relaxed) -> IntArray:
    """Numbers of experiments (n_cand,): different candidates by exchange, then shares of repeats among them."""
    # Exchange looks at the best slopes, and at all that have weight.
    order = np.argsort(-relaxed.slopes, kind="stable")
    pool = np.union1d(order[:_POOL], np.flatnonzero(relaxed.weights))
    visits = relaxed.weights / plan.cost
    problem = _exchange(plan, relaxed, pool)
    distinct = min(problem.distinct, problem.experiments)
    once = replace(problem, experiments=distinct, distinct=distinct, repeats=False)
    counts = best_exchange(once, visits[pool], plan.options.restarts, plan.options.seed)
    whole = np.zeros(plan.cost.size, int)
    whole[pool] = counts
    if problem.repeats and all(is_regular(total) for total in plan.seen(whole)):
        used = np.flatnonzero(whole)
        own = np.zeros(plan.cost.size)
        own[used] = plan.relaxed(used).weights / plan.cost[used]
        starts = [counts, *(_rounded(problem, each[pool]) for each in (own, visits))]
        ends = [problem.improved(start) for start in starts]
        whole[pool] = ends[int(np.argmax([problem.worth(end) for end in ends]))]
    return whole


def _exchange(plan: ConfigurationPlan, relaxed: Relaxed, pool: IntArray) -> Exchange:
    visits = relaxed.weights / plan.cost
    if plan.visits.alone.shape[2] > 1:
        # Other weights than the optimal ones may see nothing where these see all.
        visits = np.full(visits.size, visits.mean())
    base = plan.base + _FLOOR * np.einsum("i,dipjk->dpjk", visits, plan.visits.once)
    return Exchange(
        objective=Information(plan.options.of_information, plan.visits.take(pool), base, plan.wanted),
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
