"""From a start to a minimum: optimizers behind one signature, and the staged descent that every start takes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import nlopt
import numpy as np
from scipy.optimize import least_squares

from robid.arrays import BoolArray, FloatArray
from robid.models.elastic.fit.options import ElasticOptions, Optimizer, Weights, restricted
from robid.models.elastic.fit.parameters import map_parameters
from robid.models.elastic.fit.problem import Problem, make_problem
from robid.results.levenberg import Minimum, Normal, Status, minimise
from robid.robot.description import Robot
from robid.robot.parameters import DIRECT, LOGARITHMIC, kind_of_name
from robid.robot.spring_laws import BristleTable

_TOLERANCE = 1e-12  # of the cost, which is flat to second order
_STEP_TOLERANCE = 1e-9
_GLOBAL_PRIORS = 2.0
_GLOBAL_SCALES = 10.0
_GLOBAL_EVALUATIONS = 20  # for each iteration of a local optimizer


def optimise(
    problem: Problem,
    start: FloatArray,
    *,
    optimizer: Optimizer = "levenberg",
    max_iterations: int = 200,
    cost_tolerance: float = 0.0,
) -> Minimum:
    """Minimises a problem's cost from a point, within the parameters' bounds.

    Args:
        problem: The problem.
        start (n_param,): Internal parameters to start from.
        optimizer: `levenberg`, ours; `scipy`, `least_squares` with the analytic Jacobian; `nlopt`, SLSQP with the
            analytic gradient; `nlopt_global`, MLSL within the bounds, by default two deviations of what is known
            beforehand (ten scales where nothing is), whose best point ours takes to its minimum.
        max_iterations: Limit on steps; of evaluations for the others, twenty times as many for the global one.
        cost_tolerance: Relative decrease of the cost at which it is good enough.

    Returns:
        The minimum reached; failure to converge is a status, not an error.
    """
    lower, upper = problem.parameters.lower, problem.parameters.upper
    if optimizer == "scipy":
        return _scipy(problem, np.clip(start, lower, upper), max_iterations, cost_tolerance)
    if optimizer == "nlopt":
        return _nlopt(nlopt.LD_SLSQP, problem, start, (lower, upper), max_iterations, cost_tolerance)
    before = Minimum(start, np.inf, 0, "converged")
    if optimizer == "nlopt_global":
        before = _global(problem, start, max_iterations)
    end = minimise(
        problem.cost,
        problem.normal,
        before.parameters,
        max_iterations=max_iterations,
        cost_tolerance=cost_tolerance,
        lower=lower,
        upper=upper,
    )
    return _after(before, end)


def _scipy(problem: Problem, start: FloatArray, max_iterations: int, cost_tolerance: float) -> Minimum:
    least = np.finfo(float).eps
    unit = np.sqrt(_unit(problem, start))
    found = least_squares(
        lambda internal: problem.stacked(internal)[0] / unit,
        start,
        lambda internal: problem.stacked(internal)[1] / unit,
        bounds=(problem.parameters.lower, problem.parameters.upper),
        x_scale="jac",
        ftol=max(cost_tolerance, _TOLERANCE),
        xtol=_STEP_TOLERANCE,
        gtol=least,
        max_nfev=max_iterations,
    )
    status: Status = "converged" if found.status > 0 else "iteration_limit"
    return Minimum(found.x, problem.cost(found.x), int(found.njev), status, int(found.nfev))


def _nlopt(
    method: int,
    problem: Problem,
    start: FloatArray,
    bounds: tuple[FloatArray, FloatArray],
    evaluations: int,
    cost_tolerance: float,
    local: nlopt.opt | None = None,
) -> Minimum:
    tool = nlopt.opt(method, start.size)
    if local is not None:
        tool.set_local_optimizer(local)
    tool.set_lower_bounds(bounds[0])
    tool.set_upper_bounds(bounds[1])
    tool.set_maxeval(evaluations)
    tool.set_ftol_rel(max(cost_tolerance, _TOLERANCE))
    tool.set_xtol_abs(_STEP_TOLERANCE)
    start = np.clip(start, *bounds)
    tool.set_min_objective(_objective(problem, _unit(problem, start)))
    status: Status = "stalled"
    try:
        point = np.asarray(tool.optimize(start))
        status = "iteration_limit" if tool.last_optimize_result() == nlopt.MAXEVAL_REACHED else "converged"
    except (nlopt.RoundoffLimited, RuntimeError):
        point = start
    count = int(tool.get_numevals())
    return Minimum(point, problem.cost(point), count, status, count)


def _global(problem: Problem, start: FloatArray, max_iterations: int) -> Minimum:
    parameters = problem.parameters
    # Multistart needs a box: as wide as what is known beforehand allows, and some scales where nothing is known.
    reach = np.where(np.isfinite(parameters.prior_std), _GLOBAL_PRIORS * parameters.prior_std, _GLOBAL_SCALES)
    bounds = np.maximum(parameters.lower, -reach), np.minimum(parameters.upper, reach)
    local = nlopt.opt(nlopt.LD_SLSQP, start.size)
    local.set_ftol_rel(1e-3)
    local.set_maxeval(max_iterations)
    return _nlopt(nlopt.G_MLSL_LDS, problem, start, bounds, _GLOBAL_EVALUATIONS * max_iterations, 0.0, local)


def _unit(problem: Problem, start: FloatArray) -> float:
    """Cost to measure costs by: these optimizers' first steps grow with it."""
    cost = problem.cost(start)
    return cost if 0 < cost < np.inf else 1.0


def _objective(problem: Problem, unit: float) -> Callable[[FloatArray, FloatArray], float]:
    def objective(internal: FloatArray, gradient: FloatArray) -> float:
        if gradient.size == 0:
            return problem.cost(internal.copy()) / unit
        here = problem.normal(internal.copy())
        gradient[:] = 2 * here.gradient / unit
        return here.cost / unit

    return objective


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
    """

    problem: Problem  # What is minimised in the end
    # Fewer lines, without cubic coefficients and locations, which are slow; None for `plain`. Viscous friction, delay
    # and the torques' coefficients are there, for their errors can hide what is sought.
    coarse: Problem | None
    options: ElasticOptions  # Options of the fit

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
            # What is lost begins on the other side of its start; the others where they are, halfway back, or at their
            # start.
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
    fewer = restricted(coarse_options, kinds, lambda name: kind_of_name(name) in kinds)
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
    # To second order, a change by a factor of two costs H log(2)^2, H being half the Hessian.
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


_TORQUES = np.geomspace(0.01, 30, 60)  # over that at which bristles slip at the swing
_SOFTEST = 0.5  # of a spring
_LITTLE = 0.02  # of the largest loss: nothing to be on a side of


def other_side(problem: Problem, internal: FloatArray, number: int) -> FloatArray | None:
    """Returns a start (n_param,) where a hysteresis loses alike on the other side of the largest loss, if there is one.

    The gear's spring is as much softer or stiffer as bristles that stick more or less ask for.

    Args:
        problem: The problem.
        internal (n_param,): Its minimum.
        number: Which of the hystereses that `problem.model.effects` has.
    """
    effects, parameters = problem.model.effects, problem.parameters
    if effects is None or effects.slipping_names[number] not in parameters.names:
        return None
    name, bristle = effects.slipping_names[number], effects.bristles[number]
    omega = 2 * np.pi * problem.frf.frequency_hz
    torque = bristle.known + float(parameters.parameters(internal).doubt[effects.slipping[number, 0]])
    other = _other(bristle, torque, omega)
    if other is None:
        return None
    start, index = internal.copy(), parameters.names.index(name)
    start[index] += (other - torque) / parameters.scale[index]
    spring = name.replace(".hysteresis", ".stiffness")
    if spring in parameters.names:
        own = parameters.names.index(spring)
        stuck, there = (float(bristle.added(each, omega).real.mean()) for each in (torque, other))
        start[own] += np.log(max(1 + (stuck - there) / parameters.values(internal)[own], _SOFTEST))
    return np.clip(start, parameters.lower, parameters.upper)


def _other(bristle: BristleTable, torque: float, omega: FloatArray) -> float | None:
    """Torque on the other side of the largest loss that loses alike; None where there is hardly any loss."""
    tried = bristle.stiffness * bristle.swing * _TORQUES
    losses = np.array([bristle.added(each, omega).imag.mean() for each in tried])
    loss, peak = float(bristle.added(torque, omega).imag.mean()), int(np.argmax(losses))
    if torque <= 0 or loss < _LITTLE * losses[peak]:
        return None
    side = slice(peak, None) if torque < tried[peak] else slice(0, peak + 1)
    return float(tried[side][np.argmin(np.abs(losses[side] - loss))])
