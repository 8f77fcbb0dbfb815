"""What is optimised: a trajectory's worth and its use of the limits, with derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.design.excitation.trajectory.criterion import BaseModel, Criterion
from robid.design.excitation.trajectory.limits import Limits
from robid.design.excitation.trajectory.series import RestingSeries
from robid.robot.description import Robot
from robid.robot.reach import TOUCH_M, heights

_STILL = 1e-9


@dataclass(frozen=True)
class TrajectoryProblem:
    """What is optimised: coefficients (n_shape, n_joint) of the way from the configurations.

    Attributes:
        base: The rigid model.
        criterion: What its regressor is worth.
        configurations (n_conf, n_joint): Arm-side joint positions that the motion begins in [rad, or m].
        series: The shapes of the series.
        waves (3, n_time, n_shape): Their values and derivatives at the samples that are judged.
        limits: What the motion may use.
        floor_m: Height that no point may go below; None for none [m].
    """

    base: BaseModel
    criterion: Criterion
    configurations: FloatArray
    series: RestingSeries
    waves: FloatArray
    limits: Limits
    floor_m: float | None

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.base.model.robot

    @property
    def scale(self) -> FloatArray:
        """Natural size (n_joint,) of the coefficients [rad, or m]."""
        return np.asarray(np.maximum(self.limits.below, self.limits.above))

    def regressor(self, coefficients: FloatArray) -> FloatArray:
        """Judged columns (n_conf, n_time, n_motor, n_judged) of coefficients (n_shape, n_joint)."""
        columns = self.base.columns(self.configurations, self.waves @ coefficients)
        return columns[..., self.base.judged]

    def is_within(self, coefficients: FloatArray) -> bool:
        """Whether coefficients (n_shape, n_joint) keep to limits and floor at the samples that are judged."""
        motion = self.waves @ coefficients
        torque = self.base.torques(self.configurations, motion)
        within = self.limits.used(self.robot, motion, torque).max() <= 1
        return bool(within) and (self.floor_m is None or self._height(motion[0])[0].min() >= self.floor_m - TOUCH_M)

    def _height(self, way: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Heights (n_conf, n_time, n_point) and slopes (n_conf, n_time, n_point, n_joint)."""
        visited = self.configurations[:, None] + way
        found, slopes = heights(self.robot, visited.reshape(-1, way.shape[1]))
        return found.reshape(*visited.shape[:2], -1), slopes.reshape(*visited.shape[:2], -1, way.shape[1])

    def evaluate(self, point: FloatArray, sharpness: float) -> Evaluation:
        """Evaluates coefficients over `scale`.

        Args:
            point (n_variable,): The coefficients, flat.
            sharpness: Of the smooth maximum over samples, which is above the largest of n values by at most `log(n)`
                over this.
        """
        coefficients = point.reshape(self.series.count, -1) * self.scale
        motion = self.waves @ coefficients
        columns = self.base.columns(self.configurations, motion)
        slopes = self.base.slopes(self.configurations, motion, columns)
        value, by_element = self.criterion.with_slopes(columns[..., self.base.judged])
        by_motion = np.einsum("kicnmp,cnmp->kni", slopes[..., self.base.judged], by_element, optimize=True)
        found = [*self._kinematic(motion, sharpness), self._torques(columns, slopes, sharpness)]
        if self.floor_m is not None:
            found.append(self._floor(motion[0], self.floor_m, sharpness))
        used, use_slopes = np.concatenate([use for use, _ in found]), np.concatenate([slope for _, slope in found])
        return Evaluation(value, self._chained(by_motion[None])[0], used, self._chained(use_slopes))

    def _chained(self, by_motion: FloatArray) -> FloatArray:
        """From slopes (n, 3, n_time, n_joint) by motion to slopes (n, n_variable) by the point."""
        chained = np.einsum("akni,kns->asi", by_motion, self.waves, optimize=True) * self.scale
        return np.asarray(chained.reshape(len(by_motion), -1))

    def _kinematic(self, motion: FloatArray, sharpness: float) -> list[tuple[FloatArray, FloatArray]]:
        """Smooth use of the limits of position, speed and acceleration, with slopes (n, 3, n_time, n_joint)."""
        way, speed, acceleration = motion
        limits, to_motor, own = self.limits, self.robot.motor_per_arm, np.eye(way.shape[1])
        quantities = [
            (0, way, own, limits.above, limits.below),
            (1, speed @ to_motor.T, to_motor, limits.speed, limits.speed),
        ]
        if np.isfinite(limits.acceleration).any():
            quantities.append((2, acceleration, own, limits.acceleration, limits.acceleration))
        found = []
        for kind, signal, matrix, above, below in quantities:
            use, weight = _smooth_use(signal, above, below, sharpness)
            slopes = np.zeros((len(use), *motion.shape))
            slopes[:, kind] = weight.T[:, :, None] * matrix[:, None]
            found.append((use, slopes))
        return found

    def _torques(self, columns: FloatArray, slopes: FloatArray, sharpness: float) -> tuple[FloatArray, FloatArray]:
        torque = columns @ self.base.values
        flat = torque.reshape(-1, torque.shape[-1])
        use, weight = _smooth_use(flat, self.limits.torque, self.limits.torque, sharpness)
        by_motion = slopes @ self.base.values
        return use, np.einsum("cnm,kicnm->mkni", weight.reshape(torque.shape), by_motion, optimize=True)

    def _floor(self, way: FloatArray, floor_m: float, sharpness: float) -> tuple[FloatArray, FloatArray]:
        height, by_way = self._height(way)
        moves = np.abs(by_way).max(axis=(0, 1, 3)) > _STILL
        height, by_way = height[..., moves], by_way[..., moves, :]
        use, weight = _smooth_maximum(1 + floor_m - height.reshape(-1, 1), sharpness)
        slopes = np.zeros((1, 3, *way.shape))
        slopes[0, 0] = -np.einsum("cnp,cnpi->ni", weight.reshape(height.shape), by_way)
        return use, slopes


@dataclass(frozen=True)
class Evaluation:
    """What a point is worth and uses.

    Attributes:
        value: The criterion.
        slope (n_variable,): Its slope.
        used (n_limit,): Share of each limit, by a smooth maximum over all samples; 1 is all of it.
        used_slope (n_limit, n_variable): Its slope.
    """

    value: float
    slope: FloatArray
    used: FloatArray
    used_slope: FloatArray


def _smooth_use(
    signal: FloatArray, above: FloatArray, below: FloatArray, sharpness: float
) -> tuple[FloatArray, FloatArray]:
    """Smooth largest use (n,) of limits on either side by a signal (n_time, n), and its slope (n_time, n)."""
    use, weight = _smooth_maximum(np.concatenate([signal / above, -signal / below]), sharpness)
    up, down = np.split(weight, 2)
    return use, up / above - down / below


def _smooth_maximum(values: FloatArray, sharpness: float) -> tuple[FloatArray, FloatArray]:
    """Smooth maximum (n,) over the first axis of (n_value, n), and its slope (n_value, n)."""
    top = values.max(axis=0)
    part = np.exp(sharpness * (values - top))
    total = part.sum(axis=0)
    return np.asarray(top + np.log(total) / sharpness), np.asarray(part / total)
