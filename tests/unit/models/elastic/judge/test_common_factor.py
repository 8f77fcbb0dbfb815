"""A torque that is read too large by a small factor is named by all parameters together; rough robot files are not."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_mass_robot, with_spring_factors
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.assessment import common_factor_findings

FREQUENCY_HZ = np.geomspace(5.0, 200.0, 60)
CONFIGURATIONS = np.array([[0.3], [-0.5], [1.1]])
OPTIONS = ElasticOptions(free=("stiffness", "damping", "motor_inertia", "link_inertia"))
CONSTANT = 0.4


def drive(constant=None):
    """A drive whose file states the torque constant."""
    robot = two_mass_robot(damping=0.2, rotor_std=1.0)
    (joint,) = robot.joints
    return replace(robot, joints=(replace(joint, motor=replace(joint.motor, torque_constant_nm_a=constant)),))


@pytest.fixture(scope="module")
def response():
    true = with_spring_factors(drive(), 1.1, 0.9)
    return exact_frf(true, CONFIGURATIONS, FREQUENCY_HZ, relative_noise=0.01)


def named(robot, frf):
    estimate = fit_elastic(robot, frf, OPTIONS, 0.0).estimate
    return [str(scale) for finding in common_factor_findings(robot, frf, estimate) for scale in finding.scales]


def test_a_current_that_is_read_as_a_torque(response):
    # A current is the torque over the constant: responses are smaller by it.
    read = replace(response, response=response.response * CONSTANT)
    assert named(drive(CONSTANT), read) == ["torque / torque_constant of drive"]


def test_a_sound_response(response):
    assert named(drive(CONSTANT), response) == []


def test_a_factor_that_is_none_of_the_robot(response):
    read = replace(response, response=response.response * 0.6)
    assert named(drive(CONSTANT), read) == []
    assert named(drive(), replace(response, response=response.response * CONSTANT)) == []


def test_rough_robot_files(response):
    estimate = fit_elastic(drive(CONSTANT), response, OPTIONS, 0.0).estimate
    generator = np.random.default_rng(7000)
    for _ in range(200):
        rough = estimate.value * np.exp(generator.normal(0, 0.7, len(estimate.names)))
        assert common_factor_findings(drive(CONSTANT), response, replace(estimate, nominal=rough)) == ()
