"""A robot that carries its weight, as a robot file has it or as a fit found it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.robot.description import Robot
from robid.robot.linearize import solve_statics
from robid.robot.model import build_model


@dataclass(frozen=True)
class Carrier:
    """A robot, and what its torques are recorded as.

    Attributes:
        robot: The robot, with its campaign's payload.
        torque_factor (n_joint,): Recorded over true torques.
    """

    robot: Robot
    torque_factor: FloatArray

    def holds(self, configurations: FloatArray, motors: IntArray) -> FloatArray:
        """Returns true torques (n_conf, n_motor) with which motors hold configurations (n_conf, n_joint) [N m]."""
        model = build_model(self.robot, balanced=True)
        return np.asarray(solve_statics(model, configurations).motor_torque[:, motors])


@dataclass(frozen=True)
class Fitted:
    """What a fit found, and how far it may be off.

    Attributes:
        found: The robot as the fit has it.
        off: The robot off by a share of a standard deviation along each independent direction.
        share: That share.
    """

    found: Carrier
    off: tuple[Carrier, ...]
    share: float

    def scatter(self, configurations: FloatArray, motors: IntArray) -> FloatArray:
        """Returns the covariance (n_motor, n_conf, n_conf) of true torques that this leaves open [N^2 m^2]."""
        factor = self.found.torque_factor[motors]
        own = self.found.holds(configurations, motors)
        total = np.zeros((len(motors), len(configurations), len(configurations)))
        for other in self.off:
            changed = other.holds(configurations, motors) * other.torque_factor[motors] / factor
            column = (changed - own) / self.share
            total += np.einsum("cm,dm->mcd", column, column)
        return total
