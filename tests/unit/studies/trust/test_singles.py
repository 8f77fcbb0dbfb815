"""Figures of set C, counted by hand."""

import math

import numpy as np
import pytest

from robid.studies.settings.trust import Individual
from robid.studies.trust.figures import Intervals, RobotRow, Springs
from robid.studies.trust.singles import Single, single_figures


def row(off, grade, names=("gear_1.stiffness", "gear_2.stiffness")):
    """A robot whose first gear lies off the middle of an interval of a tenth each way."""
    middle = np.zeros((1, len(names)))
    middle[0, 0] = off
    physical = Intervals(np.exp(middle), np.exp(middle - 0.1), np.exp(middle + 0.1))
    nothing = Intervals(*(np.full(middle.shape, np.nan) for _ in range(3)))
    return RobotRow(Springs(names, np.ones(len(names), bool), np.ones(len(names)), physical, nothing), grade=grade)


def robot(group, found, causes=(), named=("zero",), moved=0.1, power=0.1, kind="heavy"):
    return Single(Individual(group, "single", kind, 1, {}), found, causes, named, moved, power)


REFUSED = RobotRow(None, grade=0)
FLAWED = [
    robot("c_zero", row(0.35, 2), ("zero",), moved=3.0),
    robot("c_zero", row(0.35, 1), ("masses", "zero"), power=0.81),
    robot("c_zero", row(0.05, 2), ("masses",)),
    robot("c_base", REFUSED, ("payload",), ("missing_spring", "payload"), math.nan, math.nan),
    robot("c_base", REFUSED, (), ("missing_spring",), math.nan, math.nan),
]


def test_only_defects_that_show_or_were_refused_are_to_be_named():
    found = single_figures(FLAWED)
    assert found["c.robots"] == 5
    assert found["c.trusted"] == pytest.approx(2 / 5)
    assert found["c.trusted_wrong"] == pytest.approx(1 / 5)  # of all, refused ones too
    assert (found["c.first_cases"], found["c.zero.cases"], found["c.base.cases"]) == (4, 2, 2)
    assert found["c.first"] == found["c.zero.first"] == found["c.base.first"] == 0.5


def test_sound_robots_that_are_refused_count_as_false():
    light = ("gear_1.stiffness",)
    sound = [
        robot("c_sound", each, (), (), math.nan, math.nan, kind)
        for each, kind in (
            (row(0.02, 2), "heavy"),
            (row(-0.02, 2), "heavy"),
            (row(0.05, 1, light), "light"),
            (REFUSED, "light"),
        )
    ]
    found = single_figures([*FLAWED, *sound])
    assert (found["c.sound"], found["c.first_cases"]) == (4, 4)
    assert found["c.false"] == 0.5
    # The second gear of the heavy ones is never off: its ratio is beyond all bounds, the median that of both.
    assert found["c.width_ratio"] > 5
    only_light = single_figures(sound[2:])
    assert only_light["c.width_ratio"] == pytest.approx(2.0)
    assert math.isnan(single_figures(FLAWED)["c.width_ratio"])
