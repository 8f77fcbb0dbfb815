"""Levenberg-Marquardt on the Gauss-Newton matrix."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Literal

import numpy as np
from scipy.linalg.lapack import dposv

from robid.arrays import BoolArray, FloatArray

Status = Literal["converged", "iteration_limit", "stalled"]

_GRADIENT_TOLERANCE = 1e-6
_STEP_TOLERANCE = 1e-9
_DAMPING_LIMIT = 1e12
_ROUNDING = 1e-13  # of the cost: no decrease can be told from rounding
_FIRST_DAMPING = 1e-3
_SHORTER = 0.25  # than a step that was refused
_SINGULAR = 1e-12  # of the largest, an eigenvalue that counts as none


@dataclass(frozen=True)
class Normal:
    """Cost and its quadratic model at one point."""

    cost: float  # The cost `V`
    gradient: FloatArray  # (n_param,) Half the gradient of `V`
    hessian: FloatArray  # (n_param, n_param) Half the Gauss-Newton Hessian of `V`


@dataclass(frozen=True)
class Minimum:
    """Where a descent ended."""

    parameters: FloatArray  # (n_param,) Internal parameters
    cost: float  # The cost there
    iterations: int  # Accepted and refused steps
    status: Status  # How it ended
    evaluations: int = 0  # Points at which the cost was computed


def minimise(
    cost: Callable[[FloatArray], float],
    normal: Callable[[FloatArray], Normal],
    start: FloatArray,
    *,
    max_iterations: int = 200,
    max_step: float = 1.0,
    cost_tolerance: float = 0.0,
    lower: FloatArray | None = None,
    upper: FloatArray | None = None,
) -> Minimum:
    """Minimises a sum of squares.

    Args:
        cost: Cost at a point.
        normal: Cost, half gradient and half Gauss-Newton Hessian at a point.
        start (n_param,): Where to start.
        max_iterations: Limit on steps.
        max_step: Largest change of one internal parameter in a step.
        cost_tolerance: Relative decrease of the cost at which the descent ends even though neither the gradient
            (largest cosine between the residual and its derivatives) nor the step has become small.
        lower (n_param,): Bounds that no point may pass; a parameter that the cost pushes against one is held there,
            and what is left decides when to stop.
        upper (n_param,): The same from above.

    Returns:
        The minimum reached; failure to converge is a status, not an error. A step that damping alone made small is
        not convergence: the one without damping is looked at.
    """
    low = np.full(start.size, -np.inf) if lower is None else lower
    high = np.full(start.size, np.inf) if upper is None else upper
    return _descend(cost, normal, np.clip(start, low, high), _Box(low, high, max_step), max_iterations, cost_tolerance)


@dataclass(frozen=True)
class _Box:
    """Where a descent may go: bounds of the parameters, and of their changes in a step."""

    low: FloatArray
    high: FloatArray
    max_step: float

    @cached_property
    def is_open(self) -> bool:
        """Whether there is no bound of a parameter."""
        return bool(np.isneginf(self.low).all() and np.isposinf(self.high).all())

    def within(self, point: FloatArray, step: FloatArray) -> FloatArray:
        """What of a step is allowed."""
        short = step if self.max_step == np.inf else np.minimum(np.maximum(step, -self.max_step), self.max_step)
        there = point + short
        return (there if self.is_open else np.minimum(np.maximum(there, self.low), self.high)) - point

    def free(self, point: FloatArray, gradient: FloatArray) -> BoolArray | None:
        """Which parameters the cost does not push against a bound; None for all."""
        if self.is_open:
            return None
        free = ~(((point <= self.low) & (gradient > 0)) | ((point >= self.high) & (gradient < 0)))
        return None if free.all() else free


def _descend(
    cost: Callable[[FloatArray], float],
    normal: Callable[[FloatArray], Normal],
    point: FloatArray,
    box: _Box,
    max_iterations: int,
    cost_tolerance: float,
) -> Minimum:
    here = normal(point)
    damping, growth, steps = _FIRST_DAMPING, 2.0, 0
    status: Status = "iteration_limit"
    while steps < max_iterations:
        free = box.free(point, here.gradient)
        step = box.within(point, _step(here, damping, free))
        # Heavy damping makes any step small: only where the one without damping is small too, the descent has ended.
        if _cosine(here, free) <= _GRADIENT_TOLERANCE or (
            _is_small(step) and _is_small(box.within(point, _gauss_newton(here, free)))
        ):
            status = "converged"
            break
        steps += 1
        there = point + step
        trial = cost(there)
        predicted = _decrease(here, step)
        # A clipped step may leave the region of the model and still go down.
        gain = (here.cost - trial) / predicted if predicted > 0 else 0.5 * np.sign(here.cost - trial)
        if np.isfinite(trial) and gain > 0:
            # Damping falls smoothly with the ratio of true to predicted decrease.
            damping, growth = max(damping * max(1 / 5, 1 - (2 * min(gain, 1.0) - 1) ** 3), 1e-12), 2.0
            finished = here.cost - trial <= cost_tolerance * here.cost
            point, here = there, normal(there)
        else:
            damping, growth = _more_damping(here, damping, growth, free, partial(box.within, point))
            finished = 0 <= predicted <= _ROUNDING * here.cost and (
                _decrease(here, box.within(point, _gauss_newton(here, free))) <= _ROUNDING * here.cost
            )
        if finished or damping > _DAMPING_LIMIT:
            status = "converged" if finished else "stalled"
            break
    return Minimum(point, here.cost, steps, status, steps + 1)


def _more_damping(
    here: Normal, damping: float, growth: float, free: BoolArray | None, allowed: Callable[[FloatArray], FloatArray]
) -> tuple[float, float]:
    """Damping and its growth after a step that was refused: as much as takes to quarter what is allowed of the step.

    Damping that fell far while steps were accepted is nothing against the Hessian, and more of it leaves the same step.
    """
    root = np.sqrt(np.diag(here.hessian))
    refused = float(np.linalg.norm(root * allowed(_step(here, damping, free))))
    while damping <= _DAMPING_LIMIT:
        damping, growth = damping * growth, growth * 2
        if np.linalg.norm(root * allowed(_step(here, damping, free))) <= _SHORTER * refused:
            break
    return damping, growth


def _cosine(here: Normal, free: BoolArray | None) -> float:
    """Largest cosine between the residual and its derivative by a free parameter; 0 where nothing is left."""
    gradient, hessian = _among(here, free)
    size = np.sqrt(hessian.diagonal()) * np.sqrt(here.cost)
    return float(np.divide(np.abs(gradient), size, out=np.zeros(size.size), where=size > 0).max(initial=0.0))


def _among(here: Normal, free: BoolArray | None) -> tuple[FloatArray, FloatArray]:
    """Gradient and Hessian by the free parameters."""
    return (here.gradient, here.hessian) if free is None else (here.gradient[free], here.hessian[np.ix_(free, free)])


def _whole(step: FloatArray, free: BoolArray | None) -> FloatArray:
    """A step of all parameters, of that of the free ones."""
    if free is None:
        return step
    whole = np.zeros(free.size)
    whole[free] = step
    return whole


def _is_small(step: FloatArray) -> bool:
    return float(np.abs(step).max()) <= _STEP_TOLERANCE


def _decrease(here: Normal, step: FloatArray) -> float:
    """Decrease of the cost that the quadratic model predicts for a step."""
    return -float(step @ (2 * here.gradient + here.hessian @ step))


def _gauss_newton(here: Normal, free: BoolArray | None) -> FloatArray:
    """The least step to the minimum of the quadratic model, where it has more than one."""
    gradient, hessian = _among(here, free)
    root = np.sqrt(np.maximum(hessian.diagonal(), np.finfo(float).tiny))
    scaled = hessian / (root[:, None] * root)
    return _whole(-np.linalg.lstsq(scaled, gradient / root, rcond=_SINGULAR)[0] / root, free)


def _step(here: Normal, damping: float, free: BoolArray | None) -> FloatArray:
    gradient, hessian = _among(here, free)
    if not gradient.size:
        return np.zeros(here.gradient.size)
    if not (np.isfinite(hessian).all() and np.isfinite(gradient).all()):
        message = "A descent has come to where the cost has no derivatives."
        raise ValueError(message)
    # In few calls: of a small problem, they take longer than the numbers.
    damped = hessian.copy()
    damped.ravel()[:: len(gradient) + 1] += (damping + 1e-14) * np.maximum(
        hessian.diagonal(), 1e-12 * here.hessian.diagonal().max()
    )
    _, step, failed = dposv(damped, gradient)
    if failed:
        message = "A damped Hessian is not positive definite."
        raise np.linalg.LinAlgError(message)
    return _whole(-step, free)
