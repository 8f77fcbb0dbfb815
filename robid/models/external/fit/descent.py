"""Search of the poles: numerators by linear least squares, poles by Gauss-Newton on what these leave over."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from robid.arrays import FloatArray
from robid.models.external.fit.reduction import Basis, Reduced
from robid.results.levenberg import Status

_LEAST_STEP = 1e-6  # of the reference frequency
_DEPENDENT = 1e-13  # of the largest singular value


@dataclass(frozen=True)
class Numerators:
    """Which numerators are sought, as weights of a cascade's last states."""

    n_zero: int  # their degree
    static_gain_one: bool = False  # whether the channels on the block's diagonal have static gain one

    def fixed(self, basis: Basis, output: int, input_: int) -> FloatArray:
        """Weights (n_zero + 1,) that are not estimated."""
        found = np.zeros(self.n_zero + 1)
        if self.static_gain_one and output == input_:
            found[-1] = basis.denominator[-1] / basis.single.numerators[-1, -1]
        return found

    def free(self, basis: Basis, output: int, input_: int) -> FloatArray:
        """Directions (n_free, n_zero + 1) of the weights that are estimated."""
        directions = np.eye(self.n_zero + 1)
        if self.static_gain_one and output == input_:
            levels = basis.single.numerators[-(self.n_zero + 1) :, -1]
            return np.asarray((directions - np.outer(levels / levels[-1], directions[-1]))[:-1])
        return directions

    def slopes(self, basis: Basis, numerator: FloatArray, output: int, input_: int) -> FloatArray:
        """Weights (2 n_pole, n_pole) of the derivative by the denominator's change along each state's numerator."""
        n_pole = basis.n_pole
        rows = np.zeros((n_pole, 2 * n_pole))
        # d(B/A) = -B dA / A^2 at fixed B: a polynomial over the poles twice, one for each direction of A.
        for row, direction in zip(rows, basis.single.numerators, strict=True):
            product = np.convolve(numerator, direction)
            row[len(row) - len(product) :] = -product
            if self.static_gain_one and output == input_:
                # With the static gain fixed b_0 follows a_0, which adds dA(0) A / A^2.
                row[n_pole - 1 :] += direction[-1] * basis.denominator
        return basis.double.expand(rows).T


@dataclass(frozen=True)
class Point:
    """The best that given poles can do."""

    basis: Basis  # the poles and their states
    weights: FloatArray  # (n_out, n_in, n_zero + 1): numerators as weights of the last states
    free: tuple[FloatArray, ...]  # weights (n_out, n_pole) of the free response of each shot with a free start
    cost: float  # weighted sum of squares of the rest
    residual: FloatArray  # (n_row,): the rest, reduced
    # (n_row, n_pole): its derivative, with the sign of the model's, by the denominator's change along each state's
    # numerator; what the linear part takes up is gone.
    slope: FloatArray
    n_rows: tuple[int, ...]  # rows of each shot in one output's part of the two


def natural_steps(point: Point) -> FloatArray:
    """Returns the steps (n_pole,) along the states' numerators that change poles by about their own size."""
    parts = [[abs(stage.pole) / stage.gain] * (1 + stage.is_pair) for stage in point.basis.single.stages]
    return np.maximum(np.cumprod(np.concatenate(parts)), _LEAST_STEP)


def solve(
    reduced: Sequence[Reduced], basis: Basis, sought: Numerators, n_in: int, noise: FloatArray, *, slopes: bool = True
) -> Point:
    """Solves for numerators and free responses, and projects the derivatives by the poles.

    Where `slopes` are wanted, shots are reduced with the states of the double cascade. The deviations of each output's
    noise in each shot are `noise` (n_shot, n_out).

    Source:
        Golub and Pereyra (2003), "Separable nonlinear least squares"; Kaufman's approximation.
    """
    n_out = noise.shape[1]
    weights = np.zeros((n_out, n_in, sought.n_zero + 1))
    free = tuple(np.zeros((n_out, basis.n_pole)) for _ in reduced)
    residuals, tilts = [], []
    for output in range(n_out):
        # Variable projection: at given poles the model is linear in numerators and free responses. These are solved
        # for, so that the poles see the rest (I - P) y alone.
        scale = 1 / noise[:, output]
        columns, right = columns_of(reduced, basis, sought, n_in, scale, output)
        solution, within = _least_squares(columns, right)
        _unpack(solution, reduced, basis, sought, weights[output], [part[output] for part in free], output)
        residuals.append(right - within @ (within.T @ right))
        if slopes:
            # Kaufman: the derivative of (I - P) y is (I - P) dW x; the term with dP' is of the order of the rest and is
            # left out.
            found = slopes_of(reduced, basis, sought, weights[output], [part[output] for part in free], scale, output)
            tilts.append(found - within @ (within.T @ found))
    residual = np.concatenate(residuals)
    slope = np.concatenate(tilts) if slopes else np.zeros((len(residual), 0))
    n_rows = tuple(len(each.triangle) for each in reduced)
    return Point(basis, weights, free, float(residual @ residual), residual, slope, n_rows)


def _rows(reduced: Sequence[Reduced]) -> list[slice]:
    ends = np.cumsum([0, *(len(each.triangle) for each in reduced)]).tolist()
    return [slice(first, last) for first, last in pairwise(ends)]


def columns_of(
    reduced: Sequence[Reduced], basis: Basis, sought: Numerators, n_in: int, scale: FloatArray, output: int
) -> tuple[FloatArray, FloatArray]:
    """Returns weighted columns (n_row, n_linear) of numerators and free responses, and weighted rows (n_row,)."""
    n_pole, last = basis.n_pole, slice(basis.n_pole - sought.n_zero - 1, basis.n_pole)
    directions = [sought.free(basis, output, index) for index in range(n_in)]
    starts = np.cumsum([0, *(len(each) for each in directions)]).tolist()
    rows = _rows(reduced)
    n_free = sum(each.is_free for each in reduced)
    columns = np.zeros((rows[-1].stop, starts[-1] + n_free * n_pole))
    right = np.zeros(rows[-1].stop)
    place = starts[-1]
    for shot, span, size in zip(reduced, rows, scale, strict=True):
        right[span] = shot.output(output) * size
        for index, moved in enumerate(shot.moved):
            states = shot.states(index)[:, last] * size
            columns[span, starts[moved] : starts[moved + 1]] = states @ directions[moved].T
            right[span] -= states @ sought.fixed(basis, output, moved)
        if shot.is_free:
            columns[span, place : place + n_pole] = shot.states(len(shot.moved))[:, :n_pole] * size
            place += n_pole
    return columns, right


def _least_squares(columns: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Returns the least solution (n_column,) and an orthonormal basis (n_row, n_rank) of the columns."""
    if columns.shape[1] == 0:
        return np.zeros(0), columns
    size = np.linalg.norm(columns, axis=0)
    size[size == 0] = 1.0
    left, values, turned = np.linalg.svd(columns / size, full_matrices=False)
    # Directions that the states do not tell apart take no part: the shortest solution among the equal ones.
    kept = values > _DEPENDENT * values[0]
    solution = turned[kept].T @ ((left[:, kept].T @ right) / values[kept]) / size
    return solution, left[:, kept]


def _unpack(
    solution: FloatArray,
    reduced: Sequence[Reduced],
    basis: Basis,
    sought: Numerators,
    weights: FloatArray,
    free: Sequence[FloatArray],
    output: int,
) -> None:
    """Writes one output's solution into its weights (n_in, n_zero + 1) and free responses."""
    place = 0
    for index in range(len(weights)):
        directions = sought.free(basis, output, index)
        part = solution[place : place + len(directions)]
        weights[index] = sought.fixed(basis, output, index) + part @ directions
        place += len(directions)
    for shot, part in zip(reduced, free, strict=True):
        if shot.is_free:
            part[:] = solution[place : place + basis.n_pole]
            place += basis.n_pole


def slopes_of(
    reduced: Sequence[Reduced],
    basis: Basis,
    sought: Numerators,
    weights: FloatArray,
    free: Sequence[FloatArray],
    scale: FloatArray,
    output: int,
) -> FloatArray:
    """Derivative (n_row, n_pole) of one output's weighted rows by the denominator at fixed numerators."""
    rows = _rows(reduced)
    found = np.zeros((rows[-1].stop, basis.n_pole))
    above = basis.single.numerators[-weights.shape[1] :, -weights.shape[1] :]
    expanded = [sought.slopes(basis, part @ above, output, index) for index, part in enumerate(weights)]
    for shot, span, size, part in zip(reduced, rows, scale, free, strict=True):
        for index, moved in enumerate(shot.moved):
            found[span] += shot.states(index) @ expanded[moved] * size
        if shot.is_free:
            own = Numerators(basis.n_pole - 1).slopes(basis, part @ basis.single.numerators, output, -1)
            found[span] += shot.states(len(shot.moved)) @ own * size
    return found


_FIRST_DAMPING = 1e-3
_DAMPING_LIMIT = 1e8
_ROUNDED = 0.1  # standard deviations that rounding may keep from being found
_AT_LIMIT = 0.999
_LARGEST_STEP = 0.5  # of a pole, about


@dataclass(frozen=True)
class Descent:
    """Where a search of the poles ended."""

    point: Point  # the best poles and numerators
    iterations: int  # steps tried
    status: Status  # how it ended
    reflected: bool  # whether unstable poles were met and reflected on the way


def descend(
    evaluate: Callable[[FloatArray], Point | None],
    start: Point,
    limit: float,
    *,
    n_row: int,
    stable: bool,
    tolerance: float = 1e-3,
    max_iterations: int = 60,
    floor: float = 0.0,
) -> Descent:
    """Searches the poles from a start.

    A change of the denominator is taken without what only scales it, so that poles pass through infinity as through
    any other place.

    Args:
        evaluate: Point at a denominator (n_pole + 1,); None where it cannot be simulated.
        start: Where to start.
        limit: Largest magnitude of a pole over the reference frequency.
        n_row: Samples behind the cost.
        stable: Whether unstable poles are reflected.
        tolerance: Move of the poles, in standard deviations of theirs, that ends the search.
        max_iterations: Limit on steps.
        floor: Cost that rounding leaves.

    Source:
        Marquardt (1963), "An algorithm for least-squares estimation of nonlinear parameters".
    """
    here, damping, growth, reflected = start, 0.0, 2.0, False
    for iteration in range(1, max_iterations + 1):
        model = _Model(here, limit)
        if damping == 0.0:
            damping = _FIRST_DAMPING * model.values[0] ** 2
        # What an undamped step would gain of the cost, over the cost of a sample: the square of its length in
        # deviations.
        _, reachable = model.step(0.0)
        if reachable <= tolerance**2 * here.cost / n_row or here.cost <= floor:
            return Descent(here, iteration, "converged", reflected)
        step, predicted = model.step(damping)
        trial, folded = admit(moved(here, step), limit, stable=stable)
        there = evaluate(trial)
        gain = (here.cost - there.cost) / predicted if there is not None else -1.0
        if there is not None and gain > 0:
            # The better the quadratic model foresaw the gain, the less damping; refused steps raise it ever faster.
            damping, growth = damping * max(0.1, 1 - (2 * min(gain, 1.0) - 1) ** 3), 2.0
            here, reflected = there, reflected or folded
        else:
            damping, growth = damping * growth, growth * 2
            if damping > _DAMPING_LIMIT * model.values[0] ** 2:
                rounded = reachable <= _ROUNDED**2 * here.cost / n_row
                return Descent(here, iteration, "converged" if rounded else "stalled", reflected)
    return Descent(here, max_iterations, "iteration_limit", reflected)


class _Model:
    """Quadratic model of the cost, in steps that change poles by about their own size."""

    def __init__(self, point: Point, limit: float) -> None:
        self._size = natural_steps(point)
        self._factorise(point, point.slope * self._size)
        fastest = point.basis.single.stages[0]
        if abs(fastest.pole) >= _AT_LIMIT * limit and (fastest.is_pair or self.step(0.0)[0][0] > 0):
            # The fastest pole is pushed against its limit: the others go on without it.
            held = point.slope * self._size
            held[:, fastest.states] = 0.0
            self._factorise(point, held)

    def _factorise(self, point: Point, slope: FloatArray) -> None:
        left, self.values, self._turned = np.linalg.svd(slope, full_matrices=False)
        self._pull = left.T @ point.residual

    def step(self, damping: float) -> tuple[FloatArray, float]:
        """Returns the step (n_pole,) with at least that damping that changes no pole by too much, and its decrease."""
        while True:
            # Levenberg-Marquardt in the singular vectors of the slope: d = v s (u^T r) / (s^2 + damping).
            curvature = np.maximum(self.values**2 + damping, np.finfo(float).tiny)
            along = self._pull * self.values / curvature
            step = self._turned.T @ along
            if np.abs(step).max() <= _LARGEST_STEP:
                decrease = float(np.sum(along * (2 * self._pull * self.values - along * self.values**2)))
                return step * self._size, decrease
            damping = max(4 * damping, 1e-16 * self.values[0] ** 2)


def moved(point: Point, step: FloatArray) -> FloatArray:
    """Returns the denominator (n_pole + 1,) after a step (n_pole,) along the states' numerators."""
    denominator = point.basis.denominator
    # What scales the whole denominator changes no transfer function, as numerators are solved for: it is projected out.
    change = np.concatenate([[0.0], step @ point.basis.single.numerators])
    scaling = (change @ denominator) / (denominator @ denominator)
    return np.asarray(denominator + change - scaling * denominator)


def admit(denominator: FloatArray, limit: float, *, stable: bool) -> tuple[FloatArray, bool]:
    """Returns the denominator with coefficient 1 first and poles of a limited magnitude, and whether any was reflected.

    The denominator (n_pole + 1,) is in powers of s over the reference frequency; its first coefficient may vanish.
    """
    reach = float(np.abs(denominator).max())
    if abs(denominator[0]) * limit ** (len(denominator) - 1) < 1e-12 * reach:
        denominator = denominator.copy()
        denominator[0] = 1e-12 * reach * limit ** -(len(denominator) - 1)
    poles = np.roots(denominator).astype(complex)
    size = np.abs(poles)
    poles = np.where(size > limit, poles * (limit / np.maximum(size, limit)), poles)
    unstable = poles.real > 0
    if stable and unstable.any():
        # Mirrored at the imaginary axis a pole keeps the magnitude of its response.
        poles = np.where(unstable, -poles.conj(), poles)
    return np.real(np.poly(poles)), bool(stable and unstable.any())
