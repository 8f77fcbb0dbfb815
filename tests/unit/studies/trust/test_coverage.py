"""Coverage by closed forms: what normal errors of known size must give, and each rule of counting."""

import numpy as np
import pytest

from robid.studies.trust.figures import Held, Intervals, effective, physical, worst_half_widths

NORMAL_95 = 1.959963984540054


def around(log_value, half_width):
    value = np.exp(log_value)
    return Intervals(value, value * np.exp(-half_width), value * np.exp(half_width))


def every(shape):
    return np.ones(shape, bool)


def test_a_half_width_is_half_the_interval_in_logarithms():
    found = around(np.log([[2.0, 3e6]]), np.array([[0.1, 0.4]]))
    np.testing.assert_allclose(found.half_width, [[0.1, 0.4]])


def test_normal_errors_within_their_deviations_are_covered_as_often_as_the_level_says():
    generator, shape, std = np.random.default_rng(1), (4000, 5), 0.02
    truth = np.exp(generator.uniform(10, 15, shape))
    found = around(np.log(truth) + std * generator.standard_normal(shape), np.full(shape, NORMAL_95 * std))
    held = physical(found, truth, every(shape))
    assert held.coverage == pytest.approx(0.95, abs=4 * held.coverage_std)
    assert held.coverage_std == pytest.approx(np.sqrt(0.95 * 0.05 / 20000), rel=0.1)
    assert held.width_ratio == pytest.approx(1.0, rel=0.05)
    wide = physical(around(np.log(found.value), 2 * found.half_width), truth, every(shape))
    assert wide.width_ratio == pytest.approx(2 * held.width_ratio, rel=1e-9)


def test_differences_of_two_fits_are_held_by_the_root_of_both_squared():
    generator, shape, own, other = np.random.default_rng(2), (4000, 5), 0.03, 0.01
    middle = generator.uniform(10, 15, shape)
    first, second = (
        around(middle + std * generator.standard_normal(shape), np.full(shape, NORMAL_95 * std)) for std in (own, other)
    )
    held = effective(first, second, every(shape))
    assert held.coverage == pytest.approx(0.95, abs=4 * held.coverage_std)
    np.testing.assert_allclose(held.half_width, NORMAL_95 * np.hypot(own, other))


def test_the_worst_spring_is_looked_for_over_robots():
    inside = np.array([[1, 1, 0], [1, 0, 0], [1, 1, 0], [1, 1, 1]], bool)
    counted = np.array([[1, 1, 0], [1, 1, 1], [0, 1, 0], [1, 1, 1]], bool)
    held = Held(inside & counted, counted, np.zeros((4, 3)), np.ones((4, 3)))
    np.testing.assert_allclose(held.each_spring, [1.0, 0.75, 0.5])
    assert held.worst == 0.5
    assert held.coverage == pytest.approx(7 / 9)
    never = Held(inside[:, :1], np.zeros((4, 1), bool), np.zeros((4, 1)), np.ones((4, 1)))
    assert np.isnan([never.coverage, never.worst, never.width_ratio, never.coverage_std]).all()


def test_springs_of_one_robot_that_fail_together_count_as_one():
    inside = np.repeat([[True], [False], [True], [True]], 10, axis=1)
    held = Held(inside, every((4, 10)), np.zeros((4, 10)), np.ones((4, 10)))
    assert held.coverage == 0.75
    assert held.coverage_std == pytest.approx(np.std([1, 0, 1, 1], ddof=1) / 2)


def test_what_is_not_known_is_not_counted():
    truth = np.array([[1.0, np.nan, 3.0]])
    found = Intervals(np.ones((1, 3)), np.array([[0.9, 0.9, np.nan]]), np.array([[1.1, 1.1, np.nan]]))
    held = physical(found, truth, every((1, 3)))
    np.testing.assert_array_equal(held.counted, [[True, False, False]])
    assert held.coverage == 1.0


def test_distances_in_half_widths_are_from_the_middle_of_the_interval():
    found = Intervals(np.array([[1.0, 5.0]]), np.array([[1.0, 1.0]]), np.exp([[0.2, 0.2]]))
    truth = np.exp([[0.5, 0.1]])
    np.testing.assert_allclose(worst_half_widths(found, truth, every((1, 2))), [4.0])
    np.testing.assert_allclose(worst_half_widths(found, truth, np.array([[False, True]])), [0.0], atol=1e-12)
    assert np.isnan(worst_half_widths(found, truth, np.zeros((1, 2), bool))).all()
