"""One step of the penalised fit: a second-order cone program."""

from __future__ import annotations

import clarabel
import numpy as np
from scipy import sparse

from robid.arrays import FloatArray, IntArray


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
    elements without a price are eliminated first.

    Args:
        hessian (n_free, n_free): H, positive definite.
        gradient (n_free,): g.
        point (n_free,): x.
        members: Places of each block's elements in x; at least one block.
        price (n_block,): What a block's norm costs.
        held (n_free, n_held): Directions without a part in the step, orthonormal.

    Returns:
        The step (n_free,); no numbers where the solver fails, which a descent takes for a step too long.

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
    scale = 1 / max(float(np.abs(gradient).max()), float(price.max()), np.finfo(float).tiny)
    ends = np.concatenate([np.arange(n + 1) * np.arange(1, n + 2) // 2, np.full(n_block, n * (n + 1) // 2)])
    lower = np.tril_indices(n)
    P = sparse.csc_matrix((2 * scale * hessian[lower], lower[1], ends), shape=(n + n_block, n + n_block))
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
