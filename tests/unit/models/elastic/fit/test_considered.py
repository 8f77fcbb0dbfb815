"""What masses from elsewhere leave open: one step from the minimum against fits to other robots."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import certain, exact_frf, two_joint_robot
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.nuisance.effects import PerturbedRobot
from robid.models.elastic.fit.options import ElasticOptions
from robid.robot.description import Inertial, Robot
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


@pytest.mark.parametrize("elbow", [0.02, -0.02])
def test_springs_of_a_robot_that_is_off_along_a_nuisance_are_found_in_one_step(elbow):
    robot = certain(two_joint_robot())
    true = heavier(robot, elbow)
    frf = exact_frf(true, CONFIGURATIONS, FREQUENCY_HZ, declared_noise=0.001)
    perturbed = [PerturbedRobot(heavier(robot, 0.01), 0.1)]
    found = fit_elastic(robot, frf, OPTIONS, 0.0, perturbed=perturbed).estimate
    truth = np.array([spring.stiffness for spring in true.springs])
    before, after = (np.abs(each[: truth.size] / truth - 1) for each in (found.value, found.physical_value))
    assert before.max() > 0.01
    assert after.max() < 0.15 * before.max()
    assert ((found.lower[: truth.size] <= truth) & (truth <= found.upper[: truth.size])).all()


def test_a_rotor_that_is_estimated_itself_hardly_depends_on_the_file(exact):
    robot = certain(two_joint_robot())
    own, other = (fit_elastic(one, exact, OPTIONS, 0.0).estimate for one in (robot, heavier(robot, rotor=0.02)))
    perturbed = [PerturbedRobot(heavier(robot, rotor=0.002), 0.1)]
    found = fit_elastic(robot, exact, OPTIONS, 0.0, perturbed=perturbed).estimate
    grown = np.sqrt(np.maximum(np.diag(found.covariance - own.covariance), 0.0)) / own.value
    index = own.names.index("elbow.motor_inertia")
    assert other.nominal[index] == pytest.approx(1.02 * own.nominal[index])
    # What the file knows of it is its prior already.
    assert abs(other.value[index] / own.value[index] - 1) < 1e-3
    assert grown.max() < 1e-8


def test_intervals_widen_and_say_why(frf):
    robot = certain(two_joint_robot())
    perturbed = [PerturbedRobot(heavier(robot, elbow=-0.01), -0.1), PerturbedRobot(heavier(robot, rotor=0.01), 0.1)]
    sure, unsure = (fit_elastic(robot, frf, OPTIONS, 0.0, perturbed=given).estimate for given in ((), perturbed))
    np.testing.assert_allclose(sure.value, unsure.value)
    wider = np.diag(unsure.covariance) / np.diag(sure.covariance)
    assert wider.min() > 0.97
    assert wider.max() > 2
    assert "what the rigid fit leaves open" in unsure.interval_rule
    assert "rigid" not in sure.interval_rule


def scaled(robot, factor):
    """The robot with masses, payload and rotors that are heavier by one factor."""

    def heavier(body):
        return Inertial(factor * body.mass_kg, body.com_m, factor * body.inertia_kgm2)

    joints = tuple(
        replace(
            joint,
            link=heavier(joint.link),
            motor=replace(joint.motor, inertia_kgm2=factor * joint.motor.inertia_kgm2),
            nuisance_std=replace(joint.nuisance_std, torque_relative_std=0.02),
        )
        for joint in robot.joints
    )
    springs = tuple(
        spring if spring.outboard is None else replace(spring, outboard=heavier(spring.outboard))
        for spring in robot.springs
    )
    return replace(robot, joints=joints, springs=springs, payload=heavier(robot.payload))


@pytest.mark.parametrize("more", [(), ("torque_constant",)])
def test_masses_that_the_same_torques_gave_do_not_tell_their_scale(more):
    true, factor = certain(two_joint_robot()), 1.02
    frf = exact_frf(true, CONFIGURATIONS, FREQUENCY_HZ, declared_noise=0.001)
    frf = replace(frf, response=frf.response / factor, total_covariance=frf.total_covariance / factor**2)
    nominal = scaled(true, factor)
    perturbed = [PerturbedRobot(heavier(nominal, 0.001), 1.0)]
    options = replace(OPTIONS, free=(*OPTIONS.free, *more))
    found = fit_elastic(nominal, frf, options, 0.0, perturbed=perturbed).estimate
    truth = np.array([spring.stiffness for spring in true.springs])
    np.testing.assert_allclose(found.value[: truth.size], factor * truth, rtol=2e-3)
    assert ((found.lower[: truth.size] <= truth) & (truth <= found.upper[: truth.size])).all()
    # Two torque constants of 2 % each leave the springs' common scale to 1.4 %.
    half = 0.5 * (found.upper - found.lower)[: truth.size] / truth
    assert half.min() == pytest.approx(1.96 * 0.02 / np.sqrt(2), rel=0.15)
