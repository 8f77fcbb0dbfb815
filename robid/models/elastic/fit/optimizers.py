"""Optimizers behind one signature: ours, scipy's trust region, and nlopt's local and global ones."""

from __future__ import annotations

from collections.abc import Callable

import nlopt
import numpy as np
from scipy.optimize import least_squares

from robid.arrays import FloatArray
from robid.models.elastic.fit.options import Optimizer
from robid.models.elastic.fit.problem import Problem
from robid.results.levenberg import Minimum, Status, minimise

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
        tool = nlopt.opt(nlopt.LD_SLSQP, start.size)
        tool.set_lower_bounds(lower)
        tool.set_upper_bounds(upper)
        tool.set_maxeval(max_iterations)
        return _nlopt(tool, problem, np.clip(start, lower, upper), cost_tolerance)
    before = 0
    if optimizer == "nlopt_global":
        found = _global(problem, start, max_iterations)
        start, before = found.parameters, found.evaluations
    end = minimise(
        problem.cost,
        problem.normal,
        start,
        max_iterations=max_iterations,
        cost_tolerance=cost_tolerance,
        lower=lower,
        upper=upper,
    )
    return Minimum(end.parameters, end.cost, end.iterations + before, end.status, end.evaluations + before)


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


def _nlopt(tool: nlopt.opt, problem: Problem, start: FloatArray, cost_tolerance: float) -> Minimum:
    tool.set_ftol_rel(max(cost_tolerance, _TOLERANCE))
    tool.set_xtol_abs(_STEP_TOLERANCE)
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
    reach = np.where(np.isfinite(parameters.prior_std), _GLOBAL_PRIORS * parameters.prior_std, _GLOBAL_SCALES)
    low, high = np.maximum(parameters.lower, -reach), np.minimum(parameters.upper, reach)
    local = nlopt.opt(nlopt.LD_SLSQP, start.size)
    local.set_ftol_rel(1e-3)
    local.set_maxeval(max_iterations)
    tool = nlopt.opt(nlopt.G_MLSL_LDS, start.size)
    tool.set_local_optimizer(local)
    tool.set_lower_bounds(low)
    tool.set_upper_bounds(high)
    tool.set_maxeval(_GLOBAL_EVALUATIONS * max_iterations)
    return _nlopt(tool, problem, np.clip(start, low, high), 0.0)


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
