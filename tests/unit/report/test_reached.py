"""How a page shows what was reached of the motors' limits."""

import math

import pytest

from robid.report.reached import Plane, ReachedRow, reached_section
from robid.report.section import Cell, Choice, Table

SQUARE = ((-1.0, -2.0), (1.0, -2.0), (1.0, 2.0), (-1.0, 2.0))


def row(peak, limit, quantity="torque", campaign="day"):
    return ReachedRow(campaign, "axis", quantity, "N m", 1.0, peak, limit)


def plane(speed_limit, torque_limit, rated=math.nan):
    return Plane("day", "axis", SQUARE, SQUARE, speed_limit, torque_limit, rated)


def shares(section):
    (table,) = (part for part in section.parts if isinstance(part, Table))
    return [each.cells[6] for each in table.rows]


def test_what_is_beyond_a_limit_is_marked_and_named():
    (section,) = reached_section((row(9.0, 10.0), row(12.0, 10.0, "speed", "night"), row(5.0, math.inf)), ())
    fine, beyond, unknown = shares(section)
    assert (fine.mark, beyond.mark) == ("", "bad")
    assert (fine.text, beyond.text) == ("90 %", "✗ 120 %")
    assert not isinstance(unknown, Cell), "there is no limit"
    assert section.lead.endswith("Beyond a limit: speed of axis in night.")
    (section,) = reached_section((row(9.0, 10.0), row(6.0, 10.0, "speed", "night")), ())
    assert section.lead.endswith("torque 90 % (axis, day); speed 60 % (axis, night).")


def test_without_limits_there_is_nothing_to_say():
    assert reached_section((row(5.0, math.inf),), (plane(math.inf, math.inf),)) == ()
    assert reached_section((), ()) == ()


@pytest.mark.parametrize(("limit", "shown"), [(1.5, True), (3.9, True), (100.0, False), (math.inf, False)])
def test_axes_go_as_far_as_limits_that_are_near(limit, shown):
    (section,) = reached_section((row(1.0, 2.0),), (plane(limit, 4.0, 1.5),))
    (choice,) = (part for part in section.parts if isinstance(part, Choice))
    ((name, (figure,)),) = choice.options
    assert name == "axis"
    assert [line.at for line in figure.lines if line.along == "x"] == ([limit, -limit] if shown else [])
    assert [line.at for line in figure.lines if line.along == "y"] == [4.0, -4.0, 1.5, -1.5]
    assert figure.x_range[1] > (limit if shown else 1.0)
    assert figure.x_range[1] < 2 * (limit if shown else 1.0)
    assert ("lies outside" in figure.caption, "No limit" in figure.caption) == (limit == 100, math.isinf(limit))
    hull = figure.curves[0]
    assert (hull.x[0], hull.y[0]) == (hull.x[-1], hull.y[-1])
