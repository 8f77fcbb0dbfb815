"""Estimates put into the robot give the fitted model."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot, with_spring_factors
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.solution import fitted_delay_s, fitted_robot
from robid.robot.friction import KINDS
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response

FREQUENCY_HZ = np.geomspace(2.0, 60.0, 25)
CONFIGURATIONS = np.array([[0.3, -0.7], [-0.5, 0.9], [1.1, 0.2]])
KINDS_FREE = ("stiffness", "damping", "viscous", "motor_inertia", "link_inertia", "delay")


def with_other_inertias(robot):
    """The robot with more rotor and less link inertia, and some viscous friction."""
    joints = []
    for joint, more in zip(robot.joints, (-0.1, -0.01), strict=True):
        link = replace(joint.link, inertia_kgm2=joint.link.inertia_kgm2 + np.diag([0.0, 0.0, more]))
        friction = replace(joint.motor.friction, viscous_nms_rad=2e-3)
        motor = replace(joint.motor, inertia_kgm2=1.1 * joint.motor.inertia_kgm2, friction=friction)
        joints.append(replace(joint, link=link, motor=motor))
    return replace(robot, joints=tuple(joints))


@pytest.fixture(scope="module")
def fitted():
    nominal = two_joint_robot()
    true = with_other_inertias(with_spring_factors(nominal, 1.3, 0.8))
    frf = exact_frf(true, CONFIGURATIONS, FREQUENCY_HZ, delay_s=1.2e-3)
    return nominal, true, frf, fit_elastic(nominal, frf, ElasticOptions(free=KINDS_FREE), 1e-3)


def test_the_fitted_robot_has_the_fitted_response(fitted):
    nominal, true, frf, solution = fitted
    robot = fitted_robot(nominal, solution.estimate)
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, CONFIGURATIONS))
    delay = fitted_delay_s(solution.estimate, 1e-3)
    found = response(linear, nominal_parameters(robot, linear, delay), FREQUENCY_HZ, frf.hold_period_s).sampled
    np.testing.assert_allclose(found, solution.responses.modelled, rtol=1e-6)
    # Without the inertias in the right place it would be off by far more.
    assert np.abs(exact_frf(nominal, CONFIGURATIONS, FREQUENCY_HZ, delay_s=delay).response / found - 1).max() > 0.05
    for spring, wanted in zip(robot.springs, true.springs, strict=True):
        assert spring.stiffness == pytest.approx(wanted.stiffness, rel=1e-3)


def test_what_was_not_estimated_stays(fitted):
    nominal, _, _, solution = fitted
    none = replace(solution.estimate, names=("other",), nominal=np.zeros(1), value=np.ones(1))
    same = fitted_robot(nominal, none)
    assert fitted_delay_s(none, 1e-3) == 1e-3
    assert same.springs == nominal.springs
    assert [joint.motor for joint in same.joints] == [joint.motor for joint in nominal.joints]


def test_friction_and_ripple_coefficients(fitted):
    nominal, _, _, solution = fitted
    motor = nominal.joints[0].motor
    law = replace(motor.friction, coulomb_nm=0.4, static_nm=0.5, stribeck_rad_s=2.0, presliding_rad=0.05)
    first = replace(nominal.joints[0], motor=replace(motor, friction=law, ripple_nm=0.3, ripple_order=5))
    robot = replace(nominal, joints=(first, nominal.joints[1]))
    estimate = np.array([0.1, -0.2, 0.4, -0.6, 0.8])
    names = tuple(f"shoulder.{kind}" for kind in KINDS)
    found = (
        fitted_robot(robot, replace(solution.estimate, names=names, nominal=np.zeros(5), value=estimate))
        .joints[0]
        .motor
    )
    assert found.friction.coulomb_nm == pytest.approx(0.44)
    assert found.friction.static_nm == pytest.approx(0.55)
    assert found.friction.stribeck_rad_s == pytest.approx(1.6)
    assert found.friction.presliding_rad == pytest.approx(0.04)
    angle = np.linspace(0, 3, 7)
    opposing = 0.3 * (-0.6 * np.sin(5 * angle) + 0.8 * np.cos(5 * angle))
    driving = found.ripple_nm * np.sin(5 * angle + found.ripple_phase_rad)
    np.testing.assert_allclose(driving, -opposing, atol=1e-12)
