"""Which errors of its torques a rigid model is to be expected to make on other motions of the robot."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray
from robid.models.rigid.fit.sizes import RatedTorques
from robid.models.rigid.fit.solution import Travel
from robid.results.estimate import Estimate
from robid.robot.description import Robot
from robid.robot.regressor.model import RigidModel

_MOTIONS, _MOMENTS, _DRAWS = 24, 40, 200
_HARMONICS = 4
_SHARE_OF_RANGE = (0.3, 0.9)
_SHARE_OF_LIMIT = 0.5  # of a motor's highest speed
_LEVEL = 0.95
_SEED = 0
_FASTEST_HZ = 0.5  # of the fundamental


def expected_error(
    robot: Robot,
    model: RigidModel,
    estimate: Estimate,
    travel: Travel,
    residual: FloatArray,
    rated: RatedTorques,
) -> tuple[FloatArray, FloatArray]:
    """Expected errors (n_joint,) on other motions and their 95 % bounds, each over the motor's size.

    Parameters are drawn from their covariance and predict torques along random motions of the robot; what the fit left
    of its own torques is added, as no model of this kind explains it.

    Args:
        robot: The robot.
        model: The model with the estimated parameters.
        estimate: What the fit found.
        travel: Where the arm was.
        residual (n_joint,): Root mean square of what the fit left of each motor's torque [N m, or N].
        rated: Rated torques.

    Source:
        Ljung (1999), sec. 9.4: `cov(tau) = W cov(x) W'`; docs/methods, sec. 7.
    """
    generator = np.random.default_rng(_SEED)
    paths = [random_motion(robot, travel, generator) for _ in range(_MOTIONS)]
    joined = [np.concatenate(parts) for parts in zip(*paths, strict=True)]
    columns = _columns(model, estimate.value, joined[0], joined[1], joined[2])
    columns = columns.reshape(_MOTIONS, _MOMENTS, *columns.shape[1:])
    torque = columns @ estimate.value
    size = rated.size(np.sqrt((torque**2).mean(axis=1)))
    # Errors of the parameters: normal with their covariance, wider by Student's degrees of freedom.
    variance, axes = np.linalg.eigh(estimate.covariance)
    root = axes * np.sqrt(np.maximum(variance, 0.0))
    drawn = root @ generator.standard_normal((len(root), _DRAWS))
    freedom = float(np.min(estimate.degrees_of_freedom))
    if np.isfinite(freedom):
        drawn *= np.sqrt(freedom / generator.chisquare(freedom, _DRAWS))
    error = np.sqrt(((columns @ drawn) ** 2).mean(axis=1) + residual[:, None] ** 2) / size[..., None]
    whole = error.transpose(1, 0, 2).reshape(error.shape[1], -1)
    return np.sqrt((whole**2).mean(axis=1)), np.quantile(whole, _LEVEL, axis=1)


def random_motion(
    robot: Robot, travel: Travel, generator: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Positions, speeds and accelerations (n_moment, n_joint) of the motors along a random motion within the limits.

    A sum of harmonics, each joint over a part of its range, as fast as half the speed limit allows, or, where none is
    known, as the fastest joint of the record was.
    """
    lower, upper = _range(robot, travel)
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


def _range(robot: Robot, travel: Travel) -> tuple[FloatArray, FloatArray]:
    """Ends (n_joint,) of where the arm may be; a turn about, or what the record covered, where nobody says."""
    turns = np.array([joint.type == "revolute" for joint in robot.joints])
    middle = (travel.lowest + travel.highest) / 2
    lower = np.where(turns, middle - np.pi, travel.lowest)
    upper = np.where(turns, middle + np.pi, travel.highest)
    known = np.isfinite(robot.lower) & np.isfinite(robot.upper)
    return np.where(known, robot.lower, lower), np.where(known, robot.upper, upper)


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
