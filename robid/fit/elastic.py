"""The elastic family: springs, dampers, inertias and delay from frequency responses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from scipy.stats import norm

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.errors import DataError
from robid.fit.levenberg import Minimum, minimise
from robid.fit.options import ElasticOptions, Weights
from robid.fit.parameters import LOGARITHMIC, ParameterMap, map_parameters
from robid.fit.problem import Problem, make_problem
from robid.fit.solution import Solution
from robid.fit.uncertainty import sandwich
from robid.frf.frf import Frf
from robid.robot.description import Robot
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import ElasticModel, build_model
from robid.robot.response import nominal_parameters

Map: TypeAlias = Callable[[Callable[[Any], Any], Sequence[Any]], list[Any]]

_SAME_MINIMUM = 1e-3
_COARSE_TOLERANCE = 1e-4
_COARSE_WEIGHTS = Weights(kind="user", off_diagonal=0.5)
_CALL_BACKS = 3
_NEEDLESS_FACTOR = 1e3
_LEARNT_SHARE = 0.5  # of what was known beforehand may stay unknown
_MANY_DROPPED = 0.2
_POOR_MODEL = 1.5
_NO_INFLUENCE = 1e-14  # of the largest: rounding


@dataclass(frozen=True)
class _Start:
    """One start; `coarse` has fewer parameters, the first ones of `problem`."""

    problem: Problem
    coarse: Problem
    internal: FloatArray
    max_iterations: int


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
    elastic = build_model(robot)
    problem, dropped = _problem(elastic, frf, options, delay_s)
    predicted = np.sqrt(np.diag(sandwich(problem, np.zeros(len(problem.parameters.names)))))
    _check_influence(problem)
    coarse = _coarse(problem, robot, options)
    tasks = [_Start(problem, coarse, start, options.max_iterations) for start in _starts(problem.parameters, options)]
    ends: list[Minimum] = parallel_map(_descend, tasks)
    best = min(ends, key=lambda end: end.cost)
    for _ in range(options.statics_updates):
        problem, dropped = _problem(elastic, frf, options, delay_s, (problem, best))
        best = minimise(problem.cost, problem.normal, best.parameters, max_iterations=options.max_iterations)
    return _solution(problem, options, best, ends, predicted, dropped)


def fit_starts(
    robot: Robot, frf: Frf, options: ElasticOptions, delay_s: float, chosen: Sequence[int], parallel_map: Map = serial_map
) -> list[Minimum]:
    """Descends from some of the starts of `fit_elastic`, statics and weights at the robot file's values.

    Args:
        robot: As for `fit_elastic`.
        frf: As for `fit_elastic`.
        options: As for `fit_elastic`.
        delay_s: As for `fit_elastic`.
        chosen: Indices of the starts; 0 is the robot file's values.
        parallel_map: As for `fit_elastic`.

    Returns:
        Where each of them ended.
    """
    problem = elastic_problem(robot, frf, options, delay_s)
    coarse, starts = _coarse(problem, robot, options), _starts(problem.parameters, options)
    return parallel_map(_descend, [_Start(problem, coarse, starts[index], options.max_iterations) for index in chosen])


def elastic_problem(robot: Robot, frf: Frf, options: ElasticOptions, delay_s: float) -> Problem:
    """Returns the problem of a fit, statics and weights at the robot file's values; arguments as for `fit_elastic`.

    Raises:
        DataError: If the response is not finite or its inputs are not the robot's motors.
    """
    check_inputs(robot, frf)
    _check_finite(robot, frf)
    return _problem(build_model(robot), frf, options, delay_s)[0]


def _problem(
    elastic: ElasticModel,
    frf: Frf,
    options: ElasticOptions,
    delay_s: float,
    before: tuple[Problem, Minimum] | None = None,
) -> tuple[Problem, int]:
    """Statics and weights at the robot file's values, or at those of the minimum reached before."""
    stiffness = None if before is None else before[0].parameters.parameters(before[1].parameters).stiffness
    equilibrium = solve_statics(elastic, frf.configurations, stiffness)
    model = linearize(elastic, equilibrium, frf.output_names)
    nominal = nominal_parameters(elastic.robot, model, delay_s)
    known = frf.coefficient_names, frf.coefficient_relative_std, frf.coefficient_offset
    parameters = map_parameters(elastic.robot, nominal, options, *known)
    return make_problem(frf, model, parameters, options, None if before is None else before[1].parameters)


def _starts(parameters: ParameterMap, options: ElasticOptions) -> list[FloatArray]:
    generator = np.random.default_rng(options.seed)
    spread = np.log(10) * options.start_decades * parameters.logarithmic
    random = spread * generator.uniform(-1, 1, (options.starts - 1, len(parameters.names)))
    return [np.zeros(len(parameters.names)), *random]


def _descend(start: _Start) -> Minimum:
    """Descends with springs, dampers and inertias under user weights first, then with everything."""
    internal = start.internal.copy()
    shared = [start.problem.parameters.names.index(name) for name in start.coarse.parameters.names]
    coarse = _call_back(start.coarse, internal[shared], start.max_iterations)
    internal[shared] = coarse.parameters
    end = minimise(start.problem.cost, start.problem.normal, internal, max_iterations=start.max_iterations)
    return replace(end, iterations=coarse.iterations + end.iterations)


def _call_back(problem: Problem, internal: FloatArray, max_iterations: int) -> Minimum:
    """Descends; while parameters run away, sets them to nominal, halves the others' distance, descends again."""

    def descend(point: FloatArray) -> Minimum:
        return minimise(
            problem.cost, problem.normal, point, max_iterations=max_iterations, cost_tolerance=_COARSE_TOLERANCE
        )

    best = descend(internal)
    iterations = best.iterations
    for _ in range(_CALL_BACKS):
        ran_away = np.abs(best.parameters) > problem.parameters.prior_std
        if not ran_away.any():
            break
        again = descend(np.where(ran_away, 0.0, 0.5 * best.parameters))
        iterations += again.iterations
        if again.cost > best.cost * (1 - _SAME_MINIMUM):
            break
        best = again
    return replace(best, iterations=iterations)


def _coarse(problem: Problem, robot: Robot, options: ElasticOptions) -> Problem:
    kinds = tuple(kind for kind in options.free if kind in LOGARITHMIC)
    names = tuple(name for name in options.fixed if name.rpartition(".")[2] in kinds)
    fewer = replace(options, free=kinds, fixed=names, weights=_COARSE_WEIGHTS)
    nominal = problem.parameters.nominal
    parameters = map_parameters(robot, nominal, fewer, (), np.zeros(0))
    frf = problem.frf
    plain = replace(frf, sensitivity=frf.sensitivity[:, :0], coefficient_names=(), coefficient_relative_std=np.zeros(0))
    return make_problem(plain, problem.model, parameters, fewer)[0]


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
    predicted_size = np.where(friction | (nominal == 0), 1.0, np.abs(nominal))
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
    )


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
    if dropped_share > _MANY_DROPPED:
        advice.append(f"{100 * dropped_share:.0f} % of the response lies below 10 dB: excite more, or average more")
    if excess > _POOR_MODEL:
        advice.append(
            f"the residual is {np.sqrt(excess):.1f} times what noise and assumed model error give: the model lacks "
            "something; intervals are widened by that factor"
        )
    return "; ".join(advice)
