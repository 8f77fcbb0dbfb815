"""Units where a current stands for the torque."""

import pytest

from robid.models.parameters import with_torque_unit


@pytest.mark.parametrize(
    ("unit", "wanted"),
    [
        ("N m/rad", "A/rad"),
        ("kg m^2", "A s^2/rad"),
        ("N/m", "A/m^2"),  # a force is a torque over a length
        ("N s/m", "A s/m^2"),
        ("N/m^3", "A/m^4"),
        ("kg", "A s^2/m^2"),
        ("m", "m"),
    ],
)
def test_forces_and_masses_are_ratios_to_the_torque_constant_too(unit, wanted):
    assert with_torque_unit(unit, "A") == wanted
    assert with_torque_unit(unit, "N m") == unit
