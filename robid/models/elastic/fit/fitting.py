"""The elastic fit: what it refuses, its starts, descents and updates, up to its solution."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.errors import DataError
from robid.frf.channels import require
from robid.frf.frf import Frf
from robid.frf.quality import driving_points, undeclared_delay
from robid.models.elastic.fit.model_error import element_level
from robid.models.elastic.fit.nuisance.effects import PerturbedRobot
from robid.models.elastic.fit.nuisance.linear import Basis
from robid.models.elastic.fit.optimizers import Strategy, make_strategy, optimise, other_side
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.parameters import ParameterMap, map_parameters
from robid.models.elastic.fit.problem import Problem, make_problem, without_coefficients
from robid.models.elastic.fit.rest_model import rest_model
from robid.models.elastic.fit.result import distinct_minima, make_solution
from robid.models.elastic.fit.solution import ElasticSolution
from robid.models.elastic.fit.uncertainty import Map, cubic_covariance, influence, structured_covariance
from robid.models.elastic.fit.weights import singular_covariance
from robid.results.levenberg import Minimum
from robid.robot.description import Robot
from robid.robot.parameters import FRICTION_KIND, NUISANCE_KIND
from robid.robot.response import nominal_parameters
from robid.signals.quantities import ACCELERATION, MOTOR_TORQUE

_NO_INFLUENCE = 1e-14  # of the largest: rounding


def check_inputs(robot: Robot, frf: Frf) -> None:
    """Refuses a response that is not one from motor torques to accelerations, or not of the robot's motors.

    Raises:
        DataError: If it is so.
    """
    require(frf, MOTOR_TORQUE, ACCELERATION, "An elastic model")
    motors = tuple(joint.name for joint in robot.joints)
    if frf.input_names != motors:
        message = f"D129 the response's inputs are {', '.join(frf.input_names)}, the robot's motors {', '.join(motors)}"
        raise DataError(message, where=robot.name, remedy="name the inputs after the robot's joints, in order")


def check_data(robot: Robot, frf: Frf, options: ElasticOptions) -> None:
    """Refuses responses and covariances that the options cannot use, everything at once.

    Raises:
        DataError: If the inputs are not the robot's motors, response or covariance are not finite, or too few
            realizations stand behind what is asked.
    """
    check_inputs(robot, frf)
    problems = [*_not_finite(frf), *_covariance(frf, options), *_realizations(frf, options)]
    if problems:
        messages, remedies = zip(*problems, strict=True)
        raise DataError("; ".join(messages), where=robot.name, remedy="; ".join(dict.fromkeys(remedies)))


def check_influence(problem: Problem) -> None:
    """Refuses weights that leave no line, and free parameters that change nothing.

    Raises:
        DataError: If it is so.
    """
    if not problem.weight.any():
        remedy = "lower `weights.low_cut_hz`, excite more, or average over more realizations"
        raise DataError(
            "D130 no line of the response has a weight: all are cut off or below 10 dB", where="fit", remedy=remedy
        )
    parameters = problem.parameters
    prior = 0.5 / parameters.prior_std**2
    # Half the second derivative of the cost by each, without what is known beforehand: of what changes no response
    # nothing is left but rounding.
    influence = np.diag(problem.normal(np.zeros(len(parameters.names))).hessian) - prior
    known = np.isin(parameters.kind_of, (FRICTION_KIND, NUISANCE_KIND))  # beforehand: they stay where they are
    none = (influence <= _NO_INFLUENCE * influence.max()) & ~known
    silent = [name for name, without in zip(parameters.names, none, strict=True) if without]
    if silent:
        message = f"D131 free parameters change nothing: {', '.join(silent)}"
        raise DataError(message, where="fit", remedy="list them under `fixed`, or measure other configurations")


def _not_finite(frf: Frf) -> list[tuple[str, str]]:
    found = []
    told = True if frf.dropped is None else ~frf.dropped[:, :, None]
    variance = frf.element_variance()
    wrongs = (
        ("response is not finite", ~np.isfinite(frf.response)),
        ("covariance is not finite", ~np.isfinite(variance)),
        ("covariance is negative", variance < 0),
    )
    for what, wrong in wrongs:
        bad = np.asarray((told & wrong).any(axis=(0, 2, 3)))
        if bad.any():
            found.append((f"D241 the {what} at {_shown(frf, bad)} Hz", "estimate it again"))
    return found


def _covariance(frf: Frf, options: ElasticOptions) -> list[tuple[str, str]]:
    """A variance of zero where others have one, or none at all, gives optimal weights no size."""
    variance = frf.element_variance()
    if frf.dropped is not None:
        variance = np.where(frf.dropped[:, :, None], np.nanmax(variance[np.isfinite(variance)], initial=0.0), variance)
    if not options.weights.kind.startswith("optimal") or not np.isfinite(variance).all():
        return []
    if not variance.any():
        remedy = "record two or more realizations of two or more periods, or use the weights `user` or `inflated`"
        return [("D242 the response has no covariance, which optimal weights invert", remedy)]
    nothing = np.asarray(~(variance > 0).all(axis=(0, 2, 3)))
    if not nothing.any():
        return []
    error = singular_covariance(frf.frequency_hz[nothing], "")
    return [(error.what, error.remedy)]


def _realizations(frf: Frf, options: ElasticOptions) -> list[tuple[str, str]]:
    found = []
    if options.weights.kind.startswith("optimal") and frf.total_covariance is None and frf.noise_covariance is not None:
        message = "D244 optimal weights need the total covariance, but one realization shows noise only"
        found.append((message, "record two or more realizations, or use the weights `inflated` or `user`"))
    if options.bootstrap and frf.realization_error is None:
        message = "D245 `bootstrap` weights realizations anew, but the response contains none"
        remedy = "record two or more realizations and estimate the response by blocks, or set `bootstrap` to 0"
        found.append((message, remedy))
    return found


def _shown(frf: Frf, chosen: BoolArray) -> str:
    return ", ".join(f"{frequency:.3g}" for frequency in frf.frequency_hz[chosen][:5])


_BETTER = 1e-3  # of the cost
_UPDATED_ENOUGH = 1e-6  # of the cost
_BACK = (1.0, 0.5, 0.25, 0.0)
_OTHER_SAMPLES = (-1, 1, 2)


def serial_map(function: Callable[[Any], Any], tasks: Sequence[Any]) -> list[Any]:
    """Applies a function to each task in turn."""
    return [function(task) for task in tasks]


def fit_elastic(
    robot: Robot,
    frf: Frf,
    options: ElasticOptions,
    delay_s: float,
    parallel_map: Map = serial_map,
    perturbed: Sequence[PerturbedRobot] = (),
    near: Mapping[str, float] | None = None,
) -> ElasticSolution:
    """Fits the elastic model to frequency responses of one or many configurations.

    Args:
        robot: Nominal robot; the first start.
        frf: Measured responses with covariance.
        options: Estimator, weights, free parameters, starts.
        delay_s: Nominal delay from recorded to applied torque, hold excluded [s].
        parallel_map: Ordered map that runs the starts.
        perturbed: Robots that show along independent directions how far the rigid parameters may be off.
        near: Internal values, by name, of a minimum to go on from in place of the options' starts.

    Returns:
        The best minimum with its uncertainty; how it ended is in `status` and `advice`.

    Raises:
        DataError: If response or covariance cannot be used as the options ask, the inputs are not the robot's motors,
            the robot file's springs give way under gravity, or a free parameter changes nothing.

    Source:
        Wernholt and Moberg (2008), sec. 5; docs/methods, sec. 5.
    """
    check_data(robot, frf, options)
    problem, dropped = set_up(robot, frf, options, delay_s)
    predicted = _predicted_std(problem)
    check_influence(problem)
    ends = _ends(parallel_map, _tasks(problem, robot, options, delay_s, near), options.agreeing_starts)
    best = min(ends, key=lambda end: end.cost)
    begun = _Reached(problem, dropped, best, options, partial(set_up, robot, frf, options, delay_s))
    reached = _on_better_sides(_update(begun, np.zeros(predicted.size)))
    given = Basis(robot, options, perturbed, reached.rests)
    endings = reached.best, ends, predicted, reached.dropped
    return make_solution(reached.problem, options, *endings, parallel_map, given)


def _predicted_std(problem: Problem) -> FloatArray:
    """Deviations (n_param,) of the internal parameters by noise and assumed errors, at the robot file's values."""
    start = np.zeros(len(problem.parameters.names))
    expected = influence(problem, start)
    nuisance = cubic_covariance(problem, start, expected.inverse, expected.weighted)
    return np.sqrt(np.diag(structured_covariance(problem, expected) + nuisance))


def _ends(parallel_map: Map, tasks: Sequence[_Task], agreeing: int) -> list[Minimum]:
    """Where the descents end, until enough of them agree on the best minimum; those of a round run side by side."""
    size, ends = agreeing or len(tasks), list[Minimum]()
    while len(ends) < len(tasks):
        ends += parallel_map(descend, tasks[len(ends) : len(ends) + size])
        if agreeing and int((distinct_minima(np.array([end.cost for end in ends])) == 0).sum()) >= agreeing:
            break
    return ends


_Task: TypeAlias = tuple[Strategy, FloatArray, bool]


def _tasks(
    problem: Problem, robot: Robot, options: ElasticOptions, delay_s: float, near: Mapping[str, float] | None
) -> list[_Task]:
    if near is not None:
        return _tasks_near(problem, robot, options, near)
    strategy = make_strategy(problem, robot, options)
    starts = draw_starts(problem.parameters, options)
    starts = _with_delay(problem.parameters, starts, undeclared_delay(driving_points(problem.frf), delay_s))
    # The robot file's values may be so near that stages only lead away from them.
    tasks = [(strategy, start, index == 0) for index, start in enumerate(starts)]
    # Other samples of the delay come early: they are no mere repetitions, which agreement makes needless.
    others = [(strategy, start, True) for start in _at_other_samples(problem, starts[0])]
    return [tasks[0], *others, *tasks[1:]]


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
    options: ElasticOptions
    set_up_at: Callable[[tuple[Problem, Minimum]], tuple[Problem, int]]
    rests: bool = True

    def descended(self, start: FloatArray) -> _Reached:
        """Returns where a descent in this problem ends."""
        return replace(self, best=optimise(self.problem, start, max_iterations=self.options.max_iterations))


def _update(now: _Reached, rested: FloatArray) -> _Reached:
    """Goes on with statics and weights of the minimum until they no longer matter.

    Where its springs give way under gravity, the fit ends on the way back to where the robot last rested. Where
    logarithms at the minimum leave no weight, so far is the model below the noise, it ends with those before.
    """
    updates = max(now.options.statics_updates, now.options.weights.kind == "estimated")
    for update in range(updates + 1):
        ahead = _where_it_rests(now, rested)
        if not ahead.problem.weight.any():
            return now
        if update == updates or not ahead.rests:
            return ahead if not ahead.rests else now
        # Cost before and after are those of one problem: the one whose statics and weights are the last minimum's.
        rested, before = ahead.best.parameters, ahead.problem.cost(ahead.best.parameters)
        now = ahead.descended(rested)
        # Once a descent gains next to nothing, neither statics nor weights would move again.
        if before - now.best.cost <= _UPDATED_ENOUGH * before:
            break
    return now


def _on_better_sides(now: _Reached) -> _Reached:
    """Tries for each hysteresis whether bristles that slip on the other side of the largest loss fit better."""
    effects = now.problem.model.effects if now.rests else None
    for number in range(0 if effects is None else len(effects.bristles)):
        start = other_side(now.problem, now.best.parameters, number)
        if start is None or not now.rests:
            continue
        other = now.descended(start)
        if other.best.cost < (1 - _BETTER) * now.best.cost:
            now = _update(other, now.best.parameters)
    return now


def _where_it_rests(now: _Reached, rested: FloatArray) -> _Reached:
    """Sets the problem up at the minimum, else as near to it as the robot rests on the way back."""
    for share in _BACK:
        point = rested + share * (now.best.parameters - rested) if share < 1 else now.best.parameters
        end = replace(now.best, parameters=point)
        try:
            problem, dropped = now.set_up_at((now.problem, end))
        except DataError:
            if share == 0:
                raise
            continue
        if share < 1:
            end = replace(end, cost=problem.cost(point), status="stalled")
        return replace(now, problem=problem, dropped=dropped, best=end, rests=share == 1)
    return now


def _with_delay(parameters: ParameterMap, starts: list[FloatArray], delay_s: float | None) -> list[FloatArray]:
    """Lets the starts begin at a delay that the phases show: many samples away, no descent finds it."""
    if delay_s is None or "delay" not in parameters.names:
        return starts
    index = parameters.names.index("delay")
    # Phases turn by more than a whole turn with a delay of many samples: there a descent would end in another minimum.
    internal = (delay_s - parameters.nominal_values()[index]) / parameters.scale[index]
    own = np.arange(len(parameters.names)) == index
    return [np.clip(np.where(own, internal, start), parameters.lower, parameters.upper) for start in starts]


def set_up(
    robot: Robot, frf: Frf, options: ElasticOptions, delay_s: float, before: tuple[Problem, Minimum] | None = None
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


def draw_starts(parameters: ParameterMap, options: ElasticOptions) -> list[FloatArray]:
    """Draws the starts (n_param,) of a fit: the robot file's values, then log-uniform within the stated decades.

    A motor's inertia, which the robot file knows by itself, and gears that another fit has found stay within what that
    leaves open.
    """
    generator = np.random.default_rng(options.seed)
    spread = np.log(10) * options.start_decades * parameters.logarithmic
    kinds = np.array(parameters.kind_of)
    found = (kinds == "stiffness") & (parameters.prior_std < np.log(10) * options.prior_decades)
    known = found | (kinds == "motor_inertia")
    spread = np.where(known, np.minimum(spread, np.sqrt(3) * parameters.prior_std), spread)
    random = spread * generator.uniform(-1, 1, (options.starts - 1, len(parameters.names)))
    return [np.zeros(len(parameters.names)), *np.clip(random, parameters.lower, parameters.upper)]


def descend(task: _Task) -> Minimum:
    """Descends from one start."""
    strategy, start, straight_too = task
    return strategy.descend(start, straight_too=straight_too)
