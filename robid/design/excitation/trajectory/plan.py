"""The plan of a trajectory: what it does to the rigid robot where the controller follows it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.design.excitation.excitation import ExcitationPlan
from robid.design.excitation.options import TrajectoryOptions
from robid.design.excitation.prediction import admissible_scale
from robid.design.excitation.trajectory.problem import TrajectoryProblem
from robid.signals.waveforms import crest_factor


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


def trajectory_plan(
    problem: TrajectoryProblem,
    options: TrajectoryOptions,
    found: Sequence[Trajectory],
    n_sample: int,
    duration_s: float,
) -> ExcitationPlan:
    """Returns what trajectories use of the whole limits; excursions are those to the side that comes nearest its end.

    Args:
        problem: What was optimised.
        options: Shares of the limits.
        found: The trajectory of each realization.
        n_sample: Samples of a period.
        duration_s: Time that the campaign takes [s].
    """
    motions = np.array([problem.series.grid(n_sample) @ each.coefficients for each in found])
    torque = np.array([problem.base.torques(problem.configurations, motion) for motion in motions])
    still = problem.base.torques(problem.configurations, np.zeros((3, 1, motions.shape[-1])))[:, 0]
    speed, limits = motions[:, 1] @ problem.robot.motor_per_arm.T, problem.limits
    way, room = _nearer_side(motions[:, 0], limits.below, limits.above)
    least, most, rms = np.stack([_reached(speed, still), _reached(torque, still), _reached(way, still)], axis=1)
    peak = np.array([np.maximum(most[0], -least[0]), np.maximum(most[1], -least[1]), most[2]])
    whole = np.array([limits.speed / options.speed_share, limits.torque / options.torque_share, room])
    whole[2] /= options.position_share
    least[2] = -most[2]
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
        speed_crest=np.broadcast_to(crest_factor(speed).max(axis=0), still.shape).copy(),
        duration_s=duration_s,
        condition=np.array([each.condition for each in found]),
    )


def _reached(signal: FloatArray, like: FloatArray) -> FloatArray:
    """Least, greatest and RMS value (3, n_conf, n) of (n_real, n_sample, n) or (n_real, n_conf, n_sample, n)."""
    time = (0, signal.ndim - 2)
    values = np.array([signal.min(axis=time), signal.max(axis=time), np.sqrt(np.mean(signal**2, axis=time))])
    return np.broadcast_to(values.reshape(3, -1, like.shape[1]), (3, *like.shape)).copy()


def _nearer_side(way: FloatArray, below: FloatArray, above: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Way (n_real, n_sample, n_joint) towards the side where it uses most of the room, and that room (n_joint,)."""
    upward = (way / above).max(axis=(0, 1)) >= (-way / below).max(axis=(0, 1))
    return np.where(upward, way, -way), np.where(upward, above, below)
