"""Gears that a fit hands on: those that it identified, with the deviations of their physical intervals."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from exact_systems import exact_frf, two_joint_robot
from robid.errors import DataError
from robid.models.elastic.values import fit_values
from robid.models.handed_on import gears_of
from robid.results.estimate import Estimate
from robid.results.gears import known_gears

STD = np.array([0.02, 0.3, 5e5, 0.02])
VALUE = np.array([2e4, 6e3, 2e6, 1e4])
LEVEL = 0.9


def estimate():
    """Two gears, the second hardly determined, and one that no robot has."""
    quantile = norm.ppf(0.5 + 0.5 * LEVEL)
    half, ones = quantile * STD, np.ones(4)
    logarithmic = np.array([True, True, False, True])
    ratio = np.exp(np.where(logarithmic, half, 0.0))
    relative = np.where(logarithmic, STD, STD / VALUE)
    return Estimate(
        names=("gear_1.stiffness", "gear_2.stiffness", "gear_1.cubic", "gear_9.stiffness"),
        kinds=("stiffness", "stiffness", "cubic", "stiffness"),
        units=("N m/rad", "N m/rad", "N m/rad^3", "N m/rad"),
        nominal=VALUE,
        value=1.1 * VALUE,  # what predicts is none of the intervals' business
        lower=np.where(logarithmic, VALUE / ratio, VALUE - half),
        upper=np.where(logarithmic, VALUE * ratio, VALUE + half),
        covariance=np.diag((relative * VALUE) ** 2),
        degrees_of_freedom=np.full(4, np.inf),
        confidence=LEVEL,
        interval_rule="",
        relative_std=relative,
        predicted_relative_std=relative,
        prior_relative_std=np.full(4, np.inf),
        relative_half_width=quantile * relative,
        identifiable=ones > 0,
        identifiable_relative_std=0.26,
        undetermined=(),
        status="converged",
        advice="",
    )


def test_identified_gears_have_the_middle_and_the_deviation_of_their_intervals():
    found = known_gears(estimate(), {})
    assert set(found) == {"gear_1", "gear_9"}
    gear = found["gear_1"]
    assert (gear.stiffness, gear.stiffness_std) == pytest.approx((2e4, 0.02))
    assert (gear.cubic, gear.cubic_std) == pytest.approx((2e6, 5e5))
    assert found["gear_9"].cubic is None


def test_a_cubic_coefficient_that_is_not_identified_is_not_handed_on():
    unsure = estimate()
    half = np.where(np.arange(4) == 2, 1.0, unsure.relative_half_width)
    assert known_gears(replace(unsure, relative_half_width=half), {})["gear_1"].cubic is None


def test_only_gears_of_the_robot_are_taken_and_none_is_refused():
    robot = two_joint_robot()
    assert set(gears_of(estimate(), "gears", robot)) == {"gear_1"}
    none = replace(estimate(), relative_half_width=np.ones(4))
    with pytest.raises(DataError, match="D651"):
        gears_of(none, "gears", robot)
    with pytest.raises(DataError, match="D652"):
        gears_of(estimate(), "gears", robot, "A")


def test_what_is_no_fit_of_gears_is_refused_in_memory():
    robot = two_joint_robot()
    frf = exact_frf(robot, np.array([[0.1, 0.2]]), np.geomspace(2, 50, 20), declared_noise=0.01)
    with pytest.raises(DataError, match="D653"):
        fit_values(robot, frf, springs_from=estimate())


def test_stiffness_that_rises_in_steps_is_known_between_its_first_and_last():
    gear = estimate()
    kinds = ("stiffness", "stepped_stiffness", "cubic", "stiffness")
    names = ("gear_1.stiffness", "axis_1.stiffness_2", "gear_1.cubic", "gear_9.stiffness")
    value = np.array([2e4, 3e4, 2e6, 1e4])
    found = known_gears(replace(gear, names=names, kinds=kinds, value=value), {"gear_1": "axis_1"})["gear_1"]
    assert found.stiffness == pytest.approx(np.sqrt(2e4 * 3e4))
    assert found.stiffness_std == pytest.approx(np.hypot(0.02, np.log(1.5) / np.sqrt(12)))
