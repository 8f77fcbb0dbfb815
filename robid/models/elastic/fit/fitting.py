"""The elastic family: springs, dampers, inertias and delay from frequency responses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.frf.quality import driving_points, undeclared_delay
from robid.models.elastic.fit.checks import check_data, check_influence, check_inputs
from robid.models.elastic.fit.model_error import element_level
from robid.models.elastic.fit.nuisance.kinds import DoubtfulRobot
from robid.models.elastic.fit.nuisance.named import Suspicion
from robid.models.elastic.fit.optimizers import Strategy, make_strategy, optimise
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.other_slip import other_side
from robid.models.elastic.fit.parameters import ParameterMap, map_parameters
from robid.models.elastic.fit.problem import Problem, make_problem
from robid.models.elastic.fit.rest_model import rest_model
from robid.models.elastic.fit.result import make_solution
from robid.models.elastic.fit.solution import ElasticSolution
from robid.models.elastic.fit.uncertainty import Map, influence, load_doubt, structured_covariance
from robid.results.levenberg import Minimum
from robid.robot.description import Robot
from robid.robot.response import nominal_parameters

_BETTER = 1e-3  # of the cost
_UPDATED_ENOUGH = 1e-6  # of the cost
_BACK = (1.0, 0.5, 0.25, 0.0)
_OTHER_SAMPLES = (-1, 1, 2)
_NO_REST = (
    "the springs that would fit best give way under gravity: these are on the way to them, as far as the robot rests;"
    " look for wrong data or a wrong robot file before anything else"
)


def serial_map(function: Callable[[Any], Any], tasks: Sequence[Any]) -> list[Any]:
    """Applies a function to each task in turn."""
    return [function(task) for task in tasks]


def fit_elastic(
    robot: Robot,
    frf: Frf,
    options: ElasticOptions,
    delay_s: float,
    parallel_map: Map = serial_map,
    doubtful: Sequence[DoubtfulRobot] = (),
    near: Mapping[str, float] | None = None,
) -> ElasticSolution:
    """Fits the elastic model to frequency responses of one or many configurations.

    Args:
        robot: Nominal robot; the first start.
        frf: Measured responses with covariance.
        options: Estimator, weights, free parameters, starts.
        delay_s: Nominal delay from recorded to applied torque, hold excluded [s].
        parallel_map: Ordered map that runs the starts.
        doubtful: Robots that show along independent directions how far the rigid parameters may be off.
        near: Internal values, by name, of a minimum to go on from in place of the options' starts.

    Returns:
        The best minimum with its uncertainty; how it ended is in `status` and `advice`.

    Raises:
        DataError: If response or covariance cannot be used as the options ask, the inputs are not the robot's
            motors, the robot file's springs give way under gravity, or a free parameter changes nothing.

    Source:
        Wernholt and Moberg (2008), sec. 5; docs/methods, sec. 5.
    """
    check_inputs(robot, frf)
    check_data(robot, frf, options)
    problem, dropped = set_up(robot, frf, options, delay_s)
    start = np.zeros(len(problem.parameters.names))
    expected = influence(problem, start)
    doubt = load_doubt(problem, start, expected.inverse, expected.weighted)
    predicted = np.sqrt(np.diag(structured_covariance(problem, expected) + doubt))
    check_influence(problem)
    if near is None:
        tasks = _tasks(problem, robot, options, undeclared_delay(driving_points(frf), delay_s))
    else:
        tasks = _tasks_near(problem, robot, options, near)
    ends: list[Minimum] = parallel_map(_descend, tasks)

    def set_up_at(problem: Problem, minimum: Minimum) -> tuple[Problem, int]:
        return set_up(robot, frf, options, delay_s, (problem, minimum))

    best = min(ends, key=lambda end: end.cost)
    reached = _update(_Reached(problem, dropped, best), start, options, set_up_at)
    reached = _on_better_sides(reached, options, set_up_at)
    suspicion = Suspicion(robot, options, doubtful, reached.rests)
    endings = ends, predicted, reached.dropped
    solution = make_solution(reached.problem, options, reached.best, *endings, parallel_map, suspicion)
    if reached.rests:
        return solution
    advice = "; ".join(filter(None, (_NO_REST, solution.estimate.advice)))
    return replace(solution, estimate=replace(solution.estimate, advice=advice))


_Task: TypeAlias = tuple[Strategy, FloatArray, bool]


def _tasks(problem: Problem, robot: Robot, options: ElasticOptions, delay_s: float | None) -> list[_Task]:
    strategy = make_strategy(problem, robot, options)
    starts = _with_delay(problem.parameters, draw_starts(problem.parameters, options), delay_s)
    # The robot file's values may be so near that stages only lead away from them.
    tasks = [(strategy, start, index == 0) for index, start in enumerate(starts)]
    return [*tasks, *((strategy, start, True) for start in _at_other_samples(problem, starts[0]))]


def _at_other_samples(problem: Problem, start: FloatArray) -> list[FloatArray]:
    """The first start at delays of other whole samples, where accelerations were sampled.

    One that follows a torque at once tells which sample's torque it follows, and nothing of the delay in between: no
    descent leads from one sample to the next.
    """
    parameters, period_s = problem.parameters, problem.frf.sampling_period_s
    if "delay" not in parameters.names or 2 not in problem.model.rates:
        return []
    index = parameters.names.index("delay")
    steps = period_s / parameters.scale[index] * np.array(_OTHER_SAMPLES)
    own = np.arange(start.size) == index
    return [np.clip(start + step * own, parameters.lower, parameters.upper) for step in steps]


def _tasks_near(problem: Problem, robot: Robot, options: ElasticOptions, near: Mapping[str, float]) -> list[_Task]:
    """Straight down from a minimum, what it lacks at the robot file's values.

    A spring that it lacks has changed the others too much: with one, the robot file's values are a start as well.
    """
    names = problem.parameters.names
    start = np.array([near.get(name, 0.0) for name in names])
    start = np.clip(start, problem.parameters.lower, problem.parameters.upper)
    tasks = [(Strategy(problem, None, options), start, False)]
    if any(name.endswith(".stiffness") and name not in near for name in names):
        tasks.append((make_strategy(problem, robot, options), np.zeros(start.size), True))
    return tasks


@dataclass(frozen=True)
class _Reached:
    """How far a fit has come: its problem, what that drops, its minimum, and whether the robot rests there."""

    problem: Problem
    dropped: int
    best: Minimum
    rests: bool = True


def _update(
    now: _Reached,
    rested: FloatArray,
    options: ElasticOptions,
    set_up_at: Callable[[Problem, Minimum], tuple[Problem, int]],
) -> _Reached:
    """Goes on with statics and weights of the minimum until they no longer matter.

    Where its springs give way under gravity, the fit ends on the way back to where the robot last rested.
    """
    updates = max(options.statics_updates, options.weights.kind == "estimated")
    for update in range(updates + 1):
        ahead = _where_it_rests(now, rested, set_up_at)
        if update == updates or not ahead.rests:
            return ahead if not ahead.rests else now
        rested, before = ahead.best.parameters, ahead.problem.cost(ahead.best.parameters)
        best = optimise(ahead.problem, rested, max_iterations=options.max_iterations)
        now = replace(ahead, best=best)
        if before - best.cost <= _UPDATED_ENOUGH * before:
            break
    return now


def _on_better_sides(
    now: _Reached, options: ElasticOptions, set_up_at: Callable[[Problem, Minimum], tuple[Problem, int]]
) -> _Reached:
    """Tries for each hysteresis whether bristles that slip on the other side of the largest loss fit better."""
    effects = now.problem.model.effects if now.rests else None
    for number in range(0 if effects is None else len(effects.bristles)):
        start = other_side(now.problem, now.best.parameters, number)
        if start is None or not now.rests:
            continue
        best = optimise(now.problem, start, max_iterations=options.max_iterations)
        if best.cost < (1 - _BETTER) * now.best.cost:
            now = _update(replace(now, best=best), now.best.parameters, options, set_up_at)
    return now


def _where_it_rests(
    now: _Reached, rested: FloatArray, set_up_at: Callable[[Problem, Minimum], tuple[Problem, int]]
) -> _Reached:
    """Sets the problem up at the minimum, else as near to it as the robot rests on the way back."""
    for share in _BACK:
        point = rested + share * (now.best.parameters - rested) if share < 1 else now.best.parameters
        end = replace(now.best, parameters=point)
        try:
            problem, dropped = set_up_at(now.problem, end)
        except DataError:
            if share == 0:
                raise
            continue
        if share < 1:
            end = replace(end, cost=problem.cost(point), status="stalled")
        return _Reached(problem, dropped, end, rests=share == 1)
    return now


def _with_delay(parameters: ParameterMap, starts: list[FloatArray], delay_s: float | None) -> list[FloatArray]:
    """Lets the starts begin at a delay that the phases show: many samples away, no descent finds it."""
    if delay_s is None or "delay" not in parameters.names:
        return starts
    index = parameters.names.index("delay")
    internal = (delay_s - parameters.nominal_values()[index]) / parameters.scale[index]
    own = np.arange(len(parameters.names)) == index
    return [np.clip(np.where(own, internal, start), parameters.lower, parameters.upper) for start in starts]


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
    if before is None:
        return make_problem(frf, model, parameters, options)
    internal = before[1].parameters
    level = element_level(before[0], internal) if options.weights.kind == "estimated" else None
    return make_problem(frf, model, parameters, options, internal, level)


def without_coefficients(frf: Frf) -> Frf:
    """Returns a response whose compensated torques are taken for granted."""
    return replace(
        frf,
        sensitivity=frf.sensitivity[:, :0],
        coefficient_names=(),
        coefficient_relative_std=np.zeros(0),
        coefficient_offset=None,
    )


def draw_starts(parameters: ParameterMap, options: ElasticOptions) -> list[FloatArray]:
    """Draws the starts (n_param,) of a fit: the robot file's values, then log-uniform within the stated decades.

    A motor's inertia, which the robot file knows by itself, stays within what that leaves open.
    """
    generator = np.random.default_rng(options.seed)
    spread = np.log(10) * options.start_decades * parameters.logarithmic
    rotors = np.array(parameters.kind_of) == "motor_inertia"
    spread = np.where(rotors, np.minimum(spread, np.sqrt(3) * parameters.prior_std), spread)
    random = spread * generator.uniform(-1, 1, (options.starts - 1, len(parameters.names)))
    return [np.zeros(len(parameters.names)), *np.clip(random, parameters.lower, parameters.upper)]


def _descend(task: _Task) -> Minimum:
    strategy, start, straight_too = task
    return strategy.descend(start, straight_too=straight_too)
