"""Units where the torque constant is unknown."""

from __future__ import annotations


def with_torque_unit(unit: str, torque_unit: str) -> str:
    """Writes a unit with what stands for N m where the torque constant is unknown."""
    if torque_unit == "N m":
        return unit
    return unit.replace("kg m^2", "N m s^2/rad").replace("N m", torque_unit)
