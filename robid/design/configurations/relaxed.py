"""Optimal weights of candidates with a certificate: interior point on a few candidates, prices for all the others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.design.configurations.criteria import Criterion, tangent, worth
from robid.design.configurations.interior import Packed, RelaxedProblem, descend, level, most, pack

_UPDATES = 8  # Multiplicative updates of all candidates that find the first ones to work on
_LEAST_GAP_E = 1e-4  # Where the arithmetic of the smoothed smallest eigenvalue ends
_PATIENCE = 4  # Looks at all candidates without progress after which to stop


@dataclass(frozen=True)
class Relaxed:
    """Optimal weights."""

    weights: FloatArray  # (n_cand,) Weights, sum 1; 0 for what is not needed
    # Certified relative gap: every other weighting is worth at most `1 + gap` times as much. For `d` without prior it
    # is `(max tr(M^-1 H_i) - n) / n`
    gap: float
    # (n_cand,) Slope of the criterion by each weight, relative to what the optimum's support has: a candidate at 1 is
    # as good as the chosen ones, one at 0 is useless
    slopes: FloatArray
    worth: float  # What the weighted information is worth, see `robid.design.configurations.criteria.worth`
    steps: int


def relaxed_design(
    matrices: FloatArray | Packed,
    *,
    criterion: Criterion = "d",
    gap: float = 1e-8,
    iterations: int = 1000,
    prior: FloatArray | None = None,
    limit: float = 1.0,
) -> Relaxed:
    """Maximises the worth of `H_0 + sum_i w_i H_i` over the simplex; the certificate holds at any gap.

    Costs are substituted: give `H_i / c_i` and read the weights as shares of the cost.

    Args:
        matrices (n_cand, n_param, n_param): Information of each candidate, or (n_draw, n_cand, n_param, n_param)
            under draws of the parameters; the sum over the candidates is regular under each.
        criterion: `d`: largest mean `log det`; `a`: smallest mean trace of the inverse; `e`: largest lowest eigenvalue
            under the worst draw.
        gap: Relative gap at which to stop; for `e` at least 1e-4.
        iterations: Limit on interior-point steps, of which there are tens.
        prior (n_param, n_param): What is known beforehand, `H_0`, over the planned number of experiments.
        limit: Largest weight, at least `1 / n_cand`: `1 / k` bounds every design of k different candidates.

    Source:
        Equivalence theorem: Kiefer and Wolfowitz (1960); Zimmermann et al. (2023), eq. 5-6.
    """
    if not isinstance(matrices, Packed):
        draws = matrices if matrices.ndim == 4 else matrices[None]
        matrices = Packed(pack(draws), draws.shape[-1])
    size = matrices.n_param
    gap = max(gap, _LEAST_GAP_E) if criterion == "e" else gap
    problem = RelaxedProblem(criterion, matrices, np.zeros((size, size)) if prior is None else prior, limit)
    # Column generation: interior point on few candidates, then prices of all others; newcomers enter.
    working, weights, smoothing = _start(problem)
    wanted, steps, stalled = 1e-2, 0, 0
    best: Relaxed | None = None
    while True:
        weights, smoothing, used = descend(problem, working, weights, smoothing, wanted, iterations - steps)
        steps += used
        full = np.zeros(matrices.n_cand)
        full[working] = weights
        found, slopes = _priced(problem, full, smoothing, steps)
        stalled = 0 if best is None or found.gap < best.gap else stalled + 1
        best = found if best is None or found.gap < best.gap else best
        if best.gap <= gap or steps >= iterations or stalled == _PATIENCE:
            return _pruned(problem, best, smoothing, gap, iterations - steps)
        # Early rounds need no small gap: the working set still changes.
        wanted = max(min(0.1 * found.gap, 0.1 * wanted), 0.3 * gap)
        working, weights = _enlarged(problem, working, weights, slopes)
        # Newcomers are far from the path that ends where the weights are: it is joined where it is wider.
        smoothing = max(smoothing, 0.1 * found.gap * found.worth / working.size)


def _start(problem: RelaxedProblem) -> tuple[IntArray, FloatArray, float]:
    """The candidates to begin with, as many as make a regular total, their weights, and the smoothing of `e`."""
    packed = problem.candidates
    weights = np.full(packed.n_cand, 1 / packed.n_cand)
    power = 1.0 if problem.criterion == "d" else 0.5
    for _ in range(_UPDATES):
        totals = problem.totals(weights)
        smoothing = 0.3 * float(np.linalg.eigvalsh(totals)[..., 0].min()) / packed.n_param
        slopes = packed.traces(tangent(problem.criterion, totals, smoothing).factors)
        # Multiplicative update (Titterington): weights times their slopes stay on the simplex and never lower D.
        weights = weights * np.maximum(slopes, 0) ** power
        weights /= weights.sum()
    count = max(3 * packed.n_param, 30, int(np.ceil(2 / problem.limit)) if problem.limit < 1 else 0)
    order = np.argsort(-weights, kind="stable")
    whole = np.linalg.eigvalsh(problem.totals(weights))[..., 0]
    while count < packed.n_cand:
        working = order[:count]
        part = _spread(problem, weights[working])
        if (np.linalg.eigvalsh(_part_totals(problem, working, part))[..., 0] > 1e-3 * whole).all():
            return working, part, smoothing
        count *= 2
    return order, _spread(problem, weights[order]), smoothing


def _spread(problem: RelaxedProblem, weights: FloatArray) -> FloatArray:
    even = 1 / weights.size
    mixed = 0.9 * weights / weights.sum() + 0.1 * even
    if mixed.max() < problem.limit:
        return np.asarray(mixed)
    # A convex mixture with even weights brings the largest one below its limit.
    share = 0.9 * max(problem.limit - even, 0) / (mixed.max() - even) if mixed.max() > even else 0.0
    return np.asarray(even + share * (mixed - even))


def _part_totals(problem: RelaxedProblem, working: IntArray, weights: FloatArray) -> FloatArray:
    part = Packed(problem.candidates.rows[:, working], problem.candidates.n_param)
    return np.asarray(part.total(weights) + problem.prior)


def _enlarged(
    problem: RelaxedProblem, working: IntArray, weights: FloatArray, slopes: FloatArray
) -> tuple[IntArray, FloatArray]:
    outside = slopes.copy()
    outside[working] = -np.inf
    reached = slopes[working] @ weights
    if problem.limit < 1:
        reached = slopes[working].min()
    count = min(3 * problem.candidates.n_param, outside.size)
    best = np.argpartition(-outside, count - 1)[:count]
    new = best[outside[best] > reached]
    share = 1e-3
    extended = np.concatenate([(1 - share * bool(new.size)) * weights, np.full(new.size, share / max(new.size, 1))])
    return np.concatenate([working, new]), extended


def _pruned(problem: RelaxedProblem, found: Relaxed, smoothing: float, gap: float, most_steps: int) -> Relaxed:
    """Leaves out what the optimum does not need: weights that are smaller than their candidates' lack of slope."""
    # Complementary slackness: at the optimum a candidate with weight has the full slope.
    lack = level(found.slopes, problem.limit) - found.slopes
    kept = np.flatnonzero(found.weights > np.maximum(lack, 0))
    weights = found.weights[kept] / found.weights[kept].sum()
    if kept.size < 2 or weights.max() >= problem.limit:
        return found
    if (np.linalg.eigvalsh(_part_totals(problem, kept, weights))[..., 0] <= 0).any():
        return found
    weights, smoothing, used = descend(problem, kept, weights, smoothing, 0.3 * gap, most_steps)
    full = np.zeros(found.weights.size)
    full[kept] = weights
    pruned, _ = _priced(problem, full, smoothing, found.steps + used)
    return pruned if pruned.gap <= max(gap, found.gap) else found


def _priced(problem: RelaxedProblem, weights: FloatArray, smoothing: float, steps: int) -> tuple[Relaxed, FloatArray]:
    totals = problem.totals(weights)
    value = float(worth(problem.criterion, totals))
    if value == 0:
        return Relaxed(weights, np.inf, np.zeros(weights.size), 0.0, steps), np.zeros(weights.size)
    bound = tangent(problem.criterion, totals, smoothing)
    slopes = problem.candidates.traces(bound.factors)
    # Certificate for all candidates: the largest tangent over the simplex less that at the weights.
    gap = float((most(slopes, problem.limit) - slopes @ weights + bound.excess) / bound.scale)
    return Relaxed(weights, max(gap, 0.0), slopes / (slopes @ weights), value, steps), slopes
