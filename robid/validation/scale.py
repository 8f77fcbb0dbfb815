"""Factors by which values of a log are commonly read wrong, and how a doubt says which of them it saw."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SCALES: dict[str, float] = {
    "180/pi": float(180 / np.pi),
    "1000": 1e3,
    "1e6": 1e6,
    "60/2pi": float(60 / (2 * np.pi)),
    "6": 6.0,
    "9.81": 9.80665,
    "2pi": float(2 * np.pi),
    "60": 60.0,
}
"""Factors that are the same on every robot: deg for rad, milli, micro, rpm for rad/s, rpm for deg/s, kgf for N, turns
for rad, minutes for seconds."""

OWN_SCALES: dict[str, str] = {
    "gear_ratio": "a motor's gear ratio: its side is mistaken, or nobody reduced it",
    "counts": "counts of an encoder instead of its angle, or a count of another encoder's per turn",
    "torque_constant": "a motor's torque constant: currents that are read as torques",
}
"""Factors that are a robot's own, with what they are."""

CHANNELS = ("torque", "motor_angle", "arm_angle", "speed", "acceleration", "time", "current", "position", "command")
"""What may have a wrong scale."""


@dataclass(frozen=True)
class Scale:
    """A wrong scale that a doubt saw.

    Attributes:
        channel: What has it, of `CHANNELS`.
        factor: Which factor, a key of `SCALES` or of `OWN_SCALES`.
        inverse: Whether the values that were read are too small by the factor; they are too large where not.
        joints: The joints concerned; none for all of them.
    """

    channel: str
    factor: str
    inverse: bool = False
    joints: tuple[str, ...] = ()
