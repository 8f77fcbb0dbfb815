"""A gear's fitted value is that of the gear with what lies in line with it; what it alone may be is told apart."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import certain, exact_frf, two_joint_robot
from realizations import averaged
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.gears_alone import gears_alone
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fitting import true_values
from robid.robot.description import Inertial, Spring
from robid.simulate.options import Imperfections, Truth
from robid.simulate.truth import TrueRobot

FREQUENCY_HZ = np.geomspace(1, 60, 40)
PLACES = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2], [-1.1, 0.3], [0.2, 2.0]])
OPTIONS = ElasticOptions(free=("stiffness", "damping", "motor_inertia"))
HINGE = 1e5  # a fifth of the gear's compliance, within what the prior says


def with_hinge(robot):
    """The robot with a hinge right behind the first gear, next to nothing between them."""
    link = robot.joints[0].link
    beyond = Inertial(0.999 * link.mass_kg, link.com_m, 0.999 * link.inertia_kgm2)
    hinge = Spring("hinge", 0, "split", np.array([0.0, 0.0, 1.0]), HINGE, 0.1 * HINGE / 1e3, outboard=beyond)
    return replace(robot, springs=(*robot.springs, hinge))


def true_of(robot):
    return TrueRobot(robot, Truth(), Imperfections(), 0.0, 1, None)


@pytest.fixture(scope="module")
def hinged():
    """A robot with a hinge that its file lacks, and what a fit says of it."""
    robot = with_hinge(two_joint_robot())
    frf = averaged(exact_frf(robot, PLACES, FREQUENCY_HZ), 0.003, seed=1)
    return robot, fit_elastic(two_joint_robot(), frf, OPTIONS, 0.0)


def test_the_physical_interval_is_that_of_the_chain_and_the_gear_s_own_reaches_up_to_the_gear(hinged):
    true, solution = hinged
    estimate, gears = solution.estimate, solution.gears
    chain = true_values(two_joint_robot(), true_of(true))["gear_1.stiffness"]
    assert chain == pytest.approx(1 / (1 / 2e4 + 1 / HINGE))
    row, own = estimate.names.index("gear_1.stiffness"), gears.names.index("gear_1.stiffness")
    assert estimate.lower[row] < chain < estimate.upper[row] < 2e4
    assert gears.lower[own] < 2e4 < gears.upper[own]
    assert gears.names == ("gear_1.stiffness", "gear_2.stiffness")


def test_a_gear_alone_is_never_softer_than_its_chain_and_what_predicts_is_left_alone(hinged):
    _, solution = hinged
    estimate, gears = solution.estimate, solution.gears
    rows = [estimate.names.index(name) for name in gears.names]
    np.testing.assert_array_equal(gears.lower, estimate.lower[rows])
    assert (gears.value > estimate.middle[rows]).all()
    assert (gears.upper > estimate.upper[rows]).all()
    sure = gears_alone(certain(two_joint_robot()), estimate)
    np.testing.assert_allclose(sure.upper, estimate.upper[rows])
    np.testing.assert_array_equal(sure.value, estimate.middle[rows])


@pytest.mark.parametrize(("spread", "share_std"), [(0.01, 0.12), (0.1, 0.12), (0.05, 0.05), (0.1, 0.01)])
def test_intervals_of_gears_alone_hold_gears_drawn_from_the_prior(hinged, spread, share_std):
    """Chains that are off by a logarithm of this deviation, gears with a share of half a normal distribution."""
    robot, estimate = two_joint_robot(), hinged[1].estimate
    joints = tuple(
        replace(joint, nuisance_std=replace(joint.nuisance_std, chain_compliance=share_std)) for joint in robot.joints
    )
    generator, held = np.random.default_rng(7), []
    row = estimate.names.index("gear_1.stiffness")
    for _ in range(2000):
        middle = 2e4 * np.exp(spread * generator.standard_normal())
        found = replace(
            estimate,
            physical_value=np.where(np.arange(len(estimate.names)) == row, middle, estimate.physical_value),
            lower=np.where(np.arange(len(estimate.names)) == row, middle * np.exp(-1.96 * spread), estimate.lower),
            upper=np.where(np.arange(len(estimate.names)) == row, middle * np.exp(1.96 * spread), estimate.upper),
        )
        gears = gears_alone(replace(robot, joints=joints), found)
        gear = 2e4 / (1 - share_std * abs(generator.standard_normal()))
        held.append(gears.lower[0] <= gear <= gears.upper[0])
    # 2000 draws have a deviation of 0.5 percent points; the interval may hold more, for it is one-sided.
    assert 0.935 < np.mean(held) < 0.985
