"""Correlation of parameters: from a covariance to a picture and to groups that go together."""

from dataclasses import replace

import numpy as np

from robid.report.charts import Heatmap
from robid.report.correlation import STRONG, correlation_of, correlation_section, strong_groups
from robid.report.numbers import MINUS
from robid.report.parameters import Estimates, ParameterRow
from robid.report.section import Notes, Table

KINDS = ("stiffness", "damping", "stiffness", "damping", "friction", "delay")
NAMES = ("gear_1", "gear_1", "gear_2", "gear_2", "axis_1.level", "delay")


def rows():
    return tuple(ParameterRow(name, kind, "", 1.0, 2.0, 1.0, 3.0, 0.1) for name, kind in zip(NAMES, KINDS, strict=True))


def covariance(*pairs):
    found = np.eye(6)
    for one, other, value in pairs:
        found[one, other] = found[other, one] = value
    std = np.array([2e6, 30.0, 1e6, 20.0, 0.1, 1e-4])
    return found * np.outer(std, std)


def section_of(*pairs, **changes):
    (section,) = correlation_section(Estimates(rows(), covariance=covariance(*pairs), **changes))
    return section


def test_a_correlation_is_the_covariance_over_both_deviations():
    found = correlation_of(np.array([[4.0, -3.0, 0.0], [-3.0, 9.0, 0.0], [0.0, 0.0, 0.0]]))
    np.testing.assert_allclose(found, [[1, -0.5, np.nan], [-0.5, 1, np.nan], [np.nan] * 3])
    assert np.isnan(correlation_of(np.diag([1.0, np.inf]))[1]).all()


def test_the_picture_is_ordered_by_kind_and_leaves_out_what_is_estimated_along():
    picture = section_of((0, 2, 0.5), (1, 3, -0.25)).parts[0]
    assert isinstance(picture, Heatmap)
    assert picture.names == ("gear_1.stiffness", "gear_2.stiffness", "gear_1.damping", "gear_2.damping", "delay")
    assert picture.groups == (2, 2, 1)
    expected = np.eye(5)
    expected[0, 1] = expected[1, 0] = 0.5
    expected[2, 3] = expected[3, 2] = -0.25
    np.testing.assert_allclose(picture.values, expected)


def test_it_says_of_which_values_it_is():
    estimates = section_of().parts[0].caption
    own = tuple(replace(row, physical=2.1) for row in rows())
    (section,) = correlation_section(Estimates(own, covariance=covariance()))
    assert "estimates" in estimates
    assert "physical values" in section.parts[0].caption


def test_pairs_and_groups_that_go_together_are_told_with_their_signs():
    table = section_of((0, 2, 0.99), (1, 3, -0.97)).parts[1]
    assert isinstance(table, Table)
    texts = table.texts
    assert [row[:2] for row in texts] == [
        ("gear_1.stiffness, gear_2.stiffness", "0.990"),
        ("gear_1.damping, gear_2.damping", f"{MINUS}0.970"),
    ]
    assert texts[0][2] != texts[1][2]
    (group,) = section_of((0, 2, 0.99), (0, 1, -0.97), (1, 2, -0.96)).parts[1].texts
    assert group[0] == f"gear_1.stiffness, gear_2.stiffness, {MINUS}gear_1.damping"
    assert group[1] == f"{MINUS}0.970 … 0.990"


def test_chains_join_into_one_group_led_by_the_strongest():
    correlation = np.eye(5)
    for one, other, value in ((0, 1, 0.96), (1, 2, 0.99), (0, 2, 0.93), (3, 4, -0.96)):
        correlation[one, other] = correlation[other, one] = value
    assert strong_groups(correlation) == [[1, 2, 0], [3, 4]]
    assert strong_groups(np.array([[1.0, STRONG - 1e-9], [STRONG - 1e-9, 1.0]])) == []


def test_without_strong_pairs_the_strongest_is_named():
    (notes,) = section_of((2, 5, -0.6)).parts[1:]
    assert isinstance(notes, Notes)
    assert f"gear_2.stiffness with delay, {MINUS}0.600" in notes.items[0]


def test_nothing_is_shown_without_a_covariance_or_with_one_parameter():
    assert correlation_section(Estimates(rows())) == ()
    assert correlation_section(Estimates(rows()[:1], covariance=np.eye(1))) == ()
    assert correlation_section(Estimates(rows(), covariance=np.full((6, 6), np.nan))) == ()
