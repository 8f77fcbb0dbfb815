"""Friction that grows with what its gear carries: named as friction, with its size, and gone where it is freed."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot
from finite_differences import check_derivatives
from robid.models.elastic.fit.fitting import fit_elastic, set_up
from robid.models.elastic.fit.nuisance.wording import free_with
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.causes import explain
from robid.models.elastic.judge.fitted import fitted_model
from robid.models.elastic.judge.validating import validate_elastic
from robid.robot.linearize import solve_statics
from robid.robot.model import build_model

FREQUENCY_HZ = np.geomspace(1, 60, 40)
PLACES = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2], [-1.1, 0.3], [1.5, 0.2], [-1.5, 0.1]])
ELSEWHERE = np.array([[1.4, 0.6], [-1.5, -0.6]])
OPTIONS, DELAY_S = ElasticOptions(), 1e-3
LEAST, MORE = 0.01, 0.01  # N m s/rad: twice as much under the largest load


def rubbing(viscous):
    """The arm with viscous friction in its first motor."""
    robot = two_joint_robot()
    shoulder, elbow = robot.joints
    friction = replace(shoulder.motor.friction, viscous_nms_rad=viscous)
    return replace(robot, joints=(replace(shoulder, motor=replace(shoulder.motor, friction=friction)), elbow))


def loads(places=PLACES):
    """How far the shoulder's gear is bent at rest in each configuration [mrad]."""
    robot = rubbing(LEAST)
    gear = [spring.name for spring in robot.springs].index("gear_1")
    return 1e3 * np.abs(solve_statics(build_model(robot), places).deflection[:, gear])


def measured(places=PLACES):
    """Each configuration with the friction of its load there; all with noise of one covariance."""
    robot = rubbing(LEAST)
    levels = LEAST + MORE * loads(places) / loads().max()
    parts = [
        exact_frf(rubbing(level), place, FREQUENCY_HZ, delay_s=DELAY_S).response
        for level, place in zip(levels, places, strict=True)
    ]
    clean, noisy = (
        exact_frf(robot, places, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=noise) for noise in (0.0, 0.002)
    )
    return replace(noisy, response=np.concatenate(parts) + noisy.response - clean.response)


def test_friction_that_grows_with_its_load_is_named_with_its_size_and_gone_where_it_is_freed():
    stated, frf = rubbing(LEAST), measured()
    before = fit_elastic(stated, frf, OPTIONS, DELAY_S)
    first, *_ = explain(fitted_model(stated, before, frf, OPTIONS, DELAY_S))
    assert (first.cause, first.names) == ("friction", ("friction of shoulder by its gear's load",))
    assert first.share > 0.9
    rotor = 20 * np.pi * stated.joints[0].motor.inertia_kgm2
    expected = 100 * MORE / rotor / loads().max()
    assert first.amounts[0] == pytest.approx(expected, rel=0.1)
    options = replace(OPTIONS, free=free_with(OPTIONS.free, first.free))
    after = fit_elastic(stated, frf, options, DELAY_S)
    assert after.costs.total < 1.2 * after.costs.expected.sum() < 0.5 * before.costs.total
    assert after.estimate.found["shoulder.load_friction_viscous"] == pytest.approx(expected, rel=0.05)
    assert after.estimate.found["shoulder.viscous"] == pytest.approx(LEAST, rel=0.05)
    # Elsewhere gears carry less: what was found there is not scaled by the largest load of a campaign.
    assert loads(ELSEWHERE).max() < 0.6 * loads().max()
    elsewhere = measured(ELSEWHERE)
    validated = validate_elastic(stated, after, elsewhere, options, DELAY_S, None)
    assert validated.average_cost < 1.2 * float((validated.expected_cost / validated.elements).mean())


def test_friction_that_does_not_change_is_not_said_to_grow_with_the_load():
    stated = rubbing(LEAST)
    frf = exact_frf(stated, PLACES, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=0.002)
    solution = fit_elastic(stated, frf, OPTIONS, DELAY_S)
    assert not any("friction" in each.cause for each in explain(fitted_model(stated, solution, frf, OPTIONS, DELAY_S)))


def test_derivatives_by_each_part_are_those_of_the_response():
    options = ElasticOptions(free=("shoulder.load_friction",))
    problem = set_up(rubbing(LEAST), measured(), options, DELAY_S)[0]
    rows = [row for row, name in enumerate(problem.parameters.names) if "load_friction" in name]
    assert len(rows) == 3
    check_derivatives(problem, rows)
