"""Figures of small sets of robots, counted by hand."""

import numpy as np
import pytest

from robid.studies.page import Asked
from robid.studies.trust.figures import (
    Intervals,
    RobotRow,
    Springs,
    cause_figures,
    largest,
    set_figures,
    spring_rows,
    trusted_wrong,
)


def springs(physical_off=0.0, effective_off=0.0, counted=(True, True)):
    def around(off):
        middle = np.exp(np.array([[off, 0.0]]))
        return Intervals(middle, middle * np.exp(-0.1), middle * np.exp(0.1))

    return Springs(
        ("gear_1.stiffness", "gear_2.stiffness"),
        np.array(counted),
        np.ones(2),
        around(physical_off),
        around(effective_off),
    )


def test_a_set_of_robots_has_its_shares():
    rows = [
        RobotRow(springs(0.05, 0.0), springs(), springs(0.0, 0.3), 2),
        RobotRow(springs(0.35, 0.3), springs(), springs(), 2),
        RobotRow(springs(0.2), None, None, 1),
        RobotRow(None, None, None, 0),
    ]
    found = set_figures("b", rows, listed=False)
    assert found["b.effective.coverage_95"] == pytest.approx(3 / 4)
    assert found["b.effective.designed"] == pytest.approx(3 / 4)
    assert found["b.physical.coverage_95"] == pytest.approx(4 / 6)
    assert found["b.physical.worst"] == pytest.approx(1 / 3)
    assert found["b.trusted"] == pytest.approx(2 / 3)
    assert found["b.trusted_wrong"] == pytest.approx(1 / 3)
    assert found["b.refused"] == 0.25
    assert found["b.robots"] == 4
    assert found["b.springs_counted"] == 1
    assert found["b.effective.half_width"] == pytest.approx(0.1 * np.sqrt(2))


def test_a_ratio_that_is_not_known_is_not_left_out_of_the_largest():
    assert largest([1.0, 3.0, 2.0]) == 3
    assert np.isnan(largest([1.0, np.nan]))
    assert np.isnan(set_figures("a", [RobotRow(springs(), None)], listed=True)["a.width_ratio"])


def test_each_spring_has_its_row():
    rows = [
        RobotRow(springs(0.05, 0.3), springs()),
        RobotRow(springs(0.35)),
        RobotRow(springs(0.2, counted=(False, True))),
    ]
    first, second = spring_rows([*rows, RobotRow(None)])
    assert first == ("gear_1.stiffness", *(pytest.approx(value) for value in (2 / 3, 0.0, 0.5, 0.1, 0.2)))
    assert second == ("gear_2.stiffness", *(pytest.approx(value) for value in (1.0, 1.0, 1.0, 0.1, 0.0)))


def test_only_listed_defects_make_physical_widths_count():
    rows = [RobotRow(springs(0.05, 0.02), springs(), None, 1) for _ in range(3)]
    listed, unlisted = (set_figures("a", rows, listed=each) for each in (True, False))
    assert unlisted["a.width_ratio"] == unlisted["a.effective.width_ratio"]
    assert listed["a.width_ratio"] == max(listed["a.physical.width_ratio"], listed["a.effective.width_ratio"])


def test_a_spring_that_was_not_to_be_determined_is_not_held_against_trust():
    far = springs(0.5, counted=(False, True))
    assert trusted_wrong([RobotRow(far, grade=2)]) == 0
    assert trusted_wrong([RobotRow(springs(0.5), grade=2)]) == 1
    assert trusted_wrong([RobotRow(springs(0.5), grade=1)]) == 0


def test_causes_are_counted_by_their_ranks():
    kinds = {
        "payload": (("payload",), [("payload",), ("masses", "friction", "payload"), ()]),
        "sign": (("torque_sign", "angle_sign"), [("angle_sign", "masses"), ("masses", "masses", "friction", "delay")]),
    }
    found = cause_figures(kinds)
    assert found["causes.first"] == pytest.approx(2 / 5)
    assert found["causes.first_three"] == pytest.approx(3 / 5)
    assert found["causes.payload.first"] == pytest.approx(1 / 3)


def test_limits_are_within():
    assert Asked(0.92, 0.98).is_reached(0.98)
    assert not Asked(0.92, 0.98).is_reached(0.981)
    assert not Asked(0.0, 1.0).is_reached(float("nan"))
    assert not Asked().is_reached(float("nan"))
