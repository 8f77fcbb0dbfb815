"""Design of a trajectory: search from random starts, how much of it can be played, and the plan of what it will do."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import nlopt
import numpy as np
from threadpoolctl import threadpool_limits

from robid.arrays import ComplexArray, FloatArray
from robid.design.excitation.excitation import Excitation, ExcitationPlan, make_plan
from robid.design.excitation.lines import check_signal, samples_per_period
from robid.design.excitation.options import TrajectoryOptions
from robid.design.excitation.prediction import admissible_scale
from robid.design.excitation.trajectory.limits import resting_series, trajectory_limits
from robid.design.excitation.trajectory.problem import BaseModel, Criterion, TrajectoryProblem
from robid.errors import SettingsError
from robid.robot.reach import Reach
from robid.signals.waveforms import crest_factor, time_signal

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
    # Joints differ in how much of their range and acceleration they use.
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
        # Objective and constraints come from one evaluation, though the optimiser asks for them apart.
        walk, tool = _Walk(problem, (best / problem.scale).ravel(), sharpness), nlopt.opt(algorithm, start.size)
        tool.set_maxeval(max(round(share * evaluations), 1))
        tool.set_min_objective(walk.objective)
        tool.add_inequality_mconstraint(walk.constraints, np.full(walk.latest.used.size, _WITHIN))
        tool.set_lower_bounds(-_BOUND)
        tool.set_upper_bounds(_BOUND)
        tool.set_ftol_rel(_TOLERANCE)
        point = walk.point
        with contextlib.suppress(nlopt.RoundoffLimited, RuntimeError):
            point = np.asarray(tool.optimize(np.clip(walk.point, -_BOUND, _BOUND)))
        # Optimisers end slightly outside: the way is shrunk until it is within.
        end = np.asarray(point.reshape(start.shape) * problem.scale)
        end = end * _allowed(problem, end)
        reached = problem.criterion.value(problem.regressor(end))
        if reached < value:
            best, value = end, reached
    return best


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


@dataclass(frozen=True)
class Trajectory:
    """One optimised trajectory."""

    coefficients: FloatArray  # (n_shape, n_joint) Coefficients of its shapes, arm side [rad, or m]
    value: float
    condition: float  # Condition number of its regressor, each column over its size in random motions


def _trajectory_plan(
    problem: TrajectoryProblem,
    options: TrajectoryOptions,
    found: Sequence[Trajectory],
    n_sample: int,
    duration_s: float,
) -> ExcitationPlan:
    """What trajectories use of the whole limits; excursions are those to the side that comes nearest its end."""
    motions = np.array([problem.series.grid(n_sample) @ each.coefficients for each in found])
    torque = np.array([problem.base.torques(problem.configurations, motion) for motion in motions])
    still = problem.base.torques(problem.configurations, np.zeros((3, 1, motions.shape[-1])))[:, 0]
    speed, limits = motions[:, 1] @ problem.robot.motor_per_arm.T, problem.limits
    # Towards the side where a joint uses most of its room.
    way, (below, above) = motions[:, 0], (limits.below, limits.above)
    upward = (way / above).max(axis=(0, 1)) >= (-way / below).max(axis=(0, 1))
    way, room = np.where(upward, way, -way), np.where(upward, above, below)
    least, most, rms = np.stack([_reached(speed, still), _reached(torque, still), _reached(way, still)], axis=1)
    peak = np.array([np.maximum(most[0], -least[0]), np.maximum(most[1], -least[1]), most[2]])
    whole = np.array([limits.speed / options.speed_share, limits.torque / options.torque_share, room])
    whole[2] /= options.position_share
    least[2] = -most[2]
    return replace(
        make_plan(rms, peak, whole, admissible_scale(least, most, whole, still).min(axis=0)),
        speed_crest=np.broadcast_to(crest_factor(speed).max(axis=0), still.shape).copy(),
        duration_s=duration_s,
        condition=np.array([each.condition for each in found]),
    )


def _reached(signal: FloatArray, like: FloatArray) -> FloatArray:
    """Least, greatest and RMS value (3, n_conf, n) of (n_real, n_sample, n) or (n_real, n_conf, n_sample, n)."""
    time = (0, signal.ndim - 2)
    values = np.array([signal.min(axis=time), signal.max(axis=time), np.sqrt(np.mean(signal**2, axis=time))])
    return np.broadcast_to(values.reshape(3, -1, like.shape[1]), (3, *like.shape)).copy()


# Samples of a period, for each harmonic, at which criterion and limits are looked at in the search.
_JUDGED_PER_HARMONIC = 20

Map: TypeAlias = Callable[[Callable[[Any], Any], Sequence[Any]], list[Any]]

_REACH_SAMPLES = 200
_SIZING_DRAWS = 20
_LEAST_MOTION = 1e-3  # Largest coefficient over a joint's way to its limits, below which nothing moves


def serial_map(function: Callable[[Any], Any], tasks: Sequence[Any]) -> list[Any]:
    """Applies a function to each task, one after the other."""
    return [function(task) for task in tasks]


def trajectory_problem(
    base: BaseModel, configurations: FloatArray, options: TrajectoryOptions, floor_m: float | None = None
) -> TrajectoryProblem:
    """Sets up the search of a trajectory that begins and ends in configurations (n_conf, n_joint) [rad, or m].

    No point may go below the floor [m], where there is one.

    Raises:
        SettingsError: With everything that keeps the robot from moving.
    """
    robot, n_judged = base.model.robot, int(base.judged.sum())
    still = np.zeros((3, 1, len(robot.joints)))
    limits = trajectory_limits(robot, configurations, base.torques(configurations, still)[:, 0], options)
    series = resting_series(options.harmonics, options.period_s)
    waves = series.grid(_JUDGED_PER_HARMONIC * options.harmonics)
    weight = 1 / np.array([joint.motor.max_torque_nm for joint in robot.joints])
    plain = Criterion(options.criterion, weight, np.ones(n_judged))
    problem = TrajectoryProblem(base, plain, configurations, series, waves, limits, floor_m)
    generator = np.random.default_rng([options.seed, 0])
    drawn = [plain.rows(problem.regressor(random_trajectory(problem, generator))) for _ in range(_SIZING_DRAWS)]
    # Columns over their size in random motions: condition numbers then do not depend on units.
    size = np.sqrt(np.mean(np.concatenate(drawn) ** 2, axis=0))
    return replace(problem, criterion=replace(plain, column_size=np.where(size > 0, size, 1.0)))


@dataclass(frozen=True)
class _Start:
    """One descent: its problem and random start, and how what it ends in is played."""

    problem: TrajectoryProblem
    options: TrajectoryOptions
    realization: int
    index: int
    n_sample: int
    reach: Reach


def _descended(task: _Start) -> Trajectory:
    """Descends from a random start, and makes the end small enough to be played."""
    problem, options = task.problem, task.options
    # The matrices are small: on a busy machine BLAS threads would only wait for each other.
    with threadpool_limits(1, user_api="blas"):
        generator = np.random.default_rng([options.seed, 1, task.realization, task.index])
        end = descend(problem, random_trajectory(problem, generator), options.evaluations)
        end = end * _playable_factor(problem, end, task.n_sample, task.reach)
        regressor = problem.regressor(end)
        return Trajectory(end, problem.criterion.value(regressor), problem.criterion.condition(regressor))


def _playable_factor(problem: TrajectoryProblem, coefficients: FloatArray, n_sample: int, reach: Reach) -> float:
    """Largest factor at which limits hold at every played sample, and the arm stays in reach."""
    played, sparse = (problem.series.grid(count) @ coefficients for count in (n_sample, _REACH_SAMPLES))

    def is_allowed(factor: float) -> bool:
        torque = problem.base.torques(problem.configurations, factor * played)
        if problem.limits.used(problem.robot, factor * played, torque).max() > 1:
            return False
        visited = problem.configurations[:, None] + factor * sparse[0]
        return not any(reach.problems(visited.reshape(-1, visited.shape[-1])))

    return largest_factor(is_allowed)


def design_trajectory(
    options: TrajectoryOptions,
    base: BaseModel,
    configurations: FloatArray,
    realizations: int,
    sampling_period_s: float,
    reach: Reach,
    *,
    periods: int = 1,
    transient_periods: int = 0,
    parallel_map: Map = serial_map,
) -> Excitation:
    """Designs exciting trajectories, one experiment of all motors in each realization.

    They begin and end in configurations (n_conf, n_joint) [rad, or m], keep to floor and shapes, and are played with
    periods that are recorded and periods before those. The ordered map runs the starts.

    Raises:
        SettingsError: With everything that keeps the robot from moving.
    """
    check_signal(options, sampling_period_s)
    n_sample = samples_per_period(options.period_s, sampling_period_s)
    with threadpool_limits(1, user_api="blas"):
        problem = trajectory_problem(base, configurations, options, reach.floor_m)
    places = np.ndindex(realizations, options.starts)
    tasks = [_Start(problem, options, realization, index, n_sample, reach) for realization, index in places]
    ends = np.array(parallel_map(_descended, tasks), object).reshape(realizations, options.starts)
    found = [min(row, key=lambda each: each.value) for row in ends.tolist()]
    _check_motion(found, configurations, problem)
    excitation = _excitation(problem, options, found, sampling_period_s, n_sample)
    duration_s = realizations * len(configurations) * (periods + transient_periods) * options.period_s
    return replace(excitation, plan=_trajectory_plan(problem, options, found, n_sample, duration_s))


def _check_motion(found: list[Trajectory], configurations: FloatArray, problem: TrajectoryProblem) -> None:
    if all(np.abs(each.coefficients / problem.scale).max() > _LEAST_MOTION for each in found):
        return
    what = "No motion that begins and ends in the configuration keeps to limits, floor and shapes"
    remedy = "begin farther from floor and shapes, or raise the shares of the limits"
    message = f"S032 {what}: {problem.robot.shown(configurations[0])}."
    raise SettingsError(message, where="excitation", remedy=remedy)


def _excitation(
    problem: TrajectoryProblem,
    options: TrajectoryOptions,
    found: list[Trajectory],
    sampling_period_s: float,
    n_sample: int,
) -> Excitation:
    lines = problem.series.lines
    amplitudes = np.array([problem.series.amplitudes(each.coefficients) for each in found])
    spectrum: ComplexArray = np.einsum("rki,mi->rkm", amplitudes, problem.robot.motor_per_arm)[:, None]
    if options.inject == "speed_reference":
        spectrum = np.asarray(spectrum * (2j * np.pi * lines / options.period_s)[:, None])
    reference = time_signal(spectrum, lines, n_sample)
    rms, crest = np.sqrt(np.mean(reference**2, axis=(0, 1, 2))), crest_factor(reference)
    return Excitation(reference, options.inject, lines, np.zeros(0, int), sampling_period_s, spectrum, rms, crest)
