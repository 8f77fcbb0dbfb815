"""What is optimised: what a trajectory's regressor tells of base parameters, and its use of the limits, with slopes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.design.excitation.trajectory.limits import Limits, RestingSeries
from robid.robot.description import Robot
from robid.robot.reach import TOUCH_M, heights
from robid.robot.regressor.model import RigidModel

_RIDGE = 1e-14
_STEP = 1e-6


@dataclass(frozen=True)
class BaseModel:
    """A rigid model whose columns are independent."""

    model: RigidModel  # The model, with the columns of base parameters only
    values: FloatArray  # (n_base,) Nominal base parameters
    judged: BoolArray  # (n_base,) Which of them the criterion is about

    def torques(self, configurations: FloatArray, motion: FloatArray) -> FloatArray:
        """Motor torques (n_conf, n_time, n_motor) of a motion (3, n_time, n_joint) about configurations [N m]."""
        to_motor = self.model.robot.motor_per_arm.T
        way, speed, acceleration = motion
        rates = speed @ to_motor, acceleration @ to_motor
        return np.array([self.model.torques(self.values, (row + way) @ to_motor, *rates) for row in configurations])

    def columns(self, configurations: FloatArray, motion: FloatArray) -> FloatArray:
        """Regressor (n_conf, n_time, n_motor, n_base) of such a motion."""
        return self._columns(_about(configurations, motion), motion[1])

    def slopes(self, configurations: FloatArray, motion: FloatArray, columns: FloatArray) -> FloatArray:
        """How the columns (n_conf, n_time, n_motor, n_base) that `columns` gives change with what each joint does.

        Returns:
            Slopes (3, n_joint, n_conf, n_time, n_motor, n_base) by position, speed and acceleration of each joint.
            Senses of friction stay as they are: the columns jump where they change.
        """
        states = _about(configurations, motion)
        found = np.empty((3, motion.shape[2], *columns.shape))
        for kind in range(3):
            for joint in range(motion.shape[2]):
                moved = states.copy()
                moved[kind, ..., joint] += _STEP
                # Forward differences: columns are cheap to evaluate, and polynomial in speeds and accelerations.
                found[kind, joint] = (self._columns(moved, motion[1]) - columns) / _STEP
        return found

    def _columns(self, states: FloatArray, senses: FloatArray) -> FloatArray:
        """Regressor of states (3, n_conf, n_time, n_joint), friction with the sign of speeds (n_time, n_joint)."""
        _, n_conf, n_time, n_joint = states.shape
        to_motor = self.model.robot.motor_per_arm.T
        position, speed, acceleration = states.reshape(3, -1, n_joint) @ to_motor
        friction_speed = np.tile(senses @ to_motor, (n_conf, 1))
        columns = self.model.columns(position, speed, acceleration, friction_speed=friction_speed)
        return columns.reshape(n_conf, n_time, n_joint, -1)


@dataclass(frozen=True)
class Criterion:
    """What a regressor is worth; smaller is better."""

    kind: str  # `d_optimal` or `condition`
    row_weight: FloatArray  # (n_motor,) Weight of each motor's rows, one over the size of its noise
    column_size: FloatArray  # (n_column,) Size of each weighted column in random motions

    def rows(self, columns: FloatArray) -> FloatArray:
        """Weighted rows (n_row, n_column) of a regressor (..., n_motor, n_column), each column over its size."""
        scaled = columns * self.row_weight[:, None] / self.column_size
        return np.asarray(scaled.reshape(-1, columns.shape[-1]))

    def value(self, columns: FloatArray) -> float:
        """Value of a regressor (..., n_motor, n_column)."""
        return self.with_slopes(columns)[0]

    def with_slopes(self, columns: FloatArray) -> tuple[float, FloatArray]:
        """Value of a regressor (..., n_motor, n_column), and its slope by each element.

        `d_optimal` is minus the logarithm of the information's determinant per parameter, `condition` the logarithm
        of the regressor's condition number.

        Source:
            Swevers et al. (1997), Optimal robot excitation and identification.
        """
        rows = self.rows(columns)
        information = rows.T @ rows / len(rows)
        values, vectors = np.linalg.eigh(information)
        values = np.maximum(values, _RIDGE * values[-1])
        if self.kind == "d_optimal":
            # d log det A = tr(A^-1 dA).
            value, slope = -float(np.log(values).mean()), -(vectors / values) @ vectors.T / len(values)
        else:
            value = 0.5 * float(np.log(values[-1] / values[0]))
            # d lambda = v' dA v for the largest and the smallest eigenvalue; half, as A = W'W.
            ends = vectors[:, [-1, 0]]
            slope = 0.5 * (ends * [1 / values[-1], -1 / values[0]]) @ ends.T
        # dA = (dW' W + W' dW) / n.
        by_row = (2 / len(rows)) * (rows @ slope)
        return value, by_row.reshape(columns.shape) * self.row_weight[:, None] / self.column_size

    def condition(self, columns: FloatArray) -> float:
        """Condition number of a weighted regressor (..., n_motor, n_column), each column over its size."""
        return float(np.linalg.cond(self.rows(columns)))


def _about(configurations: FloatArray, motion: FloatArray) -> FloatArray:
    """Positions, speeds and accelerations (3, n_conf, n_time, n_joint)."""
    states = np.repeat(motion[:, None], len(configurations), axis=1)
    states[0] += configurations[:, None]
    return states


_STILL = 1e-9


@dataclass(frozen=True)
class TrajectoryProblem:
    """What is optimised: coefficients (n_shape, n_joint) of the way from the configurations."""

    base: BaseModel
    criterion: Criterion
    configurations: FloatArray  # (n_conf, n_joint) Arm-side joint positions that the motion begins in [rad, or m]
    series: RestingSeries
    waves: FloatArray  # (3, n_time, n_shape) Their values and derivatives at the samples that are judged
    limits: Limits
    floor_m: float | None  # Height that no point may go below; None for none [m]

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
        """Evaluates coefficients over `scale`, a flat point (n_variable,).

        The smooth maximum over samples is above the largest of n values by at most `log(n)` over its sharpness.
        """
        coefficients = point.reshape(self.series.count, -1) * self.scale
        motion = self.waves @ coefficients
        columns = self.base.columns(self.configurations, motion)
        slopes = self.base.slopes(self.configurations, motion, columns)
        value, by_element = self.criterion.with_slopes(columns[..., self.base.judged])
        # Chain rule: elements of the regressor by position, speed and acceleration, then these by coefficients.
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
        # A height h above the floor f keeps 1 + f - h below one.
        use, weight = _smooth_maximum(1 + floor_m - height.reshape(-1, 1), sharpness)
        slopes = np.zeros((1, 3, *way.shape))
        slopes[0, 0] = -np.einsum("cnp,cnpi->ni", weight.reshape(height.shape), by_way)
        return use, slopes


@dataclass(frozen=True)
class Evaluation:
    """What a point is worth and uses."""

    value: float
    slope: FloatArray  # (n_variable,) Its slope
    used: FloatArray  # (n_limit,) Share of each limit, by a smooth maximum over all samples; 1 is all of it
    used_slope: FloatArray  # (n_limit, n_variable) Its slope


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
    # Kreisselmeier and Steinhauser: log-sum-exp, shifted by the maximum against overflow.
    part = np.exp(sharpness * (values - top))
    total = part.sum(axis=0)
    return np.asarray(top + np.log(total) / sharpness), np.asarray(part / total)
