"""The elastic family: springs, dampers, inertias and delay from frequency responses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robid.arrays import FloatArray
from robid.fit.bootstrap import Map
from robid.fit.checks import check_data, check_influence, check_inputs
from robid.fit.levenberg import COST_TOLERANCE, Minimum, minimise
from robid.fit.names import LOGARITHMIC, restricted
from robid.fit.options import ElasticOptions, Weights
from robid.fit.parameters import ParameterMap, map_parameters
from robid.fit.problem import Problem, make_problem
from robid.fit.rest_model import rest_model
from robid.fit.result import make_solution
from robid.fit.solution import Solution
from robid.fit.uncertainty import sandwich
from robid.frf.frf import Frf
from robid.robot.description import Robot
from robid.robot.response import nominal_parameters

_SAME_MINIMUM = 1e-3
_COARSE_TOLERANCE = 1e-4
_UPDATED_ENOUGH = 1e-6  # of the cost
_COARSE_WEIGHTS = Weights(kind="user", off_diagonal=0.5)
_CALL_BACKS = 3


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
        DataError: If response or covariance cannot be used as the options ask, the inputs are not the robot's
            motors, or a free parameter changes nothing.

    Source:
        Wernholt and Moberg (2008), sec. 5; METHODS sec. 5.
    """
    check_inputs(robot, frf)
    check_data(robot, frf, options)
    problem, dropped = _problem(robot, frf, options, delay_s)
    predicted = np.sqrt(np.diag(sandwich(problem, np.zeros(len(problem.parameters.names)))))
    check_influence(problem)
    coarse = _coarse(problem, robot, options)
    tasks = [_Start(problem, coarse, start, options.max_iterations) for start in _starts(problem.parameters, options)]
    ends: list[Minimum] = parallel_map(_descend, tasks)
    best = min(ends, key=lambda end: end.cost)
    for _ in range(options.statics_updates):
        problem, dropped = _problem(robot, frf, options, delay_s, (problem, best))
        before = problem.cost(best.parameters)
        best = descend(problem, best.parameters, options.max_iterations)
        if before - best.cost <= _UPDATED_ENOUGH * before:
            break
    return make_solution(problem, options, best, ends, predicted, dropped, parallel_map)


def _problem(
    robot: Robot,
    frf: Frf,
    options: ElasticOptions,
    delay_s: float,
    before: tuple[Problem, Minimum] | None = None,
) -> tuple[Problem, int]:
    """Statics and weights at the robot file's values, or at those of the minimum reached before."""
    values = None if before is None else before[0].parameters.parameters(before[1].parameters)
    model = rest_model(robot, frf, options, delay_s, values)
    nominal = nominal_parameters(robot, model, delay_s)
    known = frf.coefficient_names, frf.coefficient_relative_std, frf.coefficient_offset
    parameters = map_parameters(robot, nominal, options, *known)
    return make_problem(frf, model, parameters, options, None if before is None else before[1].parameters)


def descend(
    problem: Problem, internal: FloatArray, max_iterations: int, cost_tolerance: float = COST_TOLERANCE
) -> Minimum:
    """Minimises a problem's cost from a point, within the parameters' bounds."""
    return minimise(
        problem.cost,
        problem.normal,
        internal,
        max_iterations=max_iterations,
        cost_tolerance=cost_tolerance,
        lower=problem.parameters.lower,
        upper=problem.parameters.upper,
    )


def _starts(parameters: ParameterMap, options: ElasticOptions) -> list[FloatArray]:
    generator = np.random.default_rng(options.seed)
    spread = np.log(10) * options.start_decades * parameters.logarithmic
    random = spread * generator.uniform(-1, 1, (options.starts - 1, len(parameters.names)))
    return [np.zeros(len(parameters.names)), *np.clip(random, parameters.lower, parameters.upper)]


def _descend(start: _Start) -> Minimum:
    """Descends with springs, dampers and inertias under user weights first, then with everything."""
    internal = start.internal.copy()
    shared = [start.problem.parameters.names.index(name) for name in start.coarse.parameters.names]
    coarse = _call_back(start.coarse, internal[shared], start.max_iterations)
    internal[shared] = coarse.parameters
    end = descend(start.problem, internal, start.max_iterations)
    return replace(end, iterations=coarse.iterations + end.iterations)


def _call_back(problem: Problem, internal: FloatArray, max_iterations: int) -> Minimum:
    """Descends; while parameters run away, sets them to nominal, halves the others' distance, descends again."""

    def once(point: FloatArray) -> Minimum:
        return descend(problem, point, max_iterations, cost_tolerance=_COARSE_TOLERANCE)

    best = once(internal)
    iterations = best.iterations
    for _ in range(_CALL_BACKS):
        ran_away = np.abs(best.parameters) > problem.parameters.prior_std
        if not ran_away.any():
            break
        again = once(np.where(ran_away, 0.0, 0.5 * best.parameters))
        iterations += again.iterations
        if again.cost > best.cost * (1 - _SAME_MINIMUM):
            break
        best = again
    return replace(best, iterations=iterations)


def _coarse(problem: Problem, robot: Robot, options: ElasticOptions) -> Problem:
    kinds = tuple(kind for kind in options.free if kind in LOGARITHMIC)
    fewer = replace(restricted(options, kinds), weights=_COARSE_WEIGHTS)
    nominal = problem.parameters.nominal
    parameters = map_parameters(robot, nominal, fewer, (), np.zeros(0))
    frf = problem.frf
    plain = replace(frf, sensitivity=frf.sensitivity[:, :0], coefficient_names=(), coefficient_relative_std=np.zeros(0))
    return make_problem(plain, problem.model, parameters, fewer)[0]
