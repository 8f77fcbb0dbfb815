"""What a regressor tells about base parameters, and how each of its elements changes that."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.robot.regressor.model import RigidModel

_RIDGE = 1e-14
_STEP = 1e-6


@dataclass(frozen=True)
class BaseModel:
    """A rigid model whose columns are independent.

    Attributes:
        model: The model, with the columns of base parameters only.
        values (n_base,): Nominal base parameters.
        judged (n_base,): Which of them the criterion is about.
    """

    model: RigidModel
    values: FloatArray
    judged: BoolArray

    def torques(self, configurations: FloatArray, motion: FloatArray) -> FloatArray:
        """Motor torques (n_conf, n_time, n_motor) of a motion (3, n_time, n_joint) about configurations [N m]."""
        to_motor = self.model.robot.motor_per_arm.T
        way, speed, acceleration = motion
        found = [
            self.model.torques(self.values, (row + way) @ to_motor, speed @ to_motor, acceleration @ to_motor)
            for row in configurations
        ]
        return np.array(found)

    def columns(self, configurations: FloatArray, motion: FloatArray) -> FloatArray:
        """Regressor (n_conf, n_time, n_motor, n_base) of such a motion."""
        return self._columns(_about(configurations, motion), motion[1])

    def slopes(self, configurations: FloatArray, motion: FloatArray, columns: FloatArray) -> FloatArray:
        """How the columns change with what each joint does.

        Args:
            configurations (n_conf, n_joint): Arm-side joint positions [rad, or m].
            motion (3, n_time, n_joint): Way from these, speed and acceleration on the arm side.
            columns (n_conf, n_time, n_motor, n_base): What `columns` gives.

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
    """What a regressor is worth; smaller is better.

    Attributes:
        kind: `d_optimal` or `condition`.
        row_weight (n_motor,): Weight of each motor's rows, one over the size of its noise.
        column_size (n_column,): Size of each weighted column in random motions.
    """

    kind: str
    row_weight: FloatArray
    column_size: FloatArray

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
            value, slope = -float(np.log(values).mean()), -(vectors / values) @ vectors.T / len(values)
        else:
            value = 0.5 * float(np.log(values[-1] / values[0]))
            ends = vectors[:, [-1, 0]]
            slope = 0.5 * (ends * [1 / values[-1], -1 / values[0]]) @ ends.T
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
