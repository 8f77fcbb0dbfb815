"""What a fit can free of gears: dampers that grow with the load, and hysteresis."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from robid.arrays import ComplexArray
from robid.models.elastic.fit.doubts.column import DoubtColumn
from robid.robot.description import Robot

if TYPE_CHECKING:
    from robid.models.elastic.fit.doubts.scene import Scene

LOAD_DAMPING, HYSTERESIS = "load_damping", "hysteresis"
"""Names that free them in all gears, and the ends of their names."""
_GROWTH = 3.0  # of a damper up to the largest torque of the motor
_SLIP_SHARE = 0.005  # of that torque
_TORQUE_NM = 2e3  # where nobody says what the motor can give


@dataclass(frozen=True)
class _OfGear:
    """What a fit frees of a gear.

    Attributes:
        spring: Index of the gear.
    """

    spring: int

    def column(self, scene: Scene) -> ComplexArray:
        """Derivative (n_conf, n_freq, n_out, n_in) of the log response; nothing but where a fit frees it."""
        return np.zeros(scene.problem.frf.response.shape, complex)


class LoadDamping(_OfGear):
    """A damper that grows with its gear's deflection, amounts in shares per deflection."""


class SlipTorque(_OfGear):
    """Bristles beside a gear, a tenth as stiff, amounts in the torque at which they slip."""


def gear_kinds(robot: Robot) -> Iterator[DoubtColumn]:
    """Yields load-dependent damping and hysteresis of each transmission."""
    for index, spring in enumerate(robot.springs):
        if spring.place != "transmission":
            continue
        motor, linear = robot.joints[spring.joint].motor, robot.is_linear(spring)
        most = abs(motor.max_torque_nm * motor.gear_ratio)
        most = most if np.isfinite(most) else _TORQUE_NM
        growth, slip = _GROWTH * spring.stiffness / most, _SLIP_SHARE * most
        names = f"{spring.name}.{LOAD_DAMPING}", f"growth of {spring.name}'s damper with its deflection"
        unit = "1/m" if linear else "1/rad"
        # Downwards no damper may become negative.
        grows = LoadDamping(index)
        yield DoubtColumn(*names, LOAD_DAMPING, unit, growth, 0.0, grows, least=-growth / _GROWTH, natural=growth)
        names = f"{spring.name}.{HYSTERESIS}", f"hysteresis of {spring.name}"
        yield DoubtColumn(*names, HYSTERESIS, "N" if linear else "N m", slip, 0.0, SlipTorque(index), natural=slip)
