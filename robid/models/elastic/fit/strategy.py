"""How one start finds its minimum: from smooth to sharp, from few lines to all, runaways put back."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.models.elastic.fit.names import restricted
from robid.models.elastic.fit.optimizers import optimise
from robid.models.elastic.fit.options import ElasticOptions, Weights
from robid.models.elastic.fit.parameters import map_parameters
from robid.models.elastic.fit.problem import Problem, make_problem
from robid.results.levenberg import Minimum, Normal, minimise
from robid.robot.description import Robot
from robid.robot.parameters import DIRECT, LOGARITHMIC

_COARSE_CONFIGURATIONS = 8
_COARSE_LINES = 30
_COARSE_WEIGHTS = Weights(kind="user", off_diagonal=0.5)
_COARSE_TOLERANCE = 1e-3
_HEAVY_TOLERANCE = 1e-2
_COARSE_ITERATIONS = 60
_DECADE = np.log(10)
_RESTARTS = tuple((decades, share) for decades in (1, 2) for share in (1.0, 0.5, 0.0))
_LOST_INFLUENCE = 1e-2  # of the cost, by a factor of two
_BETTER = 1e-2


@dataclass(frozen=True)
class Strategy:
    """The way from a start to a minimum.

    `plain` runs the optimizer from the start. `staged` first uses at most eight configurations and thirty of their
    lines, logarithmic residuals and rough weights. It fits the springs alone, with dampers ten times those of the
    start, whose broad resonances leave the cost few minima; then the other parameters too. Most minima that are not
    the best have a spring or a damper locked or gone: a factor of two in it no longer changes the cost by a hundredth.
    Such parameters are put back, one and then two decades from their start to the side away from where they ran,
    the others where they are, halfway back, or at their start, until none is lost, and what pays is kept. A
    damper that is lost alone and again is too small to show, even at the best minimum. Last comes everything on
    all lines. No stage looks at the robot file's values, but for what is known beforehand.

    Attributes:
        problem: What is minimised in the end.
        coarse: Fewer lines, without cubic coefficients and locations, which are slow; None for `plain`. Viscous
            friction, delay and the torques' coefficients are there, for their errors can hide what is sought.
        options: Options of the fit.
    """

    problem: Problem
    coarse: Problem | None
    options: ElasticOptions

    def descend(self, start: FloatArray, *, straight_too: bool = False) -> Minimum:
        """Finds the minimum that belongs to a start (n_param,), the better one if the straight way is tried too."""
        before = Minimum(start, np.inf, 0, "converged")
        if self.coarse is not None:
            before = self._staged(self.coarse, start)
        end = _after(before, self._straight(before.parameters))
        if self.coarse is None or not straight_too:
            return end
        straight = self._straight(start)
        return _after(end, straight) if straight.cost < end.cost else _after(straight, end)

    def _straight(self, start: FloatArray) -> Minimum:
        options = self.options
        return optimise(self.problem, start, optimizer=options.optimizer, max_iterations=options.max_iterations)

    def _staged(self, coarse: Problem, start: FloatArray) -> Minimum:
        names = self.problem.parameters.names
        shared = [names.index(name) for name in coarse.parameters.names]
        own = start[shared]
        dampers = np.array(coarse.parameters.kind_of) == "damping"
        best, paid = _heavy_to_true(coarse, own), True
        for decades, share in _RESTARTS:
            lost = _lost(coarse, best.parameters)
            small = lost.sum() == 1 and (lost & dampers).any()
            if not lost.any() or (small and not paid):
                break
            across = own - decades * _DECADE * np.sign(best.parameters - own)
            point = np.where(lost, across, own + share * (best.parameters - own))
            again = _coarsely(coarse, point) if share == 1 else _heavy_to_true(coarse, point)
            paid = again.cost < best.cost * (1 - _BETTER)
            best = _after(best, again) if paid else _after(again, best)
        internal = start.copy()
        internal[shared] = best.parameters
        return replace(best, parameters=internal)


def make_strategy(problem: Problem, robot: Robot, options: ElasticOptions) -> Strategy:
    """Sets up the strategy that the options name."""
    kinds = tuple(kind for kind in options.kinds if kind in DIRECT)
    if options.strategy == "plain" or not set(kinds) & set(LOGARITHMIC):
        return Strategy(problem, None, options)
    coarse_options = replace(options, weights=_COARSE_WEIGHTS, estimator=options.residual.from_afar)
    fewer = restricted(coarse_options, kinds)
    frf = problem.frf
    known = frf.coefficient_names, frf.coefficient_relative_std, frf.coefficient_offset
    parameters = map_parameters(robot, problem.parameters.nominal, fewer, *known)
    coarse = make_problem(frf, problem.model, parameters, fewer)[0]
    n_conf, n_freq = coarse.weight.shape[:2]
    chosen = np.ix_(_spread(n_conf, _COARSE_CONFIGURATIONS), _spread(n_freq, _COARSE_LINES))
    weight = np.zeros_like(coarse.weight)
    weight[chosen] = coarse.weight[chosen]
    return Strategy(problem, replace(coarse, weight=weight), options)


def _coarsely(coarse: Problem, point: FloatArray) -> Minimum:
    return optimise(coarse, point, max_iterations=_COARSE_ITERATIONS, cost_tolerance=_COARSE_TOLERANCE)


def _heavy_to_true(coarse: Problem, start: FloatArray) -> Minimum:
    kinds = np.array(coarse.parameters.kind_of)
    springs, dampers = kinds == "stiffness", kinds == "damping"
    if not springs.any() or not dampers.any():
        return _coarsely(coarse, start)
    heavy = _restricted(coarse, np.where(dampers, start + _DECADE, start), springs)
    return _after(heavy, _coarsely(coarse, heavy.parameters))


def _lost(problem: Problem, point: FloatArray) -> BoolArray:
    """Which logarithmic parameters (n_param,) have lost their influence: a factor of two hardly changes the cost.

    What is known beforehand to less than that factor has nowhere to run.
    """
    here = problem.normal(point)
    influence = np.diag(here.hessian) - 0.5 / problem.parameters.prior_std**2
    lost = influence * np.log(2) ** 2 < _LOST_INFLUENCE * here.cost
    open_beforehand = problem.parameters.prior_std > np.log(2)
    return np.asarray(lost & open_beforehand & problem.parameters.logarithmic)


def _restricted(problem: Problem, point: FloatArray, free: BoolArray) -> Minimum:
    """Descends with some parameters only."""

    def whole(part: FloatArray) -> FloatArray:
        internal = point.copy()
        internal[free] = part
        return internal

    def normal(part: FloatArray) -> Normal:
        here = problem.normal(whole(part))
        return Normal(here.cost, here.gradient[free], here.hessian[np.ix_(free, free)])

    end = minimise(
        lambda part: problem.cost(whole(part)),
        normal,
        point[free],
        max_iterations=_COARSE_ITERATIONS,
        cost_tolerance=_HEAVY_TOLERANCE,
        lower=problem.parameters.lower[free],
        upper=problem.parameters.upper[free],
    )
    return replace(end, parameters=whole(end.parameters))


def _after(before: Minimum, end: Minimum) -> Minimum:
    """The end, with what went before counted."""
    return replace(end, iterations=before.iterations + end.iterations, evaluations=before.evaluations + end.evaluations)


def _spread(count: int, most: int) -> list[int]:
    """At most so many indices, spread evenly."""
    return sorted(set(np.linspace(0, count - 1, min(most, count)).round().astype(int).tolist()))
