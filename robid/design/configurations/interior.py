"""Interior-point steps to the optimal weights of a few candidates, whose matrices are packed as upper triangles."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from robid.arrays import FloatArray, IntArray
from robid.design.configurations.criteria import Criterion, derivatives, loss, tangent

_CHUNK = 4096


@dataclass(frozen=True)
class Packed:
    """Information matrices of all candidates, half the memory of the full ones."""

    # (n_draw, n_cand, n_param (n_param + 1) / 2) upper triangles, off-diagonals times sqrt(2): the product of two rows
    # is the trace of the product of their matrices
    rows: FloatArray
    n_param: int

    @property
    def n_cand(self) -> int:
        """Number of candidates."""
        return int(self.rows.shape[1])

    def total(self, weights: FloatArray) -> FloatArray:
        """Weighted sums (n_draw, n_param, n_param)."""
        return unpack(weights @ self.rows, self.n_param)

    def traces(self, factors: FloatArray) -> FloatArray:
        """Sum over the draws of `tr(factor H_i)` (n_cand,) for symmetric factors (n_draw, n_param, n_param)."""
        pairs = zip(self.rows, pack(factors), strict=True)
        return np.asarray(sum(rows @ factor for rows, factor in pairs))

    def matrices(self, indices: IntArray) -> FloatArray:
        """Full matrices (n_draw, n_index, n_param, n_param) of some candidates."""
        return unpack(self.rows[:, indices], self.n_param)


def pack(matrices: FloatArray) -> FloatArray:
    """Packs symmetric matrices (..., n, n) into rows (..., n (n + 1) / 2) as `Packed` holds them."""
    size = matrices.shape[-1]
    upper, scale, _ = _layout(size)
    flat = matrices.reshape(-1, size * size)
    rows = np.empty((len(flat), upper.size))
    for begin in range(0, len(flat), _CHUNK):
        # tr(A B) = sum_i a_ii b_ii + 2 sum_i<j a_ij b_ij: off-diagonals times sqrt(2) in each row.
        np.multiply(flat[begin : begin + _CHUNK, upper], scale, out=rows[begin : begin + _CHUNK])
    return rows.reshape(*matrices.shape[:-2], upper.size)


def unpack(rows: FloatArray, size: int) -> FloatArray:
    """The inverse of `pack`."""
    _, scale, place = _layout(size)
    return np.asarray((rows / scale)[..., place].reshape(*rows.shape[:-1], size, size))


@lru_cache(maxsize=8)
def _layout(size: int) -> tuple[IntArray, FloatArray, IntArray]:
    """Flat indices of the upper triangle, its scales, and where each flat element stands in a row."""
    first, second = np.triu_indices(size)
    place = np.zeros((size, size), int)
    place[first, second] = place[second, first] = np.arange(first.size)
    return first * size + second, np.where(first == second, 1.0, np.sqrt(2)), place.ravel()


STEPS = 80  # Limit on steps between two looks at all candidates
_RIDGE = 1e-14  # Added to the Newton matrix of unit diagonal against rounding


@dataclass(frozen=True)
class RelaxedProblem:
    """A relaxed design."""

    criterion: Criterion
    candidates: Packed
    prior: FloatArray  # (n_param, n_param) What is added to it
    limit: float

    def totals(self, weights: FloatArray) -> FloatArray:
        """Weighted information (n_draw, n_param, n_param) with the prior."""
        return np.asarray(self.candidates.total(weights) + self.prior)


def most(slopes: FloatArray, limit: float) -> float:
    """Largest product with weights on the simplex, none above the limit."""
    # A linear function over the simplex with limits: the largest slopes take their limit, the next one the rest.
    whole = min(int(1 / limit * (1 + 1e-12)), slopes.size)
    if whole >= slopes.size:
        return float(slopes.mean())
    top = -np.sort(-np.partition(slopes, slopes.size - whole - 1)[slopes.size - whole - 1 :])
    return float(limit * top[:whole].sum() + max(1 - limit * whole, 0.0) * top[whole])


def level(slopes: FloatArray, limit: float) -> float:
    """Slope that a candidate needs to have weight."""
    rank = min(round(1 / limit), slopes.size - 1) if limit < 1 else 0
    return float(-np.partition(-slopes, rank)[rank])


def descend(
    problem: RelaxedProblem, working: IntArray, weights: FloatArray, smoothing: float, wanted: float, most_steps: int
) -> tuple[FloatArray, float, int]:
    """Interior-point steps on some candidates: weights (n,) of a small gap, the smoothing reached, number of steps.

    They begin at weights (n,) of the working candidates (n,), sum 1, inside their limits, and at a smoothing of `e`;
    they stop at the relative gap that is wanted.
    """
    matrices = problem.candidates.matrices(working)
    flat = matrices.reshape(*matrices.shape[:2], -1)
    bounded = problem.limit < 1
    barrier, reduction, limit = smoothing, 0.1, min(STEPS, most_steps)
    for step in range(limit + 1):
        totals = (weights @ flat).reshape(-1, *matrices.shape[2:]) + problem.prior
        room = problem.limit - weights if bounded else np.ones(weights.size)
        # Duality gap on these candidates: no weights gain more than the tangent allows.
        bound = tangent(problem.criterion, totals, barrier)
        slopes = (flat @ bound.factors.reshape(len(flat), -1, 1))[..., 0].sum(axis=0)
        gap = (most(slopes, problem.limit) - slopes @ weights + bound.excess) / bound.scale
        if gap <= wanted or step == limit:
            break
        if problem.criterion == "e":
            barrier *= reduction if step else 1.0
            # Primal barrier of `e`: multipliers are barrier over slack.
            lower, upper = barrier / weights, barrier / room if bounded else np.zeros(weights.size)
        else:
            if step == 0:
                # Multipliers that slopes suggest: what lacks slope presses against zero.
                lower, upper = _first_duals(problem, slopes, 0.1 * gap * bound.scale)
            # Complementarity: the mean product of slack and multiplier, aimed at a share of what it is.
            barrier = (reduction if step else 0.3) * float(lower @ weights + upper @ room) / weights.size
        slopes, root = derivatives(problem.criterion, totals, matrices, barrier)
        force = slopes + barrier / weights - (barrier / room if bounded else 0)
        # Newton step of the perturbed KKT conditions, multipliers eliminated (primal-dual interior point).
        direction = _constrained_step(root, lower / weights + upper / room, force)
        # The multipliers' steps follow from w z = barrier, linearised.
        lower_step = barrier / weights - lower - lower / weights * direction
        upper_step = barrier / room - upper + upper / room * direction if bounded else upper
        longest = _longest(weights, direction, room if bounded else None)
        taken = _searched(problem, flat, (weights, direction, force), (longest, barrier))
        if taken == 0.0:
            break
        # Primal and dual steps each go as far as positivity allows.
        dual = min(_longest(lower, lower_step, None), _longest(upper, upper_step, None) if bounded else 1.0)
        weights = weights + taken * direction
        weights = weights / weights.sum()
        lower, upper = lower + dual * lower_step, upper + dual * upper_step
        if problem.criterion == "e":
            # The smoothing acts as a primal barrier: it may fall once the weights have followed.
            reduction = 0.3 if taken == 1.0 and force @ direction < 1e-4 * barrier else 1.0
        else:
            reduction = 0.1 if min(taken, dual) > 0.8 else 0.3 if min(taken, dual) > 0.3 else 0.7
    return weights, barrier, step


def _first_duals(problem: RelaxedProblem, slopes: FloatArray, least: float) -> tuple[FloatArray, FloatArray]:
    """Multipliers of the lower and upper limits that slopes suggest."""
    needed = level(slopes, problem.limit)
    above = least if problem.limit < 1 else 0.0
    return np.maximum(needed - slopes, 0) + least, np.maximum(slopes - needed, 0) + above


def _constrained_step(root: FloatArray, diagonal: FloatArray, force: FloatArray) -> FloatArray:
    """Newton step that keeps the sum of the weights, with curvature `root root' + diag(diagonal)`."""
    # Unit diagonal before factorising: weights near zero make huge barrier terms.
    scale = np.sqrt((root**2).sum(axis=1) + diagonal)
    scaled, added = root / scale[:, None], diagonal / scale**2
    factor = cho_factor(scaled @ scaled.T + np.diag(added + _RIDGE), check_finite=False)
    # The multiplier of sum w = 1 makes the step sum to zero: a second solve with ones.
    free, even = (cho_solve(factor, each / scale, check_finite=False) / scale for each in (force, np.ones_like(force)))
    return np.asarray(free - even * (free.sum() / even.sum()))


def _longest(values: FloatArray, change: FloatArray, room: FloatArray | None) -> float:
    """Largest step up to 1 that keeps values positive, and within their room."""
    ratio = float(np.max(-change / values))
    if room is not None:
        ratio = max(ratio, float(np.max(change / room)))
    return min(1.0, 0.99 / ratio) if ratio > 0 else 1.0


def _searched(
    problem: RelaxedProblem, flat: FloatArray, step: tuple[FloatArray, ...], ends: tuple[float, float]
) -> float:
    """Step length at which loss and barrier together fall; 0 if there is none."""
    (weights, direction, force), (longest, barrier) = step, ends
    size = problem.candidates.n_param

    def merit(trial: FloatArray) -> float:
        totals = (trial @ flat).reshape(-1, size, size) + problem.prior
        value = loss(problem.criterion, totals, barrier) - barrier * float(np.log(trial).sum())
        return value - (barrier * float(np.log(problem.limit - trial).sum()) if problem.limit < 1 else 0.0)

    here, falling = merit(weights), -float(force @ direction)
    noise = 1e-12 * (1 + abs(here))
    taken = longest
    # Armijo's rule on loss and barrier, halving.
    while taken > 1e-6:
        if merit(weights + taken * direction) <= here + 1e-4 * taken * falling + noise:
            return taken
        taken *= 0.5
    return 0.0
