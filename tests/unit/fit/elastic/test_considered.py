"""What masses from elsewhere leave open: one step from the minimum against fits to other robots."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import certain, exact_frf, two_joint_robot
from robid.fit.elastic.considered import DoubtfulRobot
from robid.fit.elastic.fitting import fit_elastic
from robid.fit.elastic.options import ElasticOptions
from robid.robot.description import Robot
from robid.robot.inertia import remove

CONFIGURATIONS = np.array([[0.3, -0.7], [-0.5, 0.9], [0.9, 1.4]])
FREQUENCY_HZ = np.geomspace(2.0, 80.0, 25)
OPTIONS = ElasticOptions(free=("stiffness", "damping", "motor_inertia"))


def heavier(robot, elbow=0.0, rotor=0.0) -> Robot:
    """The robot with a heavier second link beyond its split, or a heavier second rotor."""
    shoulder, link = robot.joints
    factor = 1 + elbow
    body = replace(link.link, mass_kg=factor * link.link.mass_kg, inertia_kgm2=factor * link.link.inertia_kgm2)
    motor = replace(link.motor, inertia_kgm2=(1 + rotor) * link.motor.inertia_kgm2)
    outboard = robot.springs[-1].outboard
    beyond = replace(outboard, mass_kg=factor * outboard.mass_kg, inertia_kgm2=factor * outboard.inertia_kgm2)
    assert remove(body, beyond).mass_kg > 0
    springs = (*robot.springs[:-1], replace(robot.springs[-1], outboard=beyond))
    return replace(robot, joints=(shoulder, replace(link, link=body, motor=motor)), springs=springs)


@pytest.fixture(scope="module")
def exact():
    """The robot's own response, whose noise is declared but not there."""
    return exact_frf(two_joint_robot(), CONFIGURATIONS, FREQUENCY_HZ, declared_noise=0.01)


@pytest.fixture(scope="module")
def frf():
    return exact_frf(two_joint_robot(), CONFIGURATIONS, FREQUENCY_HZ, relative_noise=0.01, seed=1)


@pytest.mark.parametrize("elbow", [0.002, -0.002])
def test_one_step_is_what_a_fit_to_the_other_robot_would_find(exact, elbow):
    robot = certain(two_joint_robot())
    own = fit_elastic(robot, exact, OPTIONS, 0.0)
    other = fit_elastic(heavier(robot, elbow), exact, OPTIONS, 0.0)
    wanted = other.estimate.value - own.estimate.value
    assert np.abs(wanted / own.estimate.value).max() > 1e-3
    doubtful = [DoubtfulRobot(heavier(robot, 0.1 * elbow), 0.1)]
    found = fit_elastic(robot, exact, OPTIONS, 0.0, doubtful=doubtful).estimate.covariance - own.estimate.covariance
    size = np.outer(np.abs(wanted), np.abs(wanted))
    # Descents stop at a share of the cost, some percent of so small a move before its end.
    np.testing.assert_allclose(found / size, np.outer(np.sign(wanted), np.sign(wanted)), atol=0.25)


def test_a_rotor_that_is_estimated_itself_hardly_depends_on_the_file(exact):
    robot = certain(two_joint_robot())
    own, other = (fit_elastic(one, exact, OPTIONS, 0.0).estimate for one in (robot, heavier(robot, rotor=0.02)))
    doubtful = [DoubtfulRobot(heavier(robot, rotor=0.002), 0.1)]
    found = fit_elastic(robot, exact, OPTIONS, 0.0, doubtful=doubtful).estimate
    grown = np.sqrt(np.maximum(np.diag(found.covariance - own.covariance), 0.0)) / own.value
    index = own.names.index("elbow.motor_inertia")
    assert other.nominal[index] == pytest.approx(1.02 * own.nominal[index])
    # What the file knows of it is its prior already.
    assert abs(other.value[index] / own.value[index] - 1) < 1e-3
    assert grown.max() < 1e-8


def test_intervals_widen_and_say_why(frf):
    robot = certain(two_joint_robot())
    doubtful = [DoubtfulRobot(heavier(robot, elbow=-0.01), -0.1), DoubtfulRobot(heavier(robot, rotor=0.01), 0.1)]
    sure, unsure = (fit_elastic(robot, frf, OPTIONS, 0.0, doubtful=given).estimate for given in ((), doubtful))
    np.testing.assert_allclose(sure.value, unsure.value)
    assert (unsure.upper >= sure.upper).all()
    assert (unsure.upper / sure.upper).max() > 1.05
    assert "what the rigid fit leaves open" in unsure.interval_rule
    assert "rigid" not in sure.interval_rule
    alone = [fit_elastic(robot, frf, OPTIONS, 0.0, doubtful=[one]).estimate.covariance for one in doubtful]
    np.testing.assert_allclose(
        unsure.covariance - sure.covariance, alone[0] + alone[1] - 2 * sure.covariance, rtol=1e-6
    )
