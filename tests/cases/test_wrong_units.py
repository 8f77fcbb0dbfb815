"""Logs read in wrong units: the unit is blamed first, and what the message says to write repairs the result."""

import re

import pytest


def blame(answer):
    """What the verdict says first, and what to look for first."""
    told = answer.flat.partition("Do not use: ")[2]
    return told.partition(";")[0], told.partition("Look first for ")[2]


@pytest.mark.parametrize(
    ("name", "channel", "factor"),
    [("wrong", "motor angle", 57.3), ("w_torque", "torque", 1000), ("w_motor", "motor angle", 57.3)],
)
def test_the_unit_is_blamed_and_the_remedy_repairs(case, name, channel, factor):
    found = case("wrong_units")
    answer = found.robid("run", f"{name}.yaml")
    assert answer.code == 5
    first, look = blame(answer)
    assert f"values of the {channel}" in first
    assert look.startswith("units")
    low, high = (float(each) for each in re.search(r"\[(\S+), (\S+)\]", first).groups())
    assert low < factor < high
    unit = re.search(r"state `unit: ([^`]+)` for the " + channel, answer.flat)[1]
    path = found.folder / f"{name}.yaml"
    variable = {"motor angle": "Winkel_Motor_Grad", "torque": "Moment_mNm"}[channel]
    path.write_text(re.sub(rf"(variable: {variable}, unit: )[^,}}]+", rf"\g<1>{unit}", path.read_text()))
    answer = found.robid("run", f"{name}.yaml")
    assert "units" not in answer.flat
    # That of the motor alone holds the link's inertia, which its file has wrong.
    assert answer.code == (5 if name == "w_motor" else 0)


def test_the_right_units_accuse_nobody(case):
    answer = case("wrong_units").robid("run", "right.yaml")
    assert answer.code == 0
    assert "units" not in answer.flat
