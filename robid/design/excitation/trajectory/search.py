"""Search of a trajectory: random starts, constrained descents, and how much of each can be played."""

from __future__ import annotations

import contextlib
from collections.abc import Callable

import nlopt
import numpy as np

from robid.arrays import FloatArray
from robid.design.excitation.trajectory.problem import TrajectoryProblem

# Optimizer, share of the evaluations and sharpness of the smooth maximum; a sharp one misleads early steps, and moving
# asymptotes come back to the limits where quadratic programs do not.
_ROUNDS = ((nlopt.LD_SLSQP, 0.5, 50.0), (nlopt.LD_MMA, 0.2, 100.0), (nlopt.LD_SLSQP, 0.3, 200.0))
_WORTH = 0.03  # Factor on the criterion, without which the first quadratic programs step far beyond the limits
_BOUND = 3.0
_TOLERANCE = 1e-5
_WITHIN = 1e-3
_HALVINGS = 14
_LEAST_USE = 0.3  # Smallest share of its limits that a joint of a random series uses, before torques and floor


def random_trajectory(problem: TrajectoryProblem, generator: np.random.Generator) -> FloatArray:
    """Draws coefficients (n_shape, n_joint) within the limits, whose joints use random shares of them."""
    shape = (problem.series.count, len(problem.robot.joints))
    none = np.zeros(shape[1])
    drawn = generator.standard_normal(shape)
    share = generator.uniform(_LEAST_USE, 1, shape[1])
    used = problem.limits.used(problem.robot, problem.waves @ drawn, none)
    drawn = drawn * share / used[[0, 2]].max(axis=0)
    speed = problem.limits.used(problem.robot, problem.waves @ drawn, none)[1].max()
    drawn = drawn / max(speed, 1.0)
    return np.asarray(drawn * _allowed(problem, drawn))


def descend(problem: TrajectoryProblem, start: FloatArray, evaluations: int) -> FloatArray:
    """Improves coefficients (n_shape, n_joint) by local optimizers, round after round; they stay within the limits.

    Source:
        Kraft (1994), SLSQP; Svanberg (2002), MMA; Kreisselmeier and Steinhauser (1979) for the smooth maximum.
    """
    best, value = start, problem.criterion.value(problem.regressor(start))
    for algorithm, share, sharpness in _ROUNDS:
        tool = nlopt.opt(algorithm, start.size)
        tool.set_maxeval(max(round(share * evaluations), 1))
        end = _round(problem, best, tool, sharpness)
        end = end * _allowed(problem, end)
        reached = problem.criterion.value(problem.regressor(end))
        if reached < value:
            best, value = end, reached
    return best


def _round(problem: TrajectoryProblem, start: FloatArray, tool: nlopt.opt, sharpness: float) -> FloatArray:
    """Where an optimizer ends; it may exceed limits there."""
    walk = _Walk(problem, (start / problem.scale).ravel(), sharpness)
    tool.set_min_objective(walk.objective)
    tool.add_inequality_mconstraint(walk.constraints, np.full(walk.latest.used.size, _WITHIN))
    tool.set_lower_bounds(-_BOUND)
    tool.set_upper_bounds(_BOUND)
    tool.set_ftol_rel(_TOLERANCE)
    point = walk.point
    with contextlib.suppress(nlopt.RoundoffLimited, RuntimeError):
        point = np.asarray(tool.optimize(np.clip(walk.point, -_BOUND, _BOUND)))
    return np.asarray(point.reshape(start.shape) * problem.scale)


class _Walk:
    """What an optimizer asks for, each point evaluated once."""

    def __init__(self, problem: TrajectoryProblem, start: FloatArray, sharpness: float) -> None:
        self.problem, self.point, self.sharpness = problem, start.copy(), sharpness
        self.latest = problem.evaluate(start, sharpness)

    def objective(self, point: FloatArray, slope: FloatArray) -> float:
        """Returns the criterion on its scale, and writes its slope."""
        self._move(point)
        if slope.size:
            slope[:] = _WORTH * self.latest.slope
        return _WORTH * self.latest.value

    def constraints(self, result: FloatArray, point: FloatArray, slope: FloatArray) -> None:
        """Writes by how much each limit is exceeded, and the slopes."""
        self._move(point)
        result[:] = self.latest.used - 1
        if slope.size:
            slope[:] = self.latest.used_slope

    def _move(self, point: FloatArray) -> None:
        if not np.array_equal(point, self.point):
            self.point = point.copy()
            self.latest = self.problem.evaluate(self.point, self.sharpness)


def _allowed(problem: TrajectoryProblem, coefficients: FloatArray) -> float:
    return largest_factor(lambda factor: problem.is_within(factor * coefficients))


def largest_factor(is_allowed: Callable[[float], bool]) -> float:
    """Largest factor up to 1 that is found to be allowed by halving; 0 is."""
    if is_allowed(1.0):
        return 1.0
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if is_allowed(middle) else (low, middle)
    return low
