"""Units where the torque constant is unknown."""

from __future__ import annotations


def with_torque_unit(unit: str, torque_unit: str) -> str:
    """Writes a unit with what stands for N m where the torque constant is unknown."""
    if torque_unit == "N m":
        return unit
    unit = {"kg": "N m s^2/m^2", "kg m": "N m s^2/m", "N/m": "N m/m^2", "N s/m": "N m s/m^2", "N/m^3": "N m/m^4"}.get(
        unit, unit
    )
    return unit.replace("kg m^2", "N m s^2/rad").replace("N m", torque_unit)
