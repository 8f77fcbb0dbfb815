"""Friction without memory as a sum of clipped ramps, which the engine evaluates at every stage of a step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from robid.arrays import FloatArray
from robid.robot.description import Friction

StaticLaw: TypeAlias = Literal["tanh", "stribeck"]
SIGN_SHARE = 0.1  # width of the smoothed sign over the Stribeck speed
_KNOTS: dict[StaticLaw, int] = {"tanh": 16, "stribeck": 24}
_REACH = 5.0  # where the curve ends, over the Stribeck speed
_FINE = 20001


@dataclass(frozen=True)
class Ramps:
    """A polygon that is odd in the speed: `sum_k clip(slope_k v, -level_k, level_k)`.

    Attributes:
        slope (n_knot,): Slopes; negative where the curve bends upwards [N m s/rad].
        level (n_knot,): Where each ramp ends [N m].
    """

    slope: FloatArray
    level: FloatArray


def static_friction(friction: Friction, law: StaticLaw, speed: FloatArray) -> FloatArray:
    """Torque against the motion, viscous part left out [N m].

    Args:
        friction: Coefficients; the presliding deflection is not used.
        law: `tanh` is the Coulomb level times tanh of speed over Stribeck speed, `stribeck` the Stribeck curve
            times tanh of speed over a tenth of the Stribeck speed.
        speed: Motor speeds of any shape [rad/s].
    """
    relative = speed / friction.stribeck_rad_s
    if law == "tanh":
        return np.asarray(friction.coulomb_nm * np.tanh(relative))
    excess = (friction.static_nm - friction.coulomb_nm) * np.exp(-(relative**2))
    return np.asarray((friction.coulomb_nm + excess) * np.tanh(relative / SIGN_SHARE))


def ramp_count(law: StaticLaw) -> int:
    """Returns the number of ramps of a law's polygon."""
    return _KNOTS[law]


def friction_ramps(friction: Friction, law: StaticLaw) -> Ramps:
    """Returns the polygon of a law; its knots lie as densely as the root of the curvature asks.

    It is within 0.3 % of the breakaway level of `static_friction`.
    """
    speed = friction.stribeck_rad_s * np.linspace(0.0, _REACH, _FINE) ** 2 / _REACH
    curve = static_friction(friction, law, speed)
    bend = np.sqrt(np.abs(np.gradient(np.gradient(curve, speed), speed)))
    share = np.concatenate([[0.0], np.cumsum(0.5 * (bend[1:] + bend[:-1]) * np.diff(speed))])
    knots = np.interp(np.linspace(0.0, share[-1], _KNOTS[law] + 1), share, speed)
    values = static_friction(friction, law, knots)
    values[-1] = friction.coulomb_nm
    slope = np.append(np.diff(values) / np.diff(knots), 0.0)
    change = slope[:-1] - slope[1:]
    return Ramps(change, np.abs(change) * knots[1:])
