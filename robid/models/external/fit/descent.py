"""Search of the poles: Gauss-Newton with Levenberg's damping on what numerators leave over."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.models.external.fit.linear import Point, natural_steps
from robid.results.levenberg import Status

_FIRST_DAMPING = 1e-3
_DAMPING_LIMIT = 1e8
_ROUNDED = 0.1  # standard deviations that rounding may keep from being found
_AT_LIMIT = 0.999
_LARGEST_STEP = 0.5  # of a pole, about


@dataclass(frozen=True)
class Descent:
    """Where a search of the poles ended.

    Attributes:
        point: The best poles and numerators.
        iterations: Steps tried.
        status: How it ended.
        reflected: Whether unstable poles were met and reflected on the way.
    """

    point: Point
    iterations: int
    status: Status
    reflected: bool


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
        _, reachable = model.step(0.0)
        if reachable <= tolerance**2 * here.cost / n_row or here.cost <= floor:
            return Descent(here, iteration, "converged", reflected)
        step, predicted = model.step(damping)
        trial, folded = admit(moved(here, step), limit, stable=stable)
        there = evaluate(trial)
        gain = (here.cost - there.cost) / predicted if there is not None else -1.0
        if there is not None and gain > 0:
            damping, growth = damping * max(0.1, 1 - (2 * gain - 1) ** 3), 2.0
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
    change = np.concatenate([[0.0], step @ point.basis.single.numerators])
    scaling = (change @ denominator) / (denominator @ denominator)
    return np.asarray(denominator + change - scaling * denominator)


def admit(denominator: FloatArray, limit: float, *, stable: bool) -> tuple[FloatArray, bool]:
    """Returns the denominator with coefficient 1 first and poles of a limited magnitude, and whether any was reflected.

    Args:
        denominator (n_pole + 1,): In powers of s over the reference frequency; its first coefficient may vanish.
        limit: Largest magnitude of a pole.
        stable: Whether unstable poles are reflected.
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
        poles = np.where(unstable, -poles.conj(), poles)
    return np.real(np.poly(poles)), bool(stable and unstable.any())
