"""Differences of two fits: as rare by chance as they say, and seen where they are."""

from dataclasses import replace

import numpy as np
import pytest

from robid.results.differences import FALSE_ALARMS, differences
from robid.results.estimate import Estimate

N, STD, QUANTILE = 30, 0.01, 1.959964


def estimate(value, std=STD, names=None):
    """A fit of parameters of one unit with intervals of 95 %."""
    value = np.asarray(value, float)
    count = value.size
    half = QUANTILE * std * np.ones(count)
    names = names or tuple(f"gear_{index}.stiffness" for index in range(count))
    ones = np.ones(count)
    return Estimate(
        names=names,
        kinds=("stiffness",) * count,
        units=("N m/rad",) * count,
        nominal=ones,
        value=value,
        lower=value - 9 * half,
        upper=value + 9 * half,
        covariance=np.diag(std**2 * ones),
        degrees_of_freedom=np.inf * ones,
        confidence=0.95,
        interval_rule="",
        relative_std=std * ones,
        predicted_relative_std=std * ones,
        prior_relative_std=np.inf * ones,
        relative_half_width=half,
        identifiable=np.ones(count, bool),
        identifiable_relative_std=0.2,
        undetermined=(),
        status="converged",
        advice="",
        effective_value=value,
        effective_lower=value - half,
        effective_upper=value + half,
    )


def test_two_fits_of_one_robot_differ_in_one_of_twenty_comparisons():
    rng, alarms, trials = np.random.default_rng(4), 0, 3000
    first = estimate(np.ones(N))
    for _ in range(trials):
        one, two = 1 + STD * rng.standard_normal((2, N))
        half = QUANTILE * STD
        pair = (
            replace(first, value=each, effective_lower=each - half, effective_upper=each + half) for each in (one, two)
        )
        alarms += any(each.differs for each in differences(*pair))
    spread = np.sqrt(FALSE_ALARMS * (1 - FALSE_ALARMS) / trials)
    assert alarms / trials == pytest.approx(FALSE_ALARMS, abs=4 * spread)


def test_a_parameter_six_deviations_away_differs_whatever_the_physical_interval_says():
    moved = np.ones(N)
    moved[3] += 6 * np.sqrt(2) * STD
    found = differences(estimate(np.ones(N)), estimate(moved))
    assert [each.name for each in found if each.differs] == ["gear_3.stiffness"]
    assert found[3].relative == pytest.approx(6 * np.sqrt(2) * STD)


def test_only_shared_parameters_are_compared_and_an_unknown_interval_says_so():
    first, other = estimate([1.0, 2.0], names=("a", "b")), estimate([2.0, 5.0], names=("b", "c"))
    (found,) = differences(first, other)
    assert (found.name, found.ratio, found.differs) == ("b", 0.0, False)
    unknown = replace(other, effective_upper=np.full(2, np.inf), effective_lower=np.full(2, -np.inf))
    assert differences(first, unknown)[0].differs is None
