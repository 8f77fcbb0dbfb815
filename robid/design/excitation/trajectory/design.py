"""An exciting trajectory as an excitation, with the plan of what it will do."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from robid.arrays import ComplexArray, FloatArray
from robid.design.excitation.excitation import Excitation, ExcitationPlan
from robid.design.excitation.lines import samples_per_period
from robid.design.excitation.options import TrajectoryOptions
from robid.design.excitation.prediction import admissible_scale
from robid.design.excitation.signal_lines import check_signal
from robid.design.excitation.trajectory.criterion import BaseModel, Criterion
from robid.design.excitation.trajectory.limits import trajectory_limits
from robid.design.excitation.trajectory.problem import TrajectoryProblem
from robid.design.excitation.trajectory.search import descend, largest_factor, random_trajectory
from robid.design.excitation.trajectory.series import resting_series
from robid.robot.reach import Reach
from robid.signals.multisine import crest_factor, time_signal

_JUDGED_PER_HARMONIC = 20
"""Samples of a period, for each harmonic, at which criterion and limits are looked at in the search."""

_REACH_SAMPLES = 200
_SIZING_DRAWS = 20


@dataclass(frozen=True)
class Trajectory:
    """One optimised trajectory.

    Attributes:
        coefficients (n_shape, n_joint): Coefficients of its shapes, arm side [rad, or m].
        value: Its criterion.
        condition: Condition number of its regressor, each column over its size in random motions.
    """

    coefficients: FloatArray
    value: float
    condition: float


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


def find_trajectory(
    problem: TrajectoryProblem, options: TrajectoryOptions, realization: int, n_sample: int, reach: Reach
) -> Trajectory:
    """Finds the best trajectory of several descents, each made small enough to be played.

    Args:
        problem: What is optimised.
        options: Starts, evaluations and seed.
        realization: Its index, which makes its starts random anew.
        n_sample: Samples of a period when it is played, at which its limits hold.
        reach: What keeps the robot from a configuration.
    """
    found = []
    for index in range(options.starts):
        start = random_trajectory(problem, np.random.default_rng([options.seed, 1, realization, index]))
        end = descend(problem, start, options.evaluations)
        end = end * _playable_factor(problem, end, n_sample, reach)
        regressor = problem.regressor(end)
        found.append(Trajectory(end, problem.criterion.value(regressor), problem.criterion.condition(regressor)))
    return min(found, key=lambda each: each.value)


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

    Raises:
        SettingsError: With everything that keeps the robot from moving.
    """
    check_signal(options, sampling_period_s)
    n_sample = samples_per_period(options.period_s, sampling_period_s)
    # The matrices are small: on a busy machine BLAS threads would only wait for each other.
    with threadpool_limits(1, user_api="blas"):
        problem = trajectory_problem(base, configurations, options, reach.floor_m)
        found = [find_trajectory(problem, options, index, n_sample, reach) for index in range(realizations)]
    excitation = _excitation(problem, options, found, sampling_period_s, n_sample)
    duration_s = realizations * len(configurations) * (periods + transient_periods) * options.period_s
    return replace(excitation, plan=_plan(problem, options, found, n_sample, duration_s))


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


def _plan(
    problem: TrajectoryProblem,
    options: TrajectoryOptions,
    found: list[Trajectory],
    n_sample: int,
    duration_s: float,
) -> ExcitationPlan:
    """What the trajectories do to the rigid robot where the controller follows them."""
    robot, limits = problem.robot, problem.limits
    motions = np.array([problem.series.grid(n_sample) @ each.coefficients for each in found])
    torque = np.array([problem.base.torques(problem.configurations, motion) for motion in motions])
    still = problem.base.torques(problem.configurations, np.zeros((3, 1, len(robot.joints))))[:, 0]
    way, speed = motions[:, 0], motions[:, 1] @ robot.motor_per_arm.T
    upward = (way / limits.above).max(axis=(0, 1)) >= (-way / limits.below).max(axis=(0, 1))
    side = np.where(upward, 1.0, -1.0)
    n_conf = len(still)
    peak = np.array(
        [
            np.tile(np.abs(speed).max(axis=(0, 1)), (n_conf, 1)),
            np.abs(torque).max(axis=(0, 2)),
            np.tile((side * way).max(axis=(0, 1)), (n_conf, 1)),
        ]
    )
    rms = np.array(
        [
            np.tile(np.sqrt(np.mean(speed**2, axis=(0, 1))), (n_conf, 1)),
            np.sqrt(np.mean(torque**2, axis=(0, 2))),
            np.tile(np.sqrt(np.mean(way**2, axis=(0, 1))), (n_conf, 1)),
        ]
    )
    whole = np.array(
        [
            limits.speed / options.speed_share,
            limits.torque / options.torque_share,
            np.where(upward, limits.above, limits.below) / options.position_share,
        ]
    )
    least, most = -peak, peak.copy()
    least[1], most[1] = torque.min(axis=(0, 2)), torque.max(axis=(0, 2))
    return ExcitationPlan(
        speed_rms=rms[0],
        speed_peak=peak[0],
        torque_rms=rms[1],
        torque_peak=peak[1],
        excursion_rms=rms[2],
        excursion_peak=peak[2],
        speed_limit=whole[0],
        torque_limit=whole[1],
        excursion_limit=whole[2],
        admissible_scale=admissible_scale(least, most, whole, still).min(axis=0),
        speed_crest=np.tile(crest_factor(speed).max(axis=0), (n_conf, 1)),
        duration_s=duration_s,
        condition=np.array([each.condition for each in found]),
    )
