"""Friction that grows with what its gear carries: named as friction, with its size."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.causes import explain
from robid.models.elastic.judge.fitted import fitted_model
from robid.robot.linearize import solve_statics
from robid.robot.model import build_model

FREQUENCY_HZ = np.geomspace(1, 60, 40)
PLACES = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2], [-1.1, 0.3], [1.5, 0.2], [-1.5, 0.1]])
OPTIONS, DELAY_S = ElasticOptions(), 1e-3
LEAST, MORE = 0.01, 0.01  # N m s/rad: twice as much under the largest load


def rubbing(viscous):
    """The arm with viscous friction in its first motor."""
    robot = two_joint_robot()
    shoulder, elbow = robot.joints
    friction = replace(shoulder.motor.friction, viscous_nms_rad=viscous)
    return replace(robot, joints=(replace(shoulder, motor=replace(shoulder.motor, friction=friction)), elbow))


def measured():
    """Each configuration with the friction of its load there; all with noise of one covariance."""
    robot = rubbing(LEAST)
    gear = [spring.name for spring in robot.springs].index("gear_1")
    load = np.abs(solve_statics(build_model(robot), PLACES).deflection[:, gear])
    assert np.ptp(load) > 0.5 * load.max()
    levels = LEAST + MORE * load / load.max()
    parts = [
        exact_frf(rubbing(level), place, FREQUENCY_HZ, delay_s=DELAY_S).response
        for level, place in zip(levels, PLACES, strict=True)
    ]
    clean, noisy = (
        exact_frf(robot, PLACES, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=noise) for noise in (0.0, 0.002)
    )
    return replace(noisy, response=np.concatenate(parts) + noisy.response - clean.response)


def test_friction_that_grows_with_its_load_is_named_with_its_size():
    stated, frf = rubbing(LEAST), measured()
    solution = fit_elastic(stated, frf, OPTIONS, DELAY_S)
    first, *_ = explain(fitted_model(stated, solution, frf, OPTIONS, DELAY_S))
    assert (first.cause, first.names) == ("friction", ("friction of shoulder by its gear's load",))
    assert first.share > 0.9
    rotor = 20 * np.pi * stated.joints[0].motor.inertia_kgm2
    assert first.amounts[0] == pytest.approx(100 * MORE / rotor, rel=0.1)
    assert not first.free  # no fit estimates it
