"""Estimates that are off by known amounts."""

import numpy as np
import pytest

from robid.studies.oliveira2019.judging import (
    RootValue,
    band_errors,
    judge_roots,
    root_values,
    undershoot,
    undetermined_roots,
)

PAIR = (1.0, 6.0, 25.0)  # 5 rad/s, damping 0.6
TRUE = tuple(np.polymul(PAIR, (1.0, 20.0)).tolist())


def root(what="frequency", size=5.0, value=5.0, std=0.004, kind="pole"):
    return RootValue(f"{kind}1.{what}", kind, what, size, value, std)


def test_roots_are_rates_or_frequency_and_damping():
    assert sorted(root_values(TRUE)) == [
        ("damping", pytest.approx(5), pytest.approx(0.6)),
        ("frequency", pytest.approx(5), pytest.approx(5)),
        ("rate", pytest.approx(20), pytest.approx(20)),
    ]
    assert root_values((1.0, -4.0)) == [("rate", 4.0, -4.0)]


def test_only_what_is_well_known_inside_the_band_is_judged():
    found = [root(value=5.05), root(std=0.006), root(size=40.0), root("damping", value=0.59, std=0.001)]
    first, second = judge_roots(found, (1.0, 3.0), TRUE, (0.1, 30))
    assert (first.truth, first.percent, first.deviations) == pytest.approx((5, 1, 0.05 / 0.0202))
    assert (second.truth, second.percent) == pytest.approx((0.6, 100 * 0.01 / 0.6))
    assert second.deviations == pytest.approx(0.01 / 0.00059)


def test_estimates_are_held_against_the_nearest_of_their_kind():
    two = tuple(np.polymul((1.0, 2.0), (1.0, 20.0)).tolist())
    (error,) = judge_roots([root("rate", 18.0, 18.0)], (1.0, 3.0), two, (0.1, 30))
    assert error.truth == pytest.approx(20)
    (zero,) = judge_roots([root("rate", 18.0, 18.0, kind="zero")], (1.0, 3.0), two, (0.1, 30))
    assert zero.truth == pytest.approx(3)


def test_a_pair_where_the_truth_has_none_is_no_hit():
    (error,) = judge_roots([root()], (1.0,), (1.0, 5.0), (0.1, 30))
    assert error.percent == np.inf


def test_responses_are_off_in_magnitude_and_phase():
    true = np.array([1.0 + 0j, 2j, -3.0])
    found = true * np.array([1.0, 0.98 * np.exp(0.01j), 1.01 * np.exp(-0.02j)])
    assert band_errors(found, true) == pytest.approx((2, np.degrees(0.02)))


def test_an_undershoot_is_where_the_step_response_is_lowest():
    assert undershoot(np.array([0.0, -0.2, -0.3, 0.5])) == (2, pytest.approx(0.3))
    assert undershoot(np.array([0.0, 0.2]))[1] == 0


def test_what_is_there_but_not_found_is_named_with_its_cause():
    denominator = tuple(np.polymul(TRUE, np.polymul((1.0, 900.0), (1.0, 2.0))).tolist())
    found = [root(value=5.1), root("rate", 30.0, 30.0), root("rate", 900.0, 900.0, std=0.8)]
    told = undetermined_roots(found, (1.0, 2.01), denominator, 262)
    assert [text.partition(":")[2].strip() for text in told] == [
        "it lies above the Nyquist frequency of 262 rad/s",
        "the data do not tell it from a simpler structure",
        "a zero nearly cancels it",
        "a pole nearly cancels it",
    ]
    assert told[0].startswith("the true pole of rate 900 rad/s is not determined")
    assert not undetermined_roots([root(), root("damping", value=0.6), root("rate", 20.0, 20.0)], (1.0,), TRUE, 262)
