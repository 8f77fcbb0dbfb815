"""The penalised fit: cone programs as steps, weights and estimate in turn."""

from __future__ import annotations

from dataclasses import dataclass

import clarabel
import numpy as np
from scipy import sparse

from robid.arrays import BoolArray, FloatArray, IntArray
from robid.models.lpv.fit.options import SparsityOptions
from robid.models.lpv.fit.responses import Problem, cost, normal
from robid.models.lpv.fit.state_space import Blocks, list_blocks, measure, similarity_tangent, spread, unpack


def minimise_model(
    hessian: FloatArray,
    gradient: FloatArray,
    point: FloatArray,
    members: tuple[IntArray, ...],
    price: FloatArray,
    held: FloatArray,
) -> FloatArray:
    """Minimises `d' H d + 2 g' d + sum_b price_b |x_b + d_b|` over the step d, with `held' d = 0`.

    Every norm is bounded by a variable of its own, in a second-order cone; H and g hold whatever rows there were. The
    elements without a price are eliminated first. H (n_free, n_free) is positive definite; a block has members in x
    (n_free,) and a price (n_block,); directions without a part in the step (n_free, n_held) are orthonormal. The step
    is no numbers where the solver fails, which a descent takes for a step too long.

    Source:
        Turk et al. (2018), eq. 12, for one Levenberg-Marquardt step.
    """
    priced = np.concatenate(members)
    follow, rest = _eliminate(hessian, gradient, priced, held)
    curved = follow.T @ hessian @ follow
    sloped = follow.T @ (gradient + hessian @ rest)
    return np.asarray(follow @ _solve(curved, sloped, point[priced], [len(member) for member in members], price) + rest)


def _eliminate(
    hessian: FloatArray, gradient: FloatArray, priced: IntArray, held: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Lets the elements without a price follow those with one: `d = follow d_priced + rest` minimises over them."""
    n_free, n_held = held.shape
    other = np.setdiff1d(np.arange(n_free), priced)
    size = np.sqrt(np.diag(hessian)[other])
    units = np.concatenate([1 / size, np.full(n_held, size.mean())])  # all entries near one
    saddle = np.zeros((len(units), len(units)))
    saddle[: len(other), : len(other)] = hessian[np.ix_(other, other)]
    saddle[: len(other), len(other) :] = held[other]
    saddle[len(other) :, : len(other)] = held[other].T
    moved = np.concatenate([hessian[np.ix_(other, priced)], held[priced].T])
    right = -np.column_stack([moved, np.concatenate([gradient[other], np.zeros(n_held)])])
    # Stationary by the unpriced elements, with a multiplier for each held direction; affine in the priced ones.
    both = np.linalg.solve(saddle * np.outer(units, units), right * units[:, None]) * units[:, None]
    follow, rest = np.zeros((n_free, len(priced))), np.zeros(n_free)
    follow[priced, np.arange(len(priced))] = 1.0
    follow[other], rest[other] = both[: len(other), :-1], both[: len(other), -1]
    return follow, rest


def _solve(
    hessian: FloatArray, gradient: FloatArray, point: FloatArray, sizes: list[int], price: FloatArray
) -> FloatArray:
    """The cone program itself: only elements with a price, block behind block."""
    n, n_block = len(gradient), len(sizes)
    # Unknowns are the steps, then a bound t_b of each norm: the cost is quadratic in the former, linear in the latter.
    scale = 1 / max(float(np.abs(gradient).max()), float(price.max()), np.finfo(float).tiny)
    ends = np.concatenate([np.arange(n + 1) * np.arange(1, n + 2) // 2, np.full(n_block, n * (n + 1) // 2)])
    lower = np.tril_indices(n)
    P = sparse.csc_matrix((2 * scale * hessian[lower], lower[1], ends), shape=(n + n_block, n + n_block))
    # Slack s = right - A (d, t) must lie in the cones: s_b = (t_b, x_b + d_b), the bound at the head of each.
    heads = np.cumsum([0, *(size + 1 for size in sizes[:-1])])
    rows = np.concatenate([np.delete(np.arange(n + n_block), heads), heads])
    A = sparse.csc_matrix((-np.ones(n + n_block), rows, np.arange(n + n_block + 1)), shape=(n + n_block, n + n_block))
    right = np.zeros(n + n_block)
    right[rows[:n]] = point
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    cones = [clarabel.SecondOrderConeT(1 + size) for size in sizes]
    q = scale * np.concatenate([2 * gradient, price])
    solution = clarabel.DefaultSolver(P, q, A, right, cones, settings).solve()
    return np.array(solution.x[:n])


_FIRST_DAMPING = 1e-4
_LEAST_DAMPING = 1e-9
_MOST_DAMPING = 1e8
_SMALL_DAMPING = 1e-2  # a small decrease under more damping ends nothing


@dataclass(frozen=True)
class Penalised:
    """Cost plus prices times norms of blocks."""

    problem: Problem  # what the model is held against
    blocks: Blocks  # elements that may move, and those that have a price together
    price: FloatArray  # (4, n_function): what a block's norm costs

    @property
    def prices(self) -> FloatArray:
        """What the norm of each kept block costs (n_block,)."""
        return np.asarray(self.price[self.blocks.where[:, 0], self.blocks.where[:, 1]])

    def place(self, point: FloatArray) -> FloatArray:
        """Returns the model (n_function + 1, n_local) of free elements (n_free,)."""
        full = np.zeros((self.problem.values.shape[1], self.problem.sizes.n_local))
        full.ravel()[self.blocks.free] = point
        return full

    def penalty(self, point: FloatArray) -> float:
        """Returns what the blocks cost."""
        norms = [np.linalg.norm(point[member]) for member in self.blocks.members]
        return float(self.prices @ np.array(norms))

    def objective(self, point: FloatArray) -> float:
        """Returns cost and penalty."""
        return cost(self.problem, self.place(point)) + self.penalty(point)

    def basis_changes(self, point: FloatArray) -> FloatArray:
        """Returns directions (n_free, n_state^2) in which the states' basis alone changes, orthonormal.

        They alter no structure and no response, but norms would drift along them.
        """
        tangent = similarity_tangent(unpack(self.place(point), self.problem.sizes))
        return np.asarray(np.linalg.qr(tangent.reshape(-1, tangent.shape[-1])[self.blocks.free])[0])


@dataclass(frozen=True)
class Descent:
    """Where a descent at fixed prices ended."""

    parameters: FloatArray  # (n_function + 1, n_local): the model
    objective: float  # cost and penalty there
    steps: int  # cone programs solved


@dataclass(frozen=True)
class Quadratic:
    """The cost about one point."""

    cost: float  # the cost there
    gradient: FloatArray  # (n_free,): half its gradient by the free elements
    hessian: FloatArray  # (n_free, n_free): half its Gauss-Newton Hessian
    held: FloatArray  # (n_free, n_held): directions that take no part in a step

    def value(self, step: FloatArray) -> float:
        """Returns the quadratic model after a step."""
        return self.cost + float(step @ (2 * self.gradient + self.hessian @ step))


def descend(priced: Penalised, start: FloatArray, *, tolerance: float, step_limit: int) -> Descent:
    """Minimises cost plus prices times norms from a start (n_function + 1, n_local).

    It stops at a relative decrease, had or foreseen, or after so many cone programs.
    """
    point = start.ravel()[priced.blocks.free]
    objective, here = priced.objective(point), _expand(priced, point)
    damping, growth, steps = _FIRST_DAMPING, 2.0, 0
    while steps < step_limit and damping < _MOST_DAMPING:
        steps += 1
        # Foreseen is the decrease of quadratic cost and exact penalty: the norms are no part of the approximation.
        trial = point + take_step(priced, point, here, damping)
        foreseen = objective - here.value(trial - point) - priced.penalty(trial)
        had = objective - priced.objective(trial)
        small = tolerance * objective if damping <= _SMALL_DAMPING else 0.0
        if had > 0:
            point, objective = trial, objective - had
            gain = had / foreseen if foreseen > 0 else 1.0
            damping, growth = max(damping * max(1 / 5, 1 - (2 * min(gain, 1.0) - 1) ** 3), _LEAST_DAMPING), 2.0
        else:
            damping, growth = damping * growth, growth * 2
        if foreseen <= small or 0 < had <= small:
            break
        if had > 0:
            here = _expand(priced, point)
    return Descent(priced.place(point), objective, steps)


def _expand(priced: Penalised, point: FloatArray) -> Quadratic:
    full, free = normal(priced.problem, priced.place(point)), priced.blocks.free
    return Quadratic(full.cost, full.gradient[free], full.hessian[np.ix_(free, free)], priced.basis_changes(point))


def take_step(priced: Penalised, point: FloatArray, here: Quadratic, damping: float) -> FloatArray:
    """Returns the step (n_free,) from a point (n_free,) under a damping relative to the Hessian's diagonal."""
    # Marquardt's damping by the diagonal does not depend on the units of parameters.
    curved = here.hessian + np.diag(damping * np.diag(here.hessian))
    return minimise_model(curved, here.gradient, point, priced.blocks.members, priced.prices, here.held)


@dataclass(frozen=True)
class SparseFit:
    """Where a penalised fit ended."""

    parameters: FloatArray  # (n_function + 1, n_local): the model, vanished blocks exactly zero
    kept: BoolArray  # (4, n_function): which blocks are left
    steps: int  # cone programs solved


def fit_sparse(
    problem: Problem, start: FloatArray, largest: FloatArray, gamma: float, options: SparsityOptions
) -> SparseFit:
    """Fits a model whose blocks have a price, until the prices stay.

    A block that has vanished stays so. The start (n_function + 1, n_local) is a fit without prices, `largest`
    (n_function,) the largest value of each basis function, and `gamma` the price of a block in units of the cost.

    Source:
        Turk et al. (2018), sec. II-C, eq. 12-16.
    """
    parameters, kept, steps, passes = start, np.ones((4, len(largest)), bool), 0, 0
    relative = measure(start, largest, problem.sizes).relative
    while kept.any() and passes < options.reweightings:
        passes += 1
        scale = measure(parameters, largest, problem.sizes).scale
        # Prices fall with the size that a block had one pass before: near zero they count blocks rather than measure
        # them.
        price = gamma * scale / (relative + options.epsilon)
        priced = Penalised(problem, list_blocks(kept, problem.sizes), price)
        descent = descend(priced, parameters, tolerance=options.tolerance, step_limit=options.step_limit)
        parameters, steps = descent.parameters, steps + descent.steps
        before, relative = relative, measure(parameters, largest, problem.sizes).relative
        kept = kept & (relative > options.zero)
        # Interior-point steps end near zero, not at it: what is small is set to zero and stays there.
        parameters = parameters * spread(kept, problem.sizes)
        if np.all(np.abs(relative - before) <= options.settled * (before + options.epsilon)):
            break
    return SparseFit(parameters, kept, steps)
