"""Doubts of what moves the joints: torque constants."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray
from robid.fit.elastic.doubts.column import DoubtColumn
from robid.fit.elastic.doubts.scene import Scene
from robid.robot.description import Robot

_OF_PLACE = 0.25  # of a torque constant's deviation: what temperature does between places
_PERCENT = 100.0


@dataclass(frozen=True)
class TorqueScale:
    """A measured torque that is too large by some percent: its column of the response is too small.

    Attributes:
        joint: Index of the motor.
    """

    joint: int

    def column(self, scene: Scene) -> ComplexArray:
        """Derivative (n_conf, n_freq, n_out, n_in) of the log response by the amount."""
        found = np.zeros(scene.problem.frf.response.shape, complex)
        found[..., self.joint] = -1 / _PERCENT
        return found


def torque_doubts(robot: Robot) -> Iterator[DoubtColumn]:
    """Yields the doubts of the motors' torque constants."""
    for index, joint in enumerate(robot.joints):
        std = _PERCENT * joint.doubts.torque_relative_std
        if std > 0:
            name = f"{joint.name}.torque_constant"
            yield DoubtColumn(name, "torque_constant", "%", std, _OF_PLACE * std, TorqueScale(index))
