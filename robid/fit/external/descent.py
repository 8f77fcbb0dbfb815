"""Search of the poles: Gauss-Newton with Levenberg's damping on what numerators leave over."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.fit.external.linear import Point
from robid.fit.levenberg import Status

_FIRST_DAMPING = 1e-3
_DAMPING_LIMIT = 1e10


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
    tolerance: float = 1e-4,
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
    here, damping, growth, reflected = start, _FIRST_DAMPING, 2.0, False
    for iteration in range(1, max_iterations + 1):
        left, values, turned, size = _factors(here.slope)
        pull = left.T @ here.residual
        reachable = float(pull @ pull)
        if reachable <= tolerance**2 * here.cost / n_row or here.cost <= floor:
            return Descent(here, iteration, "converged", reflected)
        step = turned.T @ (pull * values / (values**2 + damping)) / size
        predicted = reachable - float(np.sum((pull * damping / (values**2 + damping)) ** 2))
        trial, folded = admit(moved(here, step), limit, stable=stable)
        there = evaluate(trial)
        gain = (here.cost - there.cost) / predicted if there is not None else -1.0
        if there is not None and gain > 0:
            damping, growth = max(damping * max(0.1, 1 - (2 * gain - 1) ** 3), 1e-14), 2.0
            here, reflected = there, reflected or folded
        else:
            damping, growth = damping * growth, growth * 2
            if damping > _DAMPING_LIMIT:
                return Descent(here, iteration, "stalled", reflected)
    return Descent(here, max_iterations, "iteration_limit", reflected)


def _factors(slope: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Singular value decomposition of the slopes with columns of norm one, and these norms."""
    size = np.linalg.norm(slope, axis=0)
    size[size == 0] = 1.0
    left, values, turned = np.linalg.svd(slope / size, full_matrices=False)
    kept = values > 1e-12 * values[0]
    return left[:, kept], values[kept], turned[kept], size


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
