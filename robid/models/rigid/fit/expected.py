"""Which errors of its torques a rigid model is to be expected to make on other motions of the robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.models.rigid.fit.solution import Travel
from robid.robot.description import Robot
from robid.robot.regressor.model import RigidModel

_MOTIONS, _MOMENTS, _DRAWS = 24, 40, 200
_HARMONICS = 4
_BEYOND = (0.0, 0.3)  # of what lies between the record's range and the limits, that a motion may go beyond the record
_SHARE_OF_RANGE = (0.4, 0.9)  # of all that, which a motion covers
_SHARE_OF_LIMIT = 0.5  # of a motor's highest speed
_LEVEL = 0.95
_SEED = 0
_FASTEST_HZ = 0.5  # of the fundamental


@dataclass(frozen=True)
class Known:
    """Estimated parameters, and how well their torques are known along any motion."""

    value: FloatArray  # (n_base,)
    covariance: FloatArray  # (n_base, n_base): may be of lower rank; variances of sums count, as errors cancel in them
    freedom: float  # degrees of freedom of its variances


def expected_error(
    robot: Robot, model: RigidModel, known: Known, travel: Travel, own: FloatArray, size: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Mean errors (n_joint,) on other motions and their 95 % bounds, over what a motor's error is related to.

    Parameters are drawn from their covariance and predict torques along random motions of the robot. What they leave
    of torques that they never saw, along the fit's own motion, is added: it is nothing that the covariance knows of.

    Args:
        robot: The robot.
        model: The model with the estimated parameters.
        known: Their values, and how well torques know them.
        travel: Where the arm was.
        own (n_joint,): Root mean square of the torques' errors on left-out pieces of the fit's own log [N m, or N].
        size (n_joint,): What a motor's error is related to [N m, or N].

    Source:
        Ljung (1999), sec. 9.4: `cov(tau) = W cov(x) W'`; docs/methods, sec. 7.
    """
    generator = np.random.default_rng(_SEED)
    paths = [random_motion(robot, travel, generator) for _ in range(_MOTIONS)]
    position, velocity, acceleration = (np.concatenate(parts) for parts in zip(*paths, strict=True))
    columns = _columns(model, known.value, position, velocity, acceleration)
    columns = columns.reshape(_MOTIONS, _MOMENTS, *columns.shape[1:])
    # Errors of the parameters: normal with their covariance, wider by Student's degrees of freedom.
    variance, axes = np.linalg.eigh(known.covariance)
    root = axes * np.sqrt(np.maximum(variance, 0.0))
    drawn = root @ generator.standard_normal((len(root), _DRAWS))
    if np.isfinite(known.freedom):
        drawn *= np.sqrt(known.freedom / generator.chisquare(known.freedom, _DRAWS))
    error = np.sqrt(((columns @ drawn) ** 2).mean(axis=1) + own[:, None] ** 2) / size[:, None]
    whole = error.transpose(1, 0, 2).reshape(error.shape[1], -1)
    return whole.mean(axis=1), np.quantile(whole, _LEVEL, axis=1)


def random_motion(
    robot: Robot, travel: Travel, generator: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Positions, speeds and accelerations (n_moment, n_joint) of the motors along a random motion within the limits.

    A sum of harmonics about where the record was and beyond, as fast as half the speed limit allows, or, where none is
    known, as the fastest joint of the record was.
    """
    lower, upper = _range(robot, travel, generator.uniform(*_BEYOND))
    share = generator.uniform(*_SHARE_OF_RANGE, len(lower))
    centre = lower + (upper - lower) * (share / 2 + (1 - share) * generator.uniform(size=len(lower)))
    order = np.arange(1, _HARMONICS + 1)[:, None, None]
    weight = generator.uniform(0.3, 1, (_HARMONICS, 1, len(lower))) / order
    phase = generator.uniform(0, 2 * np.pi, (_HARMONICS, 1, len(lower)))
    angle = order * np.linspace(0, 2 * np.pi, _MOMENTS, endpoint=False)[:, None] + phase
    waves = np.stack(
        [
            (weight * np.sin(angle)).sum(axis=0),
            (weight * order * np.cos(angle)).sum(axis=0),
            (-weight * order**2 * np.sin(angle)).sum(axis=0),
        ]
    )
    waves *= share * (upper - lower) / 2 / np.abs(waves[0]).max(axis=0)
    rate = _speeds(robot, travel) / np.maximum(np.abs(waves[1]).max(axis=0), 1e-12)
    rate = np.minimum(rate, 2 * np.pi * _FASTEST_HZ)
    turns = robot.motor_per_arm.T
    return (waves[0] + centre) @ turns, rate * waves[1] @ turns, rate**2 * waves[2] @ turns


def _range(robot: Robot, travel: Travel, beyond: float) -> tuple[FloatArray, FloatArray]:
    """Ends (n_joint,) of a motion: the record's, and beyond them a share of what is left to the joints' limits.

    Where nobody states limits, a joint may turn by half a turn either way, and slides as in the record.
    """
    turns = np.array([joint.type == "revolute" for joint in robot.joints])
    middle, known = (travel.lowest + travel.highest) / 2, np.isfinite(robot.lower) & np.isfinite(robot.upper)
    lower = np.where(known, robot.lower, np.where(turns, middle - np.pi, travel.lowest))
    upper = np.where(known, robot.upper, np.where(turns, middle + np.pi, travel.highest))
    lower, upper = np.minimum(lower, travel.lowest), np.maximum(upper, travel.highest)
    return travel.lowest + beyond * (lower - travel.lowest), travel.highest + beyond * (upper - travel.highest)


def _speeds(robot: Robot, travel: Travel) -> FloatArray:
    """Highest arm speeds (n_joint,) of a random motion [rad/s, or m/s]."""
    limit = np.array([joint.motor.max_speed_rad_s for joint in robot.joints]) / np.abs(robot.gear_ratio)
    fastest = travel.fastest
    slides = np.array([joint.type != "revolute" for joint in robot.joints])
    usual = np.where(slides, fastest, np.max(np.where(slides, 0.0, fastest)))
    return np.where(np.isfinite(limit), np.maximum(_SHARE_OF_LIMIT * limit, fastest), usual)


def _columns(
    model: RigidModel, values: FloatArray, position: FloatArray, velocity: FloatArray, acceleration: FloatArray
) -> FloatArray:
    """Columns (n_moment, n_joint, n_param) along a path; friction that grows with the torque sees the model's own."""
    torque = None
    if model.needs_torque:
        torque = model.columns(position, velocity, acceleration, torque=np.zeros_like(position)) @ values
    return model.columns(position, velocity, acceleration, torque=torque)
