"""Gears that are known beforehand: what a fit makes of them, and of what lies in line with them."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import certain, exact_frf, two_joint_robot, two_mass_robot
from robid.models.elastic.fit.fitting import draw_starts, fit_elastic
from robid.models.elastic.fit.gears_alone import gears_alone
from robid.models.elastic.fit.known_gears import Chain, chain_of, with_known_gears
from robid.models.elastic.fit.nuisance.listing import list_nuisances
from robid.models.elastic.fit.options import ElasticOptions, Weights
from robid.models.elastic.fit.parameters import map_parameters
from robid.results.gears import KnownGear
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters

TRUE = 546.4
OPTIONS = ElasticOptions(free=("stiffness",), weights=Weights(kind="optimal"), prior_decades=5.0)


def fitted(std=None, off=0.0):
    """A fit of one spring to data around the truth, known beforehand with a deviation; its logarithm and deviation."""
    robot = certain(two_mass_robot(rotor_std=0.0))
    frf = exact_frf(robot, [[0.0]], np.geomspace(20, 120, 60), declared_noise=0.2)
    if std is not None:
        robot = with_known_gears(robot, {"coupling": KnownGear(TRUE * np.exp(off), std)})
    found = fit_elastic(robot, frf, OPTIONS, 0.0).estimate
    return float(np.log(found.value[0] / TRUE)), float(found.relative_std[0]), found


def test_what_data_and_another_fit_say_is_weighed_by_precision():
    alone, own, _ = fitted()
    assert alone == pytest.approx(0, abs=1e-7)
    off = 2 * own  # what is known beforehand lies beside what the data say
    for times in (0.5, 1.0, 3.0):
        log, std, found = fitted(times * own, off)
        precision = 1 / own**2, 1 / (times * own) ** 2
        assert log == pytest.approx(off * precision[1] / sum(precision), rel=0.02)
        assert std == pytest.approx(sum(precision) ** -0.5, rel=0.02)
        assert found.prior_relative_std[0] == pytest.approx(times * own)


def test_a_sharp_prior_decides_and_a_wide_one_leaves_the_fit_its_own():
    alone, own, _ = fitted()
    assert fitted(1e-3 * own, 5 * own)[0] == pytest.approx(5 * own, rel=1e-4)
    log, std, _ = fitted(10.0, 0.1)
    assert (log, std) == (pytest.approx(alone, abs=1e-7), pytest.approx(own, rel=1e-4))


def test_a_chain_is_softer_than_its_gear_by_a_share_with_half_a_normal_prior():
    share = 0.12 * np.abs(np.random.default_rng(1).standard_normal(200_000))
    drawn, chain = np.log(1 - share), Chain(0.12)
    assert np.log(chain.factor) == pytest.approx(drawn.mean(), abs=0.01)
    assert chain.std == pytest.approx(drawn.std(), rel=0.15)
    assert (Chain(0.0).factor, Chain(0.0).std) == (1.0, 0.0)
    robot = two_joint_robot()
    known = with_known_gears(robot, {"gear_1": KnownGear(3e4, 0.03, 5e6, 1e6), "bearing_1": KnownGear(1.0, 0.1)})
    gear, other, bearing, _ = known.springs
    assert (gear.stiffness, gear.stiffness_std) == pytest.approx((3e4 * chain.factor, np.hypot(0.03, chain.std)))
    assert gear.cubic == pytest.approx(5e6 * chain.factor**4)
    assert gear.cubic_std > 1e6 * chain.factor**4
    assert (other, bearing) == robot.springs[1:3]


def test_a_gear_alone_is_what_the_other_fit_said_moved_by_its_regression_on_the_chain():
    """Against the posterior of gear and share by their joint covariance."""
    gear_std, data_std, off = 0.05, 0.04, -0.06
    robot = two_mass_robot()
    known = with_known_gears(robot, {"coupling": KnownGear(TRUE, gear_std)})
    spring = known.springs[0]
    chain = chain_of(known, spring)
    prior = np.diag([gear_std**2, chain.std**2])  # of the logarithms of gear and factor
    seen = np.array([1.0, 1.0])  # the chain is the sum of both
    gain = prior @ seen / (seen @ prior @ seen + data_std**2)
    middle, left = gain * off, prior - np.outer(gain, seen @ prior)
    found = fitted()[2]
    spread = 1.959964 * np.sqrt(seen @ left @ seen)
    value = np.array([spring.stiffness * np.exp(seen @ middle)])
    found = replace(
        found, value=value, physical_value=value, lower=value * np.exp(-spread), upper=value * np.exp(spread)
    )
    gears = gears_alone(known, found)
    assert gears.value[0] == pytest.approx(TRUE * np.exp(middle[0]))
    half = 1.959964 * np.sqrt(left[0, 0])
    np.testing.assert_allclose(np.log([gears.lower[0], gears.upper[0]] / gears.value[0]), [-half, half], rtol=1e-5)


def test_a_fixed_spring_is_as_far_off_as_the_other_fit_leaves_open():
    robot = with_known_gears(two_joint_robot(), {"gear_1": KnownGear(3e4, 0.03)})
    options = ElasticOptions(fixed=("gear_1.stiffness", "gear_2.stiffness"))
    doubts = {each.name: each.common_std for each in list_nuisances(robot, options)}
    assert doubts["gear_1.stiffness"] == pytest.approx(100 * robot.springs[0].stiffness_std)
    assert doubts["gear_2.stiffness"] == pytest.approx(10.0)


def test_cubic_coefficients_and_starts_stay_within_what_is_known():
    robot = with_known_gears(two_joint_robot(), {"gear_1": KnownGear(3e4, 0.03, 5e6, 1e6)})
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, np.array([[-0.3, 0.5]])))
    options = ElasticOptions(free=("stiffness", "cubic"), starts=40)
    found = map_parameters(robot, nominal_parameters(robot, linear, 1e-3), options, (), np.zeros(0))
    rows = {name: row for row, name in enumerate(found.names)}
    row, other = rows["gear_1.cubic"], rows["gear_2.cubic"]
    assert found.nominal_values()[row] == pytest.approx(robot.springs[0].cubic)
    assert found.prior_std[row] * found.scale[row] == pytest.approx(robot.springs[0].cubic_std)
    assert found.prior_std[other] == pytest.approx(10 / 3)
    spread = np.abs(draw_starts(found, options)).max(axis=0)
    assert spread[rows["gear_1.stiffness"]] <= np.sqrt(3) * robot.springs[0].stiffness_std
    assert spread[rows["gear_2.stiffness"]] > 1.5
