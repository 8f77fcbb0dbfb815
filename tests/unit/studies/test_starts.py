"""Statistics of models over starts."""

import numpy as np
import pytest

from robid.studies.wernholt2008.figures import shares_differ, spread, within_factor


def test_statistics_are_those_of_the_ratios_to_the_best():
    found = spread(np.array([[1.0, 8.0], [2.0, 4.0], [6.0, 3.0]]), np.array([2.0, 4.0]))
    np.testing.assert_allclose(found["min"], [0.5, 0.75])
    np.testing.assert_allclose(found["median"], [1, 1])
    np.testing.assert_allclose(found["max"], [3, 2])
    np.testing.assert_allclose(found["mean"], [1.5, 1.25])
    np.testing.assert_allclose(found["std"], [np.sqrt((1 + 0.25 + 2.25) / 2), np.sqrt((0.5625 + 0.0625 + 0.25) / 2)])
    np.testing.assert_array_equal(spread(np.ones((1, 2)), np.ones(2))["std"], [0, 0])


def test_ends_of_the_factor_count():
    values = np.array([[0.99, 2.0], [4.0, 1.0], [4.01, 3.0]])
    inside = within_factor(values, np.array([2.0, 1.5]), 2.0)
    assert inside.tolist() == [[False, True], [True, True], [False, True]]


@pytest.mark.parametrize(
    ("first", "second", "count", "expected"),
    [(0.8, 0.64, 100, True), (0.8, 0.7, 100, False), (0.8, 0.7, 400, True), (0.3, 0.8, 100, False), (1, 1, 9, False)],
)
def test_shares_differ_by_two_standard_errors(first, second, count, expected):
    # sqrt(0.8 0.2 + 0.64 0.36) / 10 = 0.0625, sqrt(0.8 0.2 + 0.7 0.3) / 10 = 0.0608
    assert shares_differ(first, second, count) is expected
