"""The elastic family: springs, dampers, inertias and delay from frequency responses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np
from scipy.stats import norm

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.errors import DataError
from robid.fit.levenberg import Minimum
from robid.fit.optimizers import optimise
from robid.fit.options import ElasticOptions
from robid.fit.parameters import ParameterMap, map_parameters
from robid.fit.problem import Problem, make_problem
from robid.fit.rest_model import rest_model
from robid.fit.solution import Solution
from robid.fit.strategy import Strategy, make_strategy, without_coefficients
from robid.fit.uncertainty import sandwich
from robid.frf.frf import Frf
from robid.robot.description import Robot
from robid.robot.response import nominal_parameters

Map: TypeAlias = Callable[[Callable[[Any], Any], Sequence[Any]], list[Any]]

_SAME_MINIMUM = 1e-3
_UPDATED_ENOUGH = 1e-6  # of the cost
_NEEDLESS_FACTOR = 1e3
_LEARNT_SHARE = 0.5  # of what was known beforehand may stay unknown
_MANY_DROPPED = 0.2
_POOR_MODEL = 1.5
_RELATIVE_TO_SCALE = ("cubic", "location")  # their nominal value may be zero and says little of their size
_NO_INFLUENCE = 1e-14  # of the largest: rounding


def serial_map(function: Callable[[Any], Any], tasks: Sequence[Any]) -> list[Any]:
    """Applies a function to each task in turn."""
    return [function(task) for task in tasks]


def fit_elastic(
    robot: Robot, frf: Frf, options: ElasticOptions, delay_s: float, parallel_map: Map = serial_map
) -> Solution:
    """Fits the elastic model to frequency responses of one or many configurations.

    Args:
        robot: Nominal robot; the first start.
        frf: Measured responses with covariance.
        options: Estimator, weights, free parameters, starts.
        delay_s: Nominal delay from recorded to applied torque, hold excluded [s].
        parallel_map: Ordered map that runs the starts.

    Returns:
        The best minimum with its uncertainty; how it ended is in `status` and `advice`.

    Raises:
        DataError: If the response is not finite, its inputs are not the robot's motors, or a free
            parameter changes nothing.

    Source:
        Wernholt and Moberg (2008), sec. 5; METHODS sec. 5.
    """
    check_inputs(robot, frf)
    _check_finite(robot, frf)
    problem, dropped = set_up(robot, frf, options, delay_s)
    predicted = np.sqrt(np.diag(sandwich(problem, np.zeros(len(problem.parameters.names)))))
    _check_influence(problem)
    strategy = make_strategy(problem, robot, options)
    tasks = [(strategy, start) for start in draw_starts(problem.parameters, options)]
    ends: list[Minimum] = parallel_map(_descend, tasks)
    best = min(ends, key=lambda end: end.cost)
    for _ in range(options.statics_updates):
        problem, dropped = set_up(robot, frf, options, delay_s, (problem, best))
        before = problem.cost(best.parameters)
        best = optimise(problem, best.parameters, max_iterations=options.max_iterations)
        if before - best.cost <= _UPDATED_ENOUGH * before:
            break
    return _solution(problem, options, best, ends, predicted, dropped)


def set_up(
    robot: Robot,
    frf: Frf,
    options: ElasticOptions,
    delay_s: float,
    before: tuple[Problem, Minimum] | None = None,
) -> tuple[Problem, int]:
    """Sets up the problem and counts the elements that it drops.

    Statics and weights are those of the robot file's values, or of the minimum reached before.
    """
    if not options.correct_torques:
        frf = without_coefficients(frf)
    values = None if before is None else before[0].parameters.parameters(before[1].parameters)
    model = rest_model(robot, frf, options, delay_s, values)
    nominal = nominal_parameters(robot, model, delay_s)
    known = frf.coefficient_names, frf.coefficient_relative_std, frf.coefficient_offset
    parameters = map_parameters(robot, nominal, options, *known)
    return make_problem(frf, model, parameters, options, None if before is None else before[1].parameters)


def draw_starts(parameters: ParameterMap, options: ElasticOptions) -> list[FloatArray]:
    """Draws the starts (n_param,) of a fit: the robot file's values, then log-uniform within the stated decades."""
    generator = np.random.default_rng(options.seed)
    spread = np.log(10) * options.start_decades * parameters.logarithmic
    random = spread * generator.uniform(-1, 1, (options.starts - 1, len(parameters.names)))
    return [np.zeros(len(parameters.names)), *np.clip(random, parameters.lower, parameters.upper)]


def _descend(task: tuple[Strategy, FloatArray]) -> Minimum:
    strategy, start = task
    return strategy.descend(start)


def _solution(
    problem: Problem,
    options: ElasticOptions,
    best: Minimum,
    ends: list[Minimum],
    predicted: FloatArray,
    dropped: int,
) -> Solution:
    parameters, internal = problem.parameters, best.parameters
    modelled = problem.model_response(internal)
    excess = misfit(problem, modelled, best.cost)
    covariance = sandwich(problem, internal) * max(1.0, excess)
    values, slopes = parameters.values(internal), parameters.slopes(internal)
    deviation = np.sqrt(np.diag(covariance))
    reach = norm.ppf(0.5 + 0.5 * options.confidence) * deviation
    friction = np.array(parameters.kind_of) == "friction"
    size = np.where(friction, 1.0, np.maximum(np.abs(values), 1e-300))
    nominal = parameters.nominal_values()
    predicted_slopes = parameters.slopes(np.zeros_like(internal))
    scaled_by = np.isin(parameters.kind_of, _RELATIVE_TO_SCALE)
    predicted_size = np.where(friction | (nominal == 0), 1.0, np.abs(nominal))
    predicted_size = np.where(scaled_by, parameters.scale, predicted_size)
    predicted_relative = predicted * np.abs(predicted_slopes) / predicted_size
    scaled = problem.normal(internal).hessian
    root = np.sqrt(np.maximum(np.diag(scaled), 1e-300))
    costs = np.array([end.cost for end in ends])
    return Solution(
        family="elastic",
        names=parameters.names,
        kinds=parameters.kind_of,
        units=parameters.units,
        nominal=nominal,
        estimate=values,
        lower=parameters.values(internal - reach),
        upper=parameters.values(internal + reach),
        relative_std=deviation * np.abs(slopes) / size,
        predicted_relative_std=predicted_relative,
        identifiable=(predicted_relative <= options.identifiable_relative_std)
        & (predicted <= _LEARNT_SHARE * parameters.prior_std),
        internal=internal,
        covariance=covariance,
        singular_values=np.linalg.svd(scaled / np.outer(root, root), compute_uv=False),
        confidence=options.confidence,
        cost=best.cost,
        configuration_cost=problem.configuration_cost(modelled, internal),
        expected_cost=expected_cost(problem, modelled),
        misfit=excess,
        dropped=dropped,
        start_cost=costs,
        start_iterations=np.array([end.iterations for end in ends]),
        start_status=tuple(end.status for end in ends),
        start_minimum=distinct_minima(costs),
        status=best.status,
        advice=_advice(best, parameters, dropped / problem.weight.size, excess),
        configurations=problem.frf.configurations,
        frequency_hz=problem.frf.frequency_hz,
        measured=problem.measured(internal),
        modelled=modelled,
        tied_names=tuple(parameters.tied),
        tied_to=tuple(parameters.tied.values()),
        **_tied_values(parameters, internal),
    )


def _tied_values(parameters: ParameterMap, internal: FloatArray) -> dict[str, FloatArray]:
    rows = [parameters.elements.index(name) for name in parameters.tied]
    start = np.zeros_like(internal)
    return {
        "tied_nominal": parameters.element_values(start)[rows],
        "tied_estimate": parameters.element_values(internal)[rows],
    }


def expected_cost(problem: Problem, modelled: ComplexArray) -> FloatArray:
    """Cost (n_conf,) that the measured response's covariance alone gives around the modelled response."""
    variance = problem.frf.element_variance()
    if problem.estimator != "nls":
        variance = variance / np.abs(modelled) ** 2
    if problem.estimator == "llsm":
        variance = 0.5 * variance
    return np.asarray((problem.weight * variance).sum(axis=(1, 2, 3)))


def misfit(problem: Problem, modelled: ComplexArray, cost: float) -> float:
    """Cost over what the response's covariance and the assumed model error give together; 0 without either."""
    size = np.abs(modelled) ** 2 if problem.estimator == "nls" else np.ones(problem.weight.shape)
    assumed = problem.model_error**2 * size * (0.5 if problem.estimator == "llsm" else 1.0)
    total = float(expected_cost(problem, modelled).sum() + (problem.weight * assumed).sum())
    return cost / total if total > 0 else 0.0


def distinct_minima(costs: FloatArray) -> IntArray:
    """Numbers the minima by cost, 0 the best; costs within 0.1 % are one minimum."""
    labels = np.zeros(costs.size, int)
    order = np.argsort(costs)
    reference, label = costs[order[0]], 0
    for index in order:
        if costs[index] > reference * (1 + _SAME_MINIMUM) + 1e-12:
            reference, label = costs[index], label + 1
        labels[index] = label
    return labels


def check_inputs(robot: Robot, frf: Frf) -> None:
    """Refuses a response whose inputs are not the robot's motors.

    Raises:
        DataError: If it is so.
    """
    motors = tuple(joint.name for joint in robot.joints)
    if frf.input_names != motors:
        message = f"the response's inputs are {', '.join(frf.input_names)}, the robot's motors {', '.join(motors)}"
        raise DataError(message, where=robot.name, remedy="name the inputs after the robot's joints, in order")


def _check_finite(robot: Robot, frf: Frf) -> None:
    bad = ~np.isfinite(frf.response).all(axis=(0, 2, 3))
    if bad.any():
        shown = ", ".join(f"{frequency:.3g}" for frequency in frf.frequency_hz[bad][:5])
        raise DataError(f"the response is not finite at {shown} Hz", where=robot.name, remedy="estimate it again")


def _check_influence(problem: Problem) -> None:
    parameters = problem.parameters
    prior = 0.5 / parameters.prior_std**2
    influence = np.diag(problem.normal(np.zeros(len(parameters.names))).hessian) - prior
    none = (influence <= _NO_INFLUENCE * influence.max()) & (np.array(parameters.kind_of) != "friction")
    silent = [name for name, without in zip(parameters.names, none, strict=True) if without]
    if silent:
        message = f"free parameters change nothing: {', '.join(silent)}"
        raise DataError(message, where="fit", remedy="list them under `fixed`, or measure other configurations")


def _advice(best: Minimum, parameters: ParameterMap, dropped_share: float, excess: float) -> str:
    advice = []
    if best.status != "converged":
        advice.append("raise `max_iterations`, add starts, or fix the parameters with the largest deviations")
    factor = np.exp(best.parameters * parameters.logarithmic)
    needless = [
        name
        for name, kind, ratio in zip(parameters.names, parameters.kind_of, factor, strict=True)
        if kind == "stiffness" and ratio > _NEEDLESS_FACTOR
    ]
    if needless:
        advice.append(f"springs that ran to infinity are not needed: {', '.join(needless)}")
    held = parameters.at_bound(best.parameters)
    if held:
        advice.append(f"parameters ended at a bound, where their intervals do not hold: {', '.join(held)}")
    if dropped_share > _MANY_DROPPED:
        advice.append(f"{100 * dropped_share:.0f} % of the response lies below 10 dB: excite more, or average more")
    if excess > _POOR_MODEL:
        advice.append(
            f"the residual is {np.sqrt(excess):.1f} times what noise and assumed model error give: the model lacks "
            "something; intervals are widened by that factor"
        )
    return "; ".join(advice)
