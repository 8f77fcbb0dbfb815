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

    Every norm is bounded by a variable of its own, in a second-order cone; H and g hold whatever rows there were.

    Args:
        hessian (n_free, n_free): H, positive definite where nothing is held.
        gradient (n_free,): g.
        point (n_free,): x.
        members: Places of each block's elements in x.
        price (n_block,): What a block's norm costs.
        held (n_free, n_held): Directions without a part in the step, orthonormal.

    Returns:
        The step (n_free,).

    Raises:
        RuntimeError: If the solver finds none.

    Source:
        Turk et al. (2018), eq. 12, for one Levenberg-Marquardt step.
    """
    n_free, n_block, n_held = len(gradient), len(members), held.shape[1]
    scale = 1 / max(float(np.abs(gradient).max()), float(price.max(initial=0.0)), np.finfo(float).tiny)
    P = sparse.block_diag([np.triu(2 * scale * hessian), sparse.csc_matrix((n_block, n_block))], format="csc")
    q = scale * np.concatenate([2 * gradient, price])
    columns = np.concatenate([np.concatenate([[n_free + index], member]) for index, member in enumerate(members)])
    cone_rows = sparse.csc_matrix(
        (-np.ones(len(columns)), (np.arange(len(columns)), columns)), shape=(len(columns), n_free + n_block)
    )
    still = sparse.hstack([sparse.csc_matrix(held.T), sparse.csc_matrix((n_held, n_block))])
    right = np.concatenate([np.zeros(n_held), *(np.concatenate([[0.0], point[member]]) for member in members)])
    cones = [clarabel.ZeroConeT(n_held), *(clarabel.SecondOrderConeT(1 + len(member)) for member in members)]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    A = sparse.vstack([still, cone_rows], format="csc")
    solution = clarabel.DefaultSolver(P, q, A, right, cones, settings).solve()
    found = np.array(solution.x[:n_free])
    if not np.all(np.isfinite(found)):
        raise RuntimeError(f"The cone program of a step has no solution: {solution.status}.")
    return found
