"""Joint positions as texts: angles in degrees, lengths in metres."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.arrays import FloatArray

RADIANS = "rad"
METRES = "m"


def readable(positions: FloatArray, units: Sequence[str] | None) -> FloatArray:
    """Returns positions (..., n_joint) in degrees, or in metres where joints slide.

    Args:
        positions (..., n_joint): Positions [rad, or m].
        units: Unit of each joint's position, `RADIANS` or `METRES`; None where all are angles.
    """
    if units is None:
        return np.asarray(np.rad2deg(positions))
    return np.asarray(positions * np.where([unit == METRES for unit in units], 1.0, np.rad2deg(1.0)))


def readable_units(units: Sequence[str] | None, n_joint: int) -> tuple[str, ...]:
    """Returns the unit of each of these: `deg` or `m`."""
    return ("deg",) * n_joint if units is None else tuple("m" if unit == METRES else "deg" for unit in units)


def shown(positions: FloatArray, units: Sequence[str] | None) -> str:
    """Writes the positions (n_joint,) of one configuration; without any joint it is where the robot was."""
    if not len(positions):
        return "home"
    values = readable(positions, units)
    if units is None:
        return f"{np.array2string(values, precision=1)} deg"
    pairs = zip(values.tolist(), readable_units(units, len(values)), strict=True)
    return ", ".join(f"{value:.3f} m" if unit == "m" else f"{value:.1f} deg" for value, unit in pairs)
