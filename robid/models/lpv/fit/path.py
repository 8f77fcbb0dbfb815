"""A basis of states in which few blocks are needed, the regularisation path, and which structure to keep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.models.lpv.fit.options import PathOptions, SparseBasisOptions, SparsityOptions
from robid.models.lpv.fit.responses import Problem, cost, solve
from robid.models.lpv.fit.sparse import SparseFit, fit_sparse
from robid.models.lpv.fit.state_space import Norms, StateSpace, measure, pack, similarity_tangent, spread, transform
from robid.results.levenberg import Normal, Status, minimise


@dataclass(frozen=True)
class PathPoint:
    """What one price gives."""

    gamma: float  # the price of a block, in units of the cost
    kept: BoolArray  # (4, n_function): blocks of A, B, C and D that are left
    relative: FloatArray  # (4, n_function): their relative norms before the refit
    parameters: FloatArray  # (n_function + 1, n_local): the model fitted again on this structure, without prices
    refit_cost: float
    validation_cost: float  # its cost on the validation data
    status: Status  # how the refit ended
    steps: int  # cone programs solved


@dataclass(frozen=True)
class Path:
    """All points, the model without prices first (gamma 0), and which one was chosen."""

    points: tuple[PathPoint, ...]
    chosen: int

    @property
    def best(self) -> PathPoint:
        """The point that was chosen."""
        return self.points[self.chosen]


def follow_path(
    problem: Problem,
    validation: Problem,
    starts: tuple[FloatArray, ...],
    largest: FloatArray,
    options: PathOptions,
    sparsity: SparsityOptions,
) -> Path:
    """Fits at every price, refits each structure exactly, and chooses the sparsest that validates.

    At one price, the start whose refit costs least, blocks counted at their price, stays. Starts (n_function + 1,
    n_local) are fitted without prices, in different bases; `largest` (n_function,) is the largest value of each basis
    function.
    """
    n_free = starts[0].size
    # One unit of price is what a complex element costs on average; parameters take half an element each.
    unit = cost(problem, starts[0]) / max(problem.n_data - n_free / 2, 1.0)
    gammas = unit * np.geomspace(options.smallest, options.largest, options.count)
    known: dict[bytes, tuple[FloatArray, float, Status]] = {}
    parameters, minimum = solve(problem, starts[0])
    whole = SparseFit(starts[0], np.ones((4, len(largest)), bool), 0), (parameters, minimum.cost, minimum.status)
    points = [_point(problem, validation, *whole, largest, 0.0)]
    for gamma in gammas.tolist():
        fits = [fit_sparse(problem, start, largest, gamma, sparsity) for start in starts]
        found = [_point(problem, validation, fit, _refit(problem, fit, known), largest, gamma) for fit in fits]
        points.append(min(found, key=lambda one: one.refit_cost + one.gamma * np.count_nonzero(one.kept)))
    return Path(tuple(points), choose_point(points, options.allowance))


def _refit(
    problem: Problem, fit: SparseFit, known: dict[bytes, tuple[FloatArray, float, Status]]
) -> tuple[FloatArray, float, Status]:
    structure = fit.kept.tobytes()
    if structure not in known:
        parameters, minimum = solve(problem, fit.parameters, free=spread(fit.kept, problem.sizes))
        known[structure] = parameters, minimum.cost, minimum.status
    return known[structure]


def _point(
    problem: Problem,
    validation: Problem,
    fit: SparseFit,
    refit: tuple[FloatArray, float, Status],
    largest: FloatArray,
    gamma: float,
) -> PathPoint:
    parameters, refit_cost, status = refit
    relative = measure(fit.parameters, largest, problem.sizes).relative
    left_out = cost(validation, parameters)
    return PathPoint(gamma, fit.kept, relative, parameters, refit_cost, left_out, status, fit.steps)


def choose_point(points: list[PathPoint], allowance: float) -> int:
    """Returns the index of the fewest blocks within the allowance; of those the least cost, then the least price.

    A fit that has not converged is taken only where none within the allowance has.
    """
    limit = (1 + allowance) * min(point.validation_cost for point in points)
    return min(
        (index for index, point in enumerate(points) if point.validation_cost <= limit),
        key=lambda index: (
            points[index].status != "converged",
            np.count_nonzero(points[index].kept),
            points[index].refit_cost,
            index,
        ),
    )


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

    def _cost(self, point: FloatArray, weights: FloatArray) -> float:
        """Sum of squares of the residual; infinite where a transformation has no inverse."""
        try:
            return float(np.sum(self.residual(point, weights) ** 2))
        except np.linalg.LinAlgError:
            return float("inf")

    def slope(self, point: FloatArray) -> FloatArray:
        """Derivative of the packed models (n_pos, n_local, n_state^2) by their transformations."""
        T = self.transformations(point)
        n = self.systems.sizes.n_state
        # A small change (I + G) T of the transformation has G = dT T^-1.
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
            lambda at: self._cost(at, weights),
            lambda at: self.normal(at, weights),
            point,
            max_iterations=_STEPS,
            cost_tolerance=_ENOUGH,
        ).parameters


def find_sparse_bases(
    systems: StateSpace, values: FloatArray, largest: FloatArray, *, fixed: int, options: SparseBasisOptions
) -> tuple[StateSpace, ...]:
    """Transforms local models, which keeps their responses, to where few blocks of their interpolation vary.

    Frozen responses leave the basis free at every position, but a block that is zero for the true states stays so only
    under one transformation for all. A local basis of any kind, balanced ones too, differs from that by a
    transformation that varies, and makes all blocks vary. So the transformations are searched: least squares on the
    varying blocks, each divided by its own last norm, from a limit that treats all alike down to the norm that counts
    as none. The search is not convex, and noise hides which of its ends is best: one end is returned for each of
    several preferences (none, a constant C, a constant B), for the fit to tell apart. Local models come in one basis,
    well conditioned, with the basis functions at the positions (n_pos, n_function + 1) and the largest value
    (n_function,) of each; the basis of one position stays.
    """
    search = _Search(systems, values, largest, fixed)
    ends = [_descend(search, np.array(first, float), options) for first in _PREFERENCES]
    return tuple(transform(systems, search.transformations(end)) for end in ends)


def _descend(search: _Search, first: FloatArray, options: SparseBasisOptions) -> FloatArray:
    point: FloatArray = np.tile(np.eye(search.systems.sizes.n_state).ravel(), len(search.moved_at))
    weights = np.tile(first[:, None], len(search.largest))
    levels = np.geomspace(_FIRST_LEVEL, options.smallest, options.passes)
    for level, share in zip(levels, np.linspace(1, 0, options.passes), strict=True):
        rows = search.row_weights(search.norms(point), weights, 1 / options.smallest)
        point = search.descend(point, rows)
        # Reweighted least squares: divided by its last norm a block costs about one if it is there and nothing if it is
        # not. The level keeps small ones apart, ever less.
        weights = first[:, None] ** share / np.hypot(search.norms(point).relative, level)
    return point
