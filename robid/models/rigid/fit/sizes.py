"""What errors of a motor's torque are related to: what it gives, or a tenth of what it is rated for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.robot.description import Robot

LEAST_SHARE = 0.1
"""Share of its rated torque below which nobody asks for less error of a motor that hardly gives any."""

_SAME_SIZE = 1.5  # largest ratio of torque limits, or of rotor inertias, of motors of one size


@dataclass(frozen=True)
class RatedTorques:
    """Rated torques of a robot's motors."""

    torque_nm: FloatArray  # (n_joint,): rated torque [N m, or N]
    stated: BoolArray  # (n_joint,): whether the robot file states it

    def size(self, rms: FloatArray) -> FloatArray:
        """Returns what errors of torques of this root mean square (..., n_joint) are related to [N m, or N]."""
        return np.asarray(np.maximum(rms, LEAST_SHARE * self.torque_nm))


def rated_torques(robot: Robot, rms: FloatArray) -> RatedTorques:
    """Returns rated torques: those of the robot file, else the largest RMS torque of a motor of that size.

    Motors are of one size whose torque limits, or rotor inertias where limits are unknown, are within a factor of 1.5;
    a joint without a motor has no equal.

    Args:
        robot: The robot.
        rms (n_joint,): Root mean square of each motor's torque in the records [N m, or N].
    """
    motors = [joint.motor for joint in robot.joints]
    rated = np.array([np.nan if motor.rated_torque_nm is None else motor.rated_torque_nm for motor in motors])
    limit = np.array([motor.max_torque_nm for motor in motors])
    measure = limit if np.isfinite(limit).all() else np.array([motor.inertia_kgm2 for motor in motors])
    known = robot.has_motors & (measure > 0)
    away = np.abs(np.log(np.where(known, measure, 1.0))[:, None] - np.log(np.where(known, measure, 1.0)))
    alike = (away <= np.log(_SAME_SIZE)) & known & known[:, None] | np.eye(len(motors), dtype=bool)
    largest = np.max(np.where(alike, rms, 0.0), axis=1)
    return RatedTorques(np.where(np.isnan(rated), largest, rated), np.isfinite(rated))
