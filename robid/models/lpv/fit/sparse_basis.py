"""The states' basis at every position in which fewest blocks vary."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray
from robid.models.lpv.fit.blocks import Norms, measure
from robid.models.lpv.fit.options import SparseBasisOptions
from robid.models.lpv.fit.state_space import StateSpace, pack, similarity_tangent, transform
from robid.results.levenberg import Normal, minimise

_FIRST_LEVEL = 1.0  # relative norm at which blocks begin to be told apart
_PREFERENCES = ((1, 1, 1, 1), (30, 1, 1000, 1), (30, 1000, 1, 1))  # first weights of A, B, C, D
_STEPS = 30
_ENOUGH = 1e-4  # relative decrease of a pass' cost


class _Search:
    """What does not change while the basis is searched."""

    def __init__(self, systems: StateSpace, values: FloatArray, largest: FloatArray, fixed: int) -> None:
        self.systems, self.largest, self.fixed = systems, largest, fixed
        inverse = np.linalg.pinv(values)
        # Coefficients of the varying functions, then what no function explains.
        self.combine = np.concatenate([inverse[1:], np.eye(len(values)) - values @ inverse])
        self.inverse = inverse
        self.moved_at = np.delete(np.arange(len(values)), fixed)

    def transformations(self, point: FloatArray) -> FloatArray:
        """The transformation of every position (n_pos, n_state, n_state)."""
        n = self.systems.sizes.n_state
        return np.asarray(np.insert(point.reshape(-1, n, n), self.fixed, np.eye(n), axis=0))

    def norms(self, point: FloatArray) -> Norms:
        """The blocks' norms."""
        packed = pack(transform(self.systems, self.transformations(point)))
        return measure(self.inverse @ packed, self.largest, self.systems.sizes)

    def row_weights(self, norms: Norms, weights: FloatArray, misfit: float) -> FloatArray:
        """Weight of every row and element (n_row, n_local) from those of the blocks (4, n_function)."""
        n_pos = len(self.systems.A)
        blocks = np.concatenate([(weights * norms.scale).T, np.tile(misfit * norms.scale.mean(axis=1), (n_pos, 1))])
        counts = [part.stop - part.start for part in self.systems.sizes.parts]
        return np.asarray(np.repeat(blocks, counts, axis=1))

    def residual(self, point: FloatArray, weights: FloatArray) -> FloatArray:
        """What is made small."""
        packed = pack(transform(self.systems, self.transformations(point)))
        return np.asarray((weights * (self.combine @ packed)).ravel())

    def slope(self, point: FloatArray) -> FloatArray:
        """Derivative of the packed models (n_pos, n_local, n_state^2) by their transformations."""
        T = self.transformations(point)
        n = self.systems.sizes.n_state
        by_change = similarity_tangent(transform(self.systems, T)).reshape(len(T), -1, n, n)
        return np.asarray(np.einsum("qeac,qbc->qeab", by_change, np.linalg.inv(T)).reshape(len(T), -1, n * n))

    def normal(self, point: FloatArray, weights: FloatArray) -> Normal:
        """Its square, half gradient and half Gauss-Newton Hessian."""
        residual = self.residual(point, weights)
        slope = self.slope(point)[self.moved_at]
        jacobian = np.einsum("se,sq,qep->seqp", weights, self.combine[:, self.moved_at], slope)
        jacobian = jacobian.reshape(residual.size, -1)
        return Normal(float(residual @ residual), jacobian.T @ residual, jacobian.T @ jacobian)

    def descend(self, point: FloatArray, weights: FloatArray) -> FloatArray:
        """Makes the weighted residual small."""
        return minimise(
            lambda at: float(np.sum(self.residual(at, weights) ** 2)),
            lambda at: self.normal(at, weights),
            point,
            max_iterations=_STEPS,
            cost_tolerance=_ENOUGH,
        ).parameters


def find_sparse_bases(
    systems: StateSpace, values: FloatArray, largest: FloatArray, *, fixed: int, options: SparseBasisOptions
) -> tuple[StateSpace, ...]:
    """Transforms local models, which keeps their responses, to where few blocks of their interpolation vary.

    Frozen responses leave the basis free at every position, but a block that is zero for the true states stays so
    only under one transformation for all. A local basis of any kind, balanced ones too, differs from that by a
    transformation that varies, and makes all blocks vary. So the transformations are searched: least squares on the
    varying blocks, each divided by its own last norm, from a limit that treats all alike down to the norm that counts
    as none. The search is not convex, and noise hides which of its ends is best: one end is returned for each of
    several preferences (none, a constant C, a constant B), for the fit to tell apart.

    Args:
        systems: Local models in one basis, well conditioned.
        values (n_pos, n_function + 1): The basis functions at the positions.
        largest (n_function,): Largest value of each function.
        fixed: The position whose basis stays.
        options: How to search.

    Returns:
        The same models in each of the bases found.
    """
    search = _Search(systems, values, largest, fixed)
    ends = [_descend(search, np.array(first, float), options) for first in _PREFERENCES]
    return tuple(transform(systems, search.transformations(end)) for end in ends)


def _descend(search: _Search, first: FloatArray, options: SparseBasisOptions) -> FloatArray:
    """Returns where one search ends."""
    point: FloatArray = np.tile(np.eye(search.systems.sizes.n_state).ravel(), len(search.moved_at))
    weights = np.tile(first[:, None], len(search.largest))
    levels = np.geomspace(_FIRST_LEVEL, options.smallest, options.passes)
    for level, share in zip(levels, np.linspace(1, 0, options.passes), strict=True):
        rows = search.row_weights(search.norms(point), weights, 1 / options.smallest)
        point = search.descend(point, rows)
        weights = first[:, None] ** share / np.hypot(search.norms(point).relative, level)
    return point
