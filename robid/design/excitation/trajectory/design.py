"""An exciting trajectory as an excitation, with the plan of what it will do."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from threadpoolctl import threadpool_limits

from robid.arrays import ComplexArray, FloatArray
from robid.design.excitation.excitation import Excitation
from robid.design.excitation.lines import samples_per_period
from robid.design.excitation.options import TrajectoryOptions
from robid.design.excitation.signal_lines import check_signal
from robid.design.excitation.trajectory.criterion import BaseModel, Criterion
from robid.design.excitation.trajectory.limits import trajectory_limits
from robid.design.excitation.trajectory.plan import Trajectory, trajectory_plan
from robid.design.excitation.trajectory.problem import TrajectoryProblem
from robid.design.excitation.trajectory.search import descend, largest_factor, random_trajectory
from robid.design.excitation.trajectory.series import resting_series
from robid.errors import SettingsError
from robid.robot.reach import Reach
from robid.signals.waveforms import crest_factor, time_signal

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
    """Sets up the search of a trajectory.

    Args:
        base: The rigid model with independent columns.
        configurations (n_conf, n_joint): Arm-side joint positions that it begins and ends in [rad, or m].
        options: Period, harmonics, criterion, limits.
        floor_m: Height that no point may go below; None for none [m].

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

    Args:
        options: Period, harmonics, criterion, limits and search.
        base: The rigid model with independent columns.
        configurations (n_conf, n_joint): Arm-side joint positions that they begin and end in [rad, or m].
        realizations: Number of different trajectories.
        sampling_period_s: Sampling period of the controller [s].
        reach: Floor and shapes.
        periods: Recorded periods of each.
        transient_periods: Periods before those.
        parallel_map: Ordered map over the starts.

    Raises:
        SettingsError: With everything that keeps the robot from moving.
    """
    check_signal(options, sampling_period_s)
    n_sample = samples_per_period(options.period_s, sampling_period_s)
    with threadpool_limits(1, user_api="blas"):
        problem = trajectory_problem(base, configurations, options, reach.floor_m)
    tasks = [
        _Start(problem, options, realization, index, n_sample, reach)
        for realization in range(realizations)
        for index in range(options.starts)
    ]
    ends = np.array(parallel_map(_descended, tasks), object).reshape(realizations, options.starts)
    found = [min(row, key=lambda each: each.value) for row in ends.tolist()]
    _check_motion(found, configurations, problem)
    excitation = _excitation(problem, options, found, sampling_period_s, n_sample)
    duration_s = realizations * len(configurations) * (periods + transient_periods) * options.period_s
    return replace(excitation, plan=trajectory_plan(problem, options, found, n_sample, duration_s))


def _check_motion(found: list[Trajectory], configurations: FloatArray, problem: TrajectoryProblem) -> None:
    if all(np.abs(each.coefficients / problem.scale).max() > _LEAST_MOTION for each in found):
        return
    raise SettingsError(
        "No motion that begins and ends in the configuration keeps to limits, floor and shapes:"
        f" {problem.robot.shown(configurations[0])}.",
        where="excitation",
        remedy="begin farther from floor and shapes, or raise the shares of the limits",
    )


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
    return Excitation(
        reference=reference,
        kind=options.inject,
        excited_lines=lines,
        detection_lines=np.zeros(0, int),
        sampling_period_s=sampling_period_s,
        spectrum=spectrum,
        rms=np.sqrt(np.mean(reference**2, axis=(0, 1, 2))),
        crest_factor=crest_factor(reference),
    )
